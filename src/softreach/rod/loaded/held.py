"""All postures that an arm holds over a grid of activations, on as many sheets as there are.

They are the stable equilibria that are connected with the posture at rest, on the twins of both
sides. Where the flood is not cut, and both sides agree, there is one at each node. From there
branches are followed along the edges of the grid until none leads to another posture.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from softreach.kernels.loaded.unloaded_frames import LANES
from softreach.rod.loaded.flood import Flood, are_same, edges_along, follow, neighbors, smooth_edges
from softreach.rod.loaded.postures import Postures, polished
from softreach.rod.loaded.solver import Equilibria, Solver
from softreach.rod.tip_map import Held
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask, joined

_MOST = 4  # postures of one node
_END = 2.0**-10  # of an edge, to which the end of a branch is found
_SAME = 2e-3  # [rad, L], of postures of the arm itself
_POLISHED = 0.1  # [rad], by which the arm may differ from its twin
_LEAP = 0.3  # [L] between tips of neighbors, which may lie around a ring of leaning postures
_EVERY = 4  # nodes along each axis to one that lines lead to, where there is no flood
_UNKNOWN, _NONE = -2, -1


Points = Callable[[Array, Equilibria], Array]
"""(activations, postures) -> the places of the point that stands for the tip [m], shape (n, 3)."""


def held_over(
    postures: Postures, mirrored: Postures, gamma: Array, sizes: tuple[int, ...], points: Points
) -> Held:
    """The postures of both sides over a grid, see `TipMap.held`."""
    grid = _Grid(postures.solver, gamma, sizes)
    grid.fill(postures, grid.has_arm)
    is_doubled, beside = grid.states[:, 1] >= 0, grid.has_arm
    if postures.flood is not None and mirrored.flood is not None:
        beside = beside & postures.flood.differ(mirrored.flood, gamma)
    if beside.any():
        grid.fill(mirrored, beside)
    return grid.held(is_doubled, points)


class _Grid:
    """Postures at the nodes of a grid, and which of them lie on one branch."""

    def __init__(self, solver: Solver, gamma: Array, sizes: tuple[int, ...]) -> None:
        self.solver, self.gamma, self.sizes = solver, gamma, sizes
        self.length = solver.tables.arm.length
        self.has_arm: Mask = np.asarray(np.isfinite(gamma).all(axis=1))
        self.states = np.full((len(gamma), _MOST), _NONE)
        """Numbers of the postures of each node."""
        self.node = np.empty(0, int)
        self.equilibria = solver.empty(0)
        self.next = np.empty((0, 2 * len(sizes)), int)
        """Postures on the same branch at the next node down and up each axis."""
        self.links = list[Index]()
        self.ends = list[Index]()
        self.end_gamma = list[Array]()
        self.end_postures = list[Equilibria]()

    def fill(self, postures: Postures, where: Mask) -> None:
        """Find the postures that are connected with those at some nodes, on the twin of a side."""
        first, uncut = len(self.node), self.has_arm & (postures.flood is not None)
        if postures.flood is not None:
            uncut[uncut] = postures.flood.is_uncut(self.gamma[uncut])
        by_lines = not uncut.any()
        if by_lines:
            place = np.unravel_index(np.arange(len(where)), self.sizes)
            uncut = (np.stack(place) % _EVERY == 0).all(axis=0)
        nodes = np.flatnonzero(where & uncut)
        known = postures.find(self.gamma[nodes], by_lines=by_lines)
        good = known.is_stable
        at = np.full(len(self.gamma), _NONE)
        at[nodes[good]] = self._put(nodes[good], known.of(good))
        if not len(self.node):
            return
        self._link_smooth(at, postures.flood)
        front = np.arange(first, len(self.node))
        while len(front):
            front = self._wave(postures.twin, front)

    def held(self, is_doubled: Mask, points: Points) -> Held:
        """What was found."""
        none = np.empty((0, 2), int)
        links, ends = (np.concatenate([none, *pairs]) for pairs in (self.links, self.ends))
        end_gamma = np.concatenate([self.gamma[:0], *self.end_gamma])
        end_postures = joined([self.equilibria.of(slice(0)), *self.end_postures])
        tips = points(self.gamma[self.node], self.equilibria)
        end_tips = points(end_gamma, end_postures)
        return Held(self.node, tips, links, ends, end_tips, is_doubled, self.equilibria.frame)

    def _put(self, nodes: Index, equilibria: Equilibria) -> Index:
        """Numbers of postures at nodes, known ones or new; none where a node has too many."""
        numbers, left = np.full(len(nodes), _NONE), np.arange(len(nodes))
        while len(left):
            _, first = np.unique(nodes[left], return_index=True)
            now = left[first]
            numbers[now] = self._put_one_each(nodes[now], equilibria.of(now))
            left = np.delete(left, first)
        return numbers

    def _put_one_each(self, nodes: Index, equilibria: Equilibria) -> Index:
        numbers, open_ = np.full(len(nodes), _NONE), np.arange(len(nodes))
        for place in range(_MOST):
            at = self.states[nodes[open_], place]
            same = at >= 0
            old = self.equilibria.of(at[same])
            same[same] = are_same(equilibria.of(open_[same]), old, self.length, _SAME)
            numbers[open_[same]] = at[same]
            new = open_[at < 0]
            numbers[new] = self.states[nodes[new], place] = len(self.node) + np.arange(len(new))
            self.node = np.concatenate([self.node, nodes[new]])
            self.equilibria = joined([self.equilibria, equilibria.of(new)])
            unknown = np.full((len(new), self.next.shape[1]), _UNKNOWN)
            self.next = np.concatenate([self.next, unknown])
            open_ = open_[(at >= 0) & ~same]
        return numbers

    def _link(self, low: Index, high: Index, column: Index | int) -> None:
        """Note that postures are on one branch with those at the next node in a direction."""
        self.next[low, column], self.next[high, column ^ 1] = high, low
        self.links.append(np.stack([low, high], axis=1))

    def _link_smooth(self, at: Index, flood: Flood | None) -> None:
        """Link neighbors on an edge in an uncut cell, or that goes on as that beside it does."""
        lost = np.where(at >= 0, 0.0, np.nan)[:, None]
        frames = (self.equilibria.frame[at] + lost).reshape(*self.sizes, -1)
        tips = (self.equilibria.tips[at] / self.length + lost).reshape(*self.sizes, 3)
        for axis in range(len(self.sizes)):
            low, high = edges_along(self.sizes, axis)
            smooth = smooth_edges(frames, tips, axis).ravel()
            both = (at[low] >= 0) & (at[high] >= 0)
            low, high, smooth = low[both], high[both], smooth[both]
            if flood is not None:
                smooth |= flood.is_uncut(0.5 * (self.gamma[low] + self.gamma[high]))
            self._link(at[low[smooth]], at[high[smooth]], 2 * axis + 1)

    def _wave(self, twin: Solver, front: Index) -> Index:
        """Follow branches from some postures to all neighbors; the new postures there."""
        known, columns = len(self.node), np.arange(self.next.shape[1])
        for up in (1, 0):  # those that are found from below need not be followed from above
            row, column = np.nonzero((self.next[front] == _UNKNOWN) & (columns % 2 == up))
            state = front[row]
            to, exists = neighbors(self.sizes, self.node[state], column // 2, 2 * up - 1)
            exists &= self.has_arm[to]
            if exists.any():
                self._grow(twin, state[exists], to[exists], column[exists])
        return np.arange(known, len(self.node))

    def _grow(self, twin: Solver, state: Index, to: Index, column: Index) -> None:
        ends, share = self._followed(twin, state, to, column)
        good, before = ends.is_found.copy(), self.equilibria.of(state)
        numbers = self._put(to[good], ends.of(good))
        leaps = np.linalg.norm(ends.tips - before.tips, axis=1) > _LEAP * self.length
        ends.put(np.flatnonzero(leaps), before.of(leaps))
        share[leaps] = 0.0
        kept = (numbers >= 0) & ~leaps[good]
        self._link(state[good][kept], numbers[kept], column[good][kept])
        good &= ~leaps
        lost = self.next[state, column] == _UNKNOWN
        self.next[state[lost], column[lost]] = _NONE
        self.ends.append(np.stack([state[~good], to[~good]], axis=1))
        begin, end = self.gamma[self.node[state[~good]]], self.gamma[to[~good]]
        self.end_gamma.append(begin + share[~good, None] * (end - begin))
        self.end_postures.append(ends.of(~good))

    def _followed(
        self, twin: Solver, state: Index, to: Index, column: Index
    ) -> tuple[Equilibria, Array]:
        """Postures of the arm where branches of the twin end, and shares of edges up to there."""
        start = self.equilibria.of(state)
        back = self.next[state, column ^ 1]
        before = self.equilibria.frame[np.maximum(back, 0)]
        slopes = np.where((back >= 0)[:, None], start.frame - before, 0.0)
        ends, share = start.of(np.arange(len(state))), np.ones(len(state))

        def run(rows: slice) -> None:
            begin, end = self.gamma[self.node[state[rows]]], self.gamma[to[rows]]
            last, _, share[rows] = follow(
                twin, begin, end, start.of(rows), slopes[rows], shortest=_END
            )
            arrived = np.flatnonzero(last.is_found)
            of_arm = polished(self.solver, end[arrived], last.of(arrived), _POLISHED)
            last.put(arrived[of_arm.is_found], of_arm.of(of_arm.is_found))
            ends.put(rows, last)

        size = max(8 * LANES, len(state) // 4)
        parallel.run(partial(run, b) for b in parallel.blocks(len(state), size))
        return ends, share
