"""Branches of equilibria, followed along ways of activations or loads, and over a grid.

A step along a way predicts how the nodes of an arm see the world by the slope of the last one, and
corrects that by Newton's method. It counts where the correction is small, of the frames and of the
tip, and where the equilibrium is stable; otherwise it is tried at half its length.

The grid over the activation box is flooded from rest, node after node along its edges, each step a
branch that is followed. Neighbors that are not on one branch are cut: between them the arm snaps,
or leans to either side. In cells without a cut, their nodes give the frames to begin from.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from softreach.kernels.loaded.shooting import UNEVEN, interpolate
from softreach.rod.inputs import ActivationBox
from softreach.rod.loaded.solver import ALL_LOADS, Equilibria, Solver, turn_between, units
from softreach.support.arrays import Array, Index, Mask
from softreach.support.lazy import lazy

_CORRECTION, _CORRECTION_OF_NODES = 0.12, 0.03  # [rad], of one segment and of several
_TIP = 3.0  # weight of the correction of a tip [rad/L]
_SHORTEST = 2.0**-20  # of a path, below which its branch has ended
_MOST_STEPS = 3000
_SAME = 0.02  # [rad, L]
_SMOOTH_FRAME, _SMOOTH_TIP = 0.12, 0.04  # second differences that need no proof [rad], [L]
CUT = 1e6  # roughness of cells that are cut
PARTS = 64  # of a line, at the ends of which cuts are looked for


class Followed(NamedTuple):
    """Branches up to where they were followed."""

    last: Equilibria
    """The last equilibrium; undecided where it is not that of the end of the way."""
    has_ended: Mask
    """Mask of branches that end before the way does, shape (n,)."""
    share: Array
    """Of the way that was followed, shape (n,)."""


def follow(
    solver: Solver,
    begin: Array,
    end: Array,
    start: Equilibria,
    slope: Array | None = None,
    *,
    hangs: bool = True,
    shortest: float = _SHORTEST,
) -> Followed:
    """Branches of stable equilibria along straight ways between activations (n, bundles).

    Each starts by itself, with the change of its frame along the way (n, component) if that is
    known. An arm that does not hang yet gets its loads along the way. A branch has ended where its
    steps become the shortest, over the length of the way.
    """
    n, last = len(begin), start.of(np.arange(len(begin)))
    place, step = np.where(hangs & (begin == end).all(axis=1), 1.0, 0.0), np.ones(n)
    slopes = np.zeros_like(last.frame) if slope is None else slope.copy()
    moves, is_first, ended = np.zeros((n, 3)), np.ones(n, bool), ~start.is_found
    for _ in range(_MOST_STEPS):
        rows = np.flatnonzero(~ended & (place < 1.0))
        if not len(rows):
            break
        to = np.minimum(1.0, place[rows] + step[rows])
        h = to - place[rows]
        guess = units(last.frame[rows] + h[:, None] * slopes[rows])
        gamma = begin[rows] + to[:, None] * (end[rows] - begin[rows])
        new = solver.search(gamma, guess, ALL_LOADS if hangs else to)
        missed = new.tips - last.tips[rows] - h[:, None] * moves[rows]
        good, growth = _judged(solver, new, guess, missed, is_first[rows])
        on, h_on, new = rows[good], h[good, None], new.of(good)
        slopes[on] = (new.frame - last.frame[on]) / h_on
        moves[on] = (new.tips - last.tips[on]) / h_on
        last.put(on, new)
        place[on], is_first[on] = to[good], False
        step[rows] = h * growth
        ended[rows] = ~good & (step[rows] < shortest)
    return Followed(last.only(start.is_found & (place >= 1.0)), ended, place)


def _judged(
    solver: Solver, new: Equilibria, guess: Array, missed: Array, is_first: Mask
) -> tuple[Mask, Array]:
    """Mask of steps that count, and what the lengths of the next ones are multiplied by."""
    allowed = _CORRECTION if solver.tables.segments == 1 else _CORRECTION_OF_NODES
    with np.errstate(all="ignore"):  # of what is not found
        off = np.linalg.norm(missed, axis=1) / solver.tables.arm.length
        turn = turn_between(new.frame, guess)
        change = np.maximum(turn, np.where(is_first, 0.5, 1.0) * _TIP * off)
        wanted = 0.5 * (np.sqrt(1.0 + 4.0 * allowed / change) - 1.0)  # half of what is allowed
    good = new.is_stable & (change < np.where(is_first, 2.0, 1.0) * allowed)
    shorter = np.where(wanted > 0.1, 0.4, 0.25)
    return good, np.where(good, np.clip(wanted, 0.5, 4.0), shorter)


class Flood:
    """The activation box, flooded from the posture at rest over an even grid."""

    held: Equilibria
    """Postures of the nodes, the last bundle varying fastest; not found where none is held."""
    is_whole: Mask
    """True for cells whose edges are all on one branch, shape of the cells."""

    def __init__(
        self,
        solver: Solver,
        box: ActivationBox,
        sizes: tuple[int, ...],
        rest: Array,
        start: Equilibria,
    ) -> None:
        """Flood a grid with so many nodes for every bundle, from a posture of the twin at rest."""
        self.solver, self.box, self.sizes, self.rest = solver, box, sizes, rest
        ends = zip(box.low, box.high, sizes, strict=True)
        axes = np.meshgrid(*(np.linspace(*end) for end in ends), indexing="ij")
        self.gamma = np.stack(axes, axis=-1).reshape(-1, box.bundles)
        self.held = solver.empty(len(self.gamma))
        self.linked = np.zeros((len(sizes), len(self.gamma)), bool)  # to the next along each axis
        away = (((self.gamma - rest) / box.scales) ** 2).sum(axis=1)
        nearest = np.array([away.argmin()])
        self.held.put(nearest, follow(solver, rest, self.gamma[nearest], start).last)
        front = nearest[self.held.is_found[nearest]]
        while len(front):
            front = self._wave(front)
        self._link()

    def _wave(self, front: Index) -> Index:
        """Follow the branches from newly known nodes to all neighbors; the nodes then known."""
        axes, before = len(self.sizes), self.held.is_found
        origin, axis = np.tile(front, 2 * axes), np.repeat(np.arange(axes), 2 * len(front))
        way = np.tile(np.repeat([-1, 1], len(front)), axes)
        to, inside = neighbors(self.sizes, origin, axis, way)
        left = np.stack([origin, to, axis, way])[:, inside]
        at, line = ((self.gamma[nodes] - self.rest) / self.box.scales for nodes in left[:2])
        share = (at * line).sum(axis=1) / np.maximum((line * line).sum(axis=1), 1e-300)
        off = at - np.clip(share, 0.0, 1.0)[:, None] * line  # near the lines from rest first
        left = left[:, np.argsort(np.sqrt((off * off).sum(axis=1)), kind="stable")]
        while True:
            left = left[:, ~self.held.is_found[left[1]]]
            _, first = np.unique(left[1], return_index=True)
            if not len(first):
                break
            self._grow(*left[:, first])
            left = np.delete(left, first, axis=1)
        return np.flatnonzero(self.held.is_found & ~before)

    def _grow(self, origin: Index, to: Index, axis: Index, way: Index) -> None:
        back, inside = neighbors(self.sizes, origin, axis, -way)
        is_known = (inside & self.held.is_found[back])[:, None]
        slopes = np.where(is_known, self.held.frame[origin] - self.held.frame[back], 0.0)
        ends = self.gamma[origin], self.gamma[to]
        new = follow(self.solver, *ends, self.held.of(origin), slopes).last
        good = new.is_found
        self.held.put(to[good], new.of(good))
        lower = np.where(way > 0, origin, to)
        self.linked[axis[good], lower[good]] = True

    def _link(self) -> None:
        """Tell edges on one branch from cuts: smooth ones at once, the others by following them."""
        length = self.solver.tables.arm.length
        frames, tips = self.held.frame.reshape(*self.sizes, -1), self.held.tips / length
        whole = over_cells(self.held.is_found.reshape(self.sizes), np.logical_and)
        for axis, size in enumerate(self.sizes):
            if size < 2:
                continue
            low, high = edges_along(self.sizes, axis)
            both = self.held.is_found[low] & self.held.is_found[high]
            smooth = smooth_edges(frames, tips.reshape(*self.sizes, 3), axis).ravel()
            self.linked[axis, low[both & smooth]] = True
            both &= ~self.linked[axis, low]
            low, high = low[both], high[both]
            new = follow(self.solver, self.gamma[low], self.gamma[high], self.held.of(low)).last
            self.linked[axis, low[are_same(new, self.held.of(high), length)]] = True
            edges = np.delete(self.linked[axis].reshape(self.sizes), -1, axis)
            whole &= over_cells(edges, np.logical_and, axis)
        self.is_whole = whole

    def at(self, gamma: Array) -> tuple[Array, Array]:
        """Frames to begin from, and the roughness of cells; `CUT` where no frame is known."""
        free, of_nodes = self.box.is_free, self.held.frame
        sizes, places = np.array(self.sizes)[free], self._in_cells(gamma)[:, free]
        fill = 3 - len(sizes)
        places = np.pad(places, ((0, 0), (fill, 0)))
        sizes = np.pad(sizes, (fill, 0), constant_values=1)
        frames, rough = np.empty((len(gamma), of_nodes.shape[1])), np.empty(len(gamma))
        interpolate(of_nodes, self._rough.ravel(), places, sizes, frames, rough)
        frames[rough == CUT] = of_nodes[self.held.is_found.argmax()]
        return frames, rough

    @lazy
    def _rough(self) -> Array:
        """Third differences of frames over each cell and those beside it."""
        frames, smooth = self.held.frame.reshape(*self.sizes, -1), self.is_whole
        rough = np.zeros(smooth.shape)
        for axis, size in enumerate(self.sizes):
            if size > 1:
                first = np.clip(np.arange(size - 1) - 1, 0, size - 4)
                smooth = np.logical_and.reduce([smooth.take(first + k, axis) for k in range(3)])
                jumps = np.abs(np.diff(frames, 3, axis)).max(axis=-1).take(first, axis)
                rough = np.maximum(rough, over_cells(jumps, np.maximum, axis))
        return np.where(self.is_whole, np.where(smooth, rough, UNEVEN), CUT)

    def nearest(self, gamma: Array) -> tuple[Array, Equilibria]:
        """The nearest nodes, and their postures."""
        last = np.array(self.sizes) - 1
        place = np.clip(np.round(self._in_cells(gamma)), 0, last)
        node = np.atleast_1d(np.ravel_multi_index(tuple(place.astype(int).T), self.sizes))
        at = self.box.low + place / np.maximum(last, 1) * self.box.widths
        return at, self.held.of(node)

    def is_uncut(self, gamma: Array) -> Mask:
        """Mask of activations in cells whose edges are all on one branch."""
        return self.is_whole[self._cells_at(gamma)]

    def differ(self, other: Flood, gamma: Array) -> Mask:
        """Mask of activations in cells at a corner of which two floods hold different postures."""
        length = np.ptp(self.held.tips[self.held.is_found], axis=0).max(initial=0.0)
        differ = ~are_same(self.held, other.held, length).reshape(self.sizes)
        return over_cells(differ, np.logical_or)[self._cells_at(gamma)]

    def clear(self, gamma: Array) -> Array:
        """Shares of the lines from rest up to which they meet no cut, shape (n,)."""
        t = np.arange(1, PARTS + 1)[:, None, None] / PARTS
        along = self.rest + t * (gamma - self.rest)
        whole = self.is_uncut(along.reshape(-1, gamma.shape[1])).reshape(PARTS, -1)
        return np.logical_and.accumulate(whole).sum(axis=0) / PARTS

    def _in_cells(self, gamma: Array) -> Array:
        return (gamma - self.box.low) * ((np.array(self.sizes) - 1) / self.box.scales)

    def _cells_at(self, gamma: Array) -> tuple[Index, ...]:
        cells = np.floor(self._in_cells(gamma)).astype(int)
        return tuple(np.clip(cells, 0, np.maximum(np.array(self.sizes) - 2, 0)).T)


def neighbors(
    sizes: tuple[int, ...], nodes: Index, axis: Index, way: Index | int
) -> tuple[Index, Mask]:
    """Nodes of a grid one step down or up an axis, and mask of those that are in the grid."""
    place, each = np.stack(np.unravel_index(nodes, sizes)), np.arange(len(nodes))
    moved = place[axis, each] + way
    place[axis, each] = moved
    inside = (moved >= 0) & (moved < np.array(sizes)[axis])
    return np.asarray(np.ravel_multi_index(tuple(place), sizes, mode="clip"), np.int64), inside


def edges_along(sizes: tuple[int, ...], axis: int) -> tuple[Index, Index]:
    """Nodes at the lower and at the upper ends of all edges of a grid along an axis."""
    numbers = np.arange(np.prod(sizes)).reshape(sizes)
    return np.delete(numbers, -1, axis).ravel(), np.delete(numbers, 0, axis).ravel()


def over_cells(values: Any, combine: np.ufunc, along: int | None = None) -> Any:
    """Values at the corners of cells, or on their edges along one axis, combined over each cell."""
    for axis in range(values.ndim):
        if axis != along and values.shape[axis] > 1:
            values = combine(np.delete(values, -1, axis), np.delete(values, 0, axis))
    return values


def are_same(some: Equilibria, others: Equilibria, length: float, within: float = _SAME) -> Mask:
    """Mask of those that are the same posture of an arm of a length [m], to so much [rad, L]."""
    with np.errstate(invalid="ignore"):  # of what is not found
        moved = np.linalg.norm(some.tips - others.tips, axis=1)
        apart = turn_between(some.frame, others.frame)
    near = (apart < within) & (moved < within * length)
    return np.asarray(near & some.is_found & others.is_found)


def smooth_edges(frames: Array, tips: Array, axis: int) -> Mask:
    """Edges of a grid along an axis that go on as an edge beside them does.

    Frames (*nodes, components) and tips (*nodes, 3) [L] are NaN where none is known.
    """
    smooth = np.zeros(np.delete(tips[..., 0], -1, axis).shape, bool)
    if tips.shape[axis] < 3:
        return smooth
    bend = np.diff(frames, 2, axis)
    bend = np.sqrt((bend.reshape(*bend.shape[:-1], -1, 3) ** 2).sum(axis=-1)).max(axis=-1)
    jerk = np.sqrt((np.diff(tips, 2, axis) ** 2).sum(axis=-1))
    with np.errstate(invalid="ignore"):
        calm = (bend < _SMOOTH_FRAME) & (jerk < _SMOOTH_TIP)
    ends, of_calm = np.moveaxis(smooth, axis, 0), np.moveaxis(calm, axis, 0)
    ends[1:] |= of_calm
    ends[:-1] |= of_calm
    return smooth
