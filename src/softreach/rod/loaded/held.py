"""All postures that an arm holds over a grid of activations, on as many sheets as there are.

They are the stable equilibria that are connected with the posture at rest, on the twins of both
sides. Where the flood is not cut, and both sides agree, there is one at each node. From there
branches are followed along the edges of the grid until none leads to another posture.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.lanes import LANES
from softreach.rod.loaded.flood import Flood, are_same, smooth_edges
from softreach.rod.loaded.following import follow
from softreach.rod.loaded.postures import FloodedPostures, Postures, polished
from softreach.rod.loaded.shooting import Equilibria, Shots
from softreach.rod.loaded.solver import Solver
from softreach.rod.tip_map import BLOCK, Held, TipStatus
from softreach.support import parallel
from softreach.support.arrays import joined

__all__ = ["held_over"]

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_MOST = 4  # postures of one node
_END = 2.0**-10  # of an edge, to which the end of a branch is found
_SAME = 2e-3  # [rad, L], of postures of the arm itself
_POLISHED = 0.1  # [rad], by which the arm may differ from its twin
_LEAP = 0.3  # [L] between tips of neighbors, which may lie around a ring of leaning postures
_EVERY = 4  # nodes along each axis to one that lines lead to, where there is no flood
_UNKNOWN, _NONE = -2, -1


Points = Callable[[Array, Shots], Array]
"""(activations, postures) -> the places of the point that stands for the tip [m], shape (n, 3)."""


def held_over(
    postures: Postures, mirrored: Postures, gamma: Array, sizes: tuple[int, ...], points: Points
) -> Held:
    """The postures of both sides over a grid, see `TipMap.held`."""
    grid = _Grid(postures.solver, gamma, sizes)
    grid.fill(postures, grid.has_arm)
    is_doubled = grid.states[:, 1] >= 0
    beside = grid.has_arm
    if isinstance(postures, FloodedPostures) and isinstance(mirrored, FloodedPostures):
        beside = beside & _differ(postures.flood, mirrored.flood, gamma)
    if beside.any():
        grid.fill(mirrored, beside)
    return grid.held(is_doubled, points)


def _differ(flood: Flood, other: Flood, gamma: Array) -> Mask:
    """Mask of activations in cells at a corner of which two floods hold different postures."""
    length = np.ptp(flood.held.tips[flood.held.is_found], axis=0).max(initial=0.0)
    differ = ~are_same(flood.held, other.held, length).reshape(flood.sizes)
    for axis, size in enumerate(flood.sizes):
        if size > 1:
            differ = np.delete(differ, -1, axis) | np.delete(differ, 0, axis)
    return differ[flood.cells_at(gamma)]


class _Grid:
    """Postures at the nodes of a grid, and which of them lie on one branch."""

    def __init__(self, solver: Solver, gamma: Array, sizes: tuple[int, ...]) -> None:
        self.solver, self.gamma, self.sizes = solver, gamma, sizes
        self.length = solver.tables.arm.length
        self.has_arm: Mask = np.asarray(np.isfinite(gamma).all(axis=1))
        self.states = np.full((len(gamma), _MOST), _NONE)
        """Numbers of the postures of each node."""
        self.node = np.empty(0, np.intp)
        self.shots = _shots(solver.empty(0))
        self.next = np.empty((0, 2 * len(sizes)), np.intp)
        """Postures on the same branch at the next node down and up each axis."""
        self.links = list[Index]()
        self.ends = list[Index]()
        self.end_gamma = list[Array]()
        self.end_shots = list[Shots]()

    def fill(self, postures: Postures, where: Mask) -> None:
        """Find the postures that are connected with those at some nodes, on the twin of a side."""
        first, uncut = len(self.node), where.copy()
        if isinstance(postures, FloodedPostures):
            uncut[where] = postures.flood.is_uncut(self.gamma[where])
        else:
            place = np.unravel_index(np.arange(len(where)), self.sizes)
            uncut &= (np.stack(place) % _EVERY == 0).all(axis=0)
        nodes = np.flatnonzero(uncut)
        known = _found(postures, self.gamma[nodes])
        good = known.status == TipStatus.STABLE
        nodes, known = nodes[good], known.of(good)
        at = np.full(len(self.gamma), _NONE)
        at[nodes] = self._put(nodes, _shots(known))
        if not len(self.node):
            return
        self._link_smooth(at, postures)
        front = np.arange(first, len(self.node))
        while len(front):
            front = self._wave(postures.twin, front)

    def held(self, is_doubled: Mask, points: Points) -> Held:
        """What was found."""
        pairs, ends = (
            np.concatenate([np.empty((0, 2), np.intp), *p]) for p in (self.links, self.ends)
        )
        end_gamma = np.concatenate([self.gamma[:0], *self.end_gamma])
        end_shots = joined([self.shots.of(np.arange(0)), *self.end_shots])
        tips, end_tips = points(self.gamma[self.node], self.shots), points(end_gamma, end_shots)
        return Held(self.node, tips, pairs, ends, end_tips, is_doubled, self.shots.frame)

    def _put(self, nodes: Index, shots: Shots) -> Index:
        """Numbers of postures at nodes, known ones or new; none where a node has too many."""
        numbers, left = np.full(len(nodes), _NONE), np.arange(len(nodes))
        while len(left):
            _, first = np.unique(nodes[left], return_index=True)
            now = left[first]
            numbers[now] = self._put_one_each(nodes[now], shots.of(now))
            left = np.delete(left, first)
        return numbers

    def _put_one_each(self, nodes: Index, shots: Shots) -> Index:
        numbers, open_ = np.full(len(nodes), _NONE), np.arange(len(nodes))
        for place in range(_MOST):
            at = self.states[nodes[open_], place]
            same = at >= 0
            old = self.shots.of(at[same])
            same[same] = are_same(shots.of(open_[same]), old, self.length, _SAME)
            numbers[open_[same]] = at[same]
            new = open_[at < 0]
            numbers[new] = self.states[nodes[new], place] = len(self.node) + np.arange(len(new))
            self._append(nodes[new], shots.of(new))
            open_ = open_[(at >= 0) & ~same]
        return numbers

    def _append(self, nodes: Index, shots: Shots) -> None:
        if not len(nodes):
            return
        self.node = np.concatenate([self.node, nodes])
        self.shots = joined([self.shots, shots])
        unknown = np.full((len(nodes), self.next.shape[1]), _UNKNOWN)
        self.next = np.concatenate([self.next, unknown])

    def _link(self, low: Index, high: Index, column: Index | int) -> None:
        """Note that postures are on one branch with those at the next node in a direction."""
        self.next[low, column], self.next[high, column ^ 1] = high, low
        self.links.append(np.stack([low, high], axis=1))

    def _link_smooth(self, at: Index, postures: Postures) -> None:
        """Link neighbors on an edge in an uncut cell, or that goes on as that beside it does."""
        lost = np.where(at >= 0, 0.0, np.nan)[:, None]
        frames = (self.shots.frame[at] + lost).reshape(*self.sizes, -1)
        tips = (self.shots.tips[at] / self.length + lost).reshape(*self.sizes, 3)
        numbers = np.arange(len(at)).reshape(self.sizes)
        for axis in range(len(self.sizes)):
            low, high = (np.delete(numbers, end, axis).ravel() for end in (-1, 0))
            smooth = smooth_edges(frames, tips, axis).ravel()
            if isinstance(postures, FloodedPostures):
                smooth |= postures.flood.is_uncut(0.5 * (self.gamma[low] + self.gamma[high]))
            smooth &= (at[low] >= 0) & (at[high] >= 0)
            self._link(at[low[smooth]], at[high[smooth]], 2 * axis + 1)

    def _wave(self, twin: Solver, front: Index) -> Index:
        """Follow branches from some postures to all neighbors; the new postures there."""
        known, columns = len(self.node), np.arange(self.next.shape[1])
        for up in (1, 0):  # those that are found from below need not be followed from above
            row, column = np.nonzero((self.next[front] == _UNKNOWN) & (columns % 2 == up))
            state = front[row]
            place = np.stack(np.unravel_index(self.node[state], self.sizes), axis=1)
            place[np.arange(len(state)), column // 2] += 2 * up - 1
            inside = ((place >= 0) & (place < self.sizes)).all(axis=1)
            to = np.atleast_1d(np.ravel_multi_index(tuple(place[inside].T), self.sizes))
            if len(to):
                self._grow(twin, state[inside], to, column[inside])
        return np.arange(known, len(self.node))

    def _grow(self, twin: Solver, state: Index, to: Index, column: Index) -> None:
        exists = self.has_arm[to]
        state, to, column = state[exists], to[exists], column[exists]
        found, share = self._followed(twin, state, to, column)
        good = found.is_found.copy()
        numbers = self._put(to[good], found.of(good))
        before = self.shots.of(state)
        leaps = np.linalg.norm(found.tips - before.tips, axis=1) > _LEAP * self.length
        found.put(np.flatnonzero(leaps), before.of(leaps))
        share[leaps] = 0.0
        kept = (numbers >= 0) & ~leaps[good]
        self._link(state[good][kept], numbers[kept], column[good][kept])
        good &= ~leaps
        lost = self.next[state, column] == _UNKNOWN
        self.next[state[lost], column[lost]] = _NONE
        self.ends.append(np.stack([state[~good], to[~good]], axis=1))
        begin, end = self.gamma[self.node[state[~good]]], self.gamma[to[~good]]
        self.end_gamma.append(begin + share[~good, None] * (end - begin))
        self.end_shots.append(found.of(~good))

    def _followed(
        self, twin: Solver, state: Index, to: Index, column: Index
    ) -> tuple[Shots, Array]:
        """Postures of the arm at the ends of branches of the twin, or where these end.

        And the shares of the edges up to there.
        """
        start = self.shots.of(state)
        back = self.next[state, column ^ 1]
        before = self.shots.frame[np.maximum(back, 0)]
        slopes = np.where((back >= 0)[:, None], start.frame - before, 0.0)
        out, share = start.of(np.arange(len(state))), np.ones(len(state))

        def run(rows: slice) -> None:
            some = np.arange(len(state))[rows]
            begin, end = self.gamma[self.node[state[some]]], self.gamma[to[some]]
            branch = follow(twin, begin, end, start.of(some), slopes[some], shortest=_END)
            shots, share[some] = branch.shots, branch.share
            arrived = np.flatnonzero(shots.is_found)
            of_arm = polished(self.solver, end[arrived], shots.of(arrived), _POLISHED)
            shots.put(arrived[of_arm.is_found], of_arm.of(of_arm.is_found))
            out.put(some, shots)

        size = max(8 * LANES, len(state) // 4)
        parallel.run(partial(run, b) for b in parallel.blocks(len(state), size))
        return out, share


def _found(postures: Postures, gamma: Array) -> Equilibria:
    """Postures of activations in uncut cells; by lines where there is no flood."""
    known = postures.solver.empty(len(gamma))
    parallel.run(partial(postures.direct, gamma, b, known) for b in _blocks(gamma, BLOCK // 8))
    if not isinstance(postures, FloodedPostures):
        rows = np.flatnonzero(known.status != TipStatus.STABLE)
        blocks = _blocks(rows, 32 * LANES)
        parallel.run(partial(postures.by_line, gamma, rows[b], known) for b in blocks)
    return known


def _blocks(values: Array | Index, size: int) -> list[slice]:
    return parallel.blocks(len(values), size)


def _shots(known: Equilibria) -> Shots:
    return Shots(known.tips, known.frame, known.margin, known.status == TipStatus.STABLE)
