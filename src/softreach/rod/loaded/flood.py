"""Postures at the nodes of a grid over the activation box, and the cuts between them.

The grid is flooded from rest, node after node along its edges, each step a branch that is followed.
Neighbors that are not on one branch are cut: between them the arm snaps, or leans to either side.
Cells without a cut tell where to begin within them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.loaded.grid_values import interpolate
from softreach.rod.activation_box import ActivationBox
from softreach.rod.loaded.following import follow
from softreach.rod.loaded.shooting import Shots, turn_between
from softreach.rod.loaded.solver import Solver
from softreach.support.lazy import lazy

__all__ = ["Flood", "are_same", "grid_sizes", "smooth_edges"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Index = NDArray[np.intp]

_NODES = {1: 33, 2: 33, 3: 17}
"""Nodes per free bundle: at most a few thousand postures."""
_SAME = 0.02  # [rad, L]
_SMOOTH_FRAME, _SMOOTH_TIP = 0.12, 0.04  # second differences that need no proof [rad], [L]
_UNEVEN = 1e3  # roughness of whole cells beside others
PARTS = 64  # of a line, at which it is asked for cuts


def grid_sizes(box: ActivationBox) -> tuple[int, ...] | None:
    """Nodes for every bundle, or None for more free bundles than a grid can hold."""
    nodes = _NODES.get(box.dimension)
    if nodes is None:
        return None
    return tuple(nodes if free else 1 for free in box.is_free)


@dataclass(frozen=True, eq=False)
class Flood:
    """The flooded grid."""

    box: ActivationBox
    sizes: tuple[int, ...]
    held: Shots
    """Postures of the nodes, the last bundle varying fastest; not found where none is held."""
    is_whole: Mask
    """True for cells whose edges are all on one branch, shape of the cells."""

    @classmethod
    def over(
        cls, solver: Solver, box: ActivationBox, sizes: tuple[int, ...], rest: Array, start: Shots
    ) -> Flood:
        """Flood a grid.

        Args:
            solver: That of the twin.
            box: Bounds of the activations.
            sizes: Nodes for every bundle.
            rest: Activations at rest, shape (bundles,).
            start: The posture there.
        """
        return _Flooding(solver, box, sizes).run(rest, start)

    def at(self, gamma: Array) -> tuple[Array, Array]:
        """Frames to begin from, and the roughness of cells; infinite where no frame is known."""
        free, of_nodes, rough = self.box.is_free, self.held.frame, self._rough
        sizes, places = np.array(self.sizes)[free], self._in_cells(gamma)[:, free]
        fill = 3 - len(sizes)
        places = np.pad(places, ((0, 0), (fill, 0)))
        sizes = np.pad(sizes, (fill, 0), constant_values=1)
        frames = np.empty((len(gamma), of_nodes.shape[1]))
        interpolate(of_nodes, rough.ravel() < _UNEVEN, places, sizes, frames)
        rough = rough[self.cells_at(gamma)]
        frames[np.isinf(rough)] = of_nodes[self.held.is_found.argmax()]
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
                for other, length in enumerate(self.sizes):
                    if other != axis and length > 1:
                        jumps = np.maximum(np.delete(jumps, -1, other), np.delete(jumps, 0, other))
                rough = np.maximum(rough, jumps)
        return np.where(self.is_whole, np.where(smooth, rough, _UNEVEN), np.inf)

    def nearest(self, gamma: Array) -> tuple[Array, Shots]:
        """The nearest nodes, and their postures."""
        last = np.array(self.sizes) - 1
        place = np.clip(np.round(self._in_cells(gamma)), 0, last)
        node = np.ravel_multi_index(tuple(place.astype(np.intp).T), self.sizes)
        return self.box.low + place / np.maximum(last, 1) * self.box.widths, self.held.of(
            np.atleast_1d(node)
        )

    def is_uncut(self, gamma: Array) -> Mask:
        """Mask of activations in cells whose edges are all on one branch."""
        return self.is_whole[self.cells_at(gamma)]

    def clear(self, rest: Array, gamma: Array) -> Array:
        """Shares of the lines from rest up to which they meet no cut, shape (n,)."""
        t = np.arange(1, PARTS + 1)[:, None, None] / PARTS
        along = rest + t * (gamma - rest)
        whole = self.is_uncut(along.reshape(-1, gamma.shape[1])).reshape(PARTS, -1)
        return np.logical_and.accumulate(whole).sum(axis=0) / PARTS

    def _in_cells(self, gamma: Array) -> Array:
        return (gamma - self.box.low) * ((np.array(self.sizes) - 1) / self.box.scales)

    def cells_at(self, gamma: Array) -> tuple[Index, ...]:
        """Indices of the cells that activations are in."""
        cells = np.floor(self._in_cells(gamma)).astype(np.intp)
        return tuple(np.clip(cells, 0, np.maximum(np.array(self.sizes) - 2, 0)).T)


class _Flooding:
    def __init__(self, solver: Solver, box: ActivationBox, sizes: tuple[int, ...]) -> None:
        self.solver, self.box, self.sizes = solver, box, sizes
        ends = zip(box.low, box.high, sizes, strict=True)
        axes = np.meshgrid(*(np.linspace(*end) for end in ends), indexing="ij")
        self.gamma = np.stack(axes, axis=-1).reshape(-1, box.bundles)
        n = len(self.gamma)
        self.states = solver.empty(n)
        self.is_known = np.zeros(n, bool)
        self.numbers = np.arange(n).reshape(sizes)
        self.linked = np.zeros((len(sizes), n), bool)  # to the next node along each axis

    def run(self, rest: Array, start: Shots) -> Flood:
        self.rest = rest
        nearest = int((((self.gamma - rest) / self.box.scales) ** 2).sum(axis=1).argmin())
        found = follow(self.solver, rest[None], self.gamma[[nearest]], start).shots
        self._keep(np.array([nearest]), found)
        front = np.flatnonzero(self.is_known)
        while len(front):
            front = self._wave(front)
        self._link()
        held = self._shots(np.arange(len(self.gamma)))
        return Flood(self.box, self.sizes, held, self._whole_cells())

    def _keep(self, nodes: Index, found: Shots) -> None:
        good = found.is_found
        at = nodes[good]
        self.states.tips[at], self.states.frame[at] = found.tips[good], found.frame[good]
        self.states.margin[at] = found.margin[good]
        self.is_known[at] = True

    def _shots(self, nodes: Index) -> Shots:
        tips, _, margin, frame = self.states.of(nodes)
        return Shots(tips, frame, margin, self.is_known[nodes])

    def _neighbors(self, nodes: Index, axis: int, way: int) -> tuple[Index, Mask]:
        """Nodes next to some along an axis, and mask of those that are in the grid."""
        place = list(np.unravel_index(nodes, self.sizes))
        place[axis] = place[axis] + way
        inside = (place[axis] >= 0) & (place[axis] < self.sizes[axis])
        place[axis] = np.clip(place[axis], 0, self.sizes[axis] - 1)
        return self.numbers[tuple(place)], inside

    def _wave(self, front: Index) -> Index:
        """Follow the branches from newly known nodes to all neighbors; the nodes then known."""
        edges = []
        for axis in range(len(self.sizes)):
            for way in (-1, 1):
                to, inside = self._neighbors(front, axis, way)
                edge = front, to, np.full_like(to, axis), np.full_like(to, way)
                edges.append(np.stack(edge)[:, inside])
        left, before = np.concatenate(edges, axis=1), self.is_known.copy()
        at, line = ((self.gamma[nodes] - self.rest) / self.box.scales for nodes in left[:2])
        share = (at * line).sum(axis=1) / np.maximum((line * line).sum(axis=1), 1e-300)
        off = at - np.clip(share, 0.0, 1.0)[:, None] * line  # near the lines from rest first
        left = left[:, np.argsort(np.sqrt((off * off).sum(axis=1)), kind="stable")]
        while True:
            left = left[:, ~self.is_known[left[1]]]
            _, first = np.unique(left[1], return_index=True)
            if not len(first):
                break
            self._grow(*left[:, first])
            left = np.delete(left, first, axis=1)
        return np.flatnonzero(self.is_known & ~before)

    def _grow(self, origin: Index, to: Index, axis: Index, way: Index) -> None:
        slopes = np.zeros_like(self.states.frame[origin])
        for k in range(len(self.sizes)):
            for sense in (-1, 1):
                rows = np.flatnonzero((axis == k) & (way == sense))
                back, inside = self._neighbors(origin[rows], k, -sense)
                known = inside & self.is_known[back]
                ahead = self.states.frame[origin[rows]] - self.states.frame[back]
                slopes[rows] = np.where(known[:, None], ahead, 0.0)
        ends = self.gamma[origin], self.gamma[to]
        found = follow(self.solver, *ends, self._shots(origin), slopes).shots
        self._keep(to, found)
        good = found.is_found
        lower = np.where(way > 0, origin, to)
        self.linked[axis[good], lower[good]] = True

    def _link(self) -> None:
        """Tell edges on one branch from cuts: smooth ones at once, the others by following them."""
        frames = self.states.frame.reshape(*self.sizes, -1)
        tips = self.states.tips.reshape(*self.sizes, 3) / self.solver.tables.arm.length
        known = self.is_known.reshape(self.sizes)
        for axis, size in enumerate(self.sizes):
            if size < 2:
                continue
            low = np.delete(self.numbers, -1, axis).ravel()
            both = (np.delete(known, -1, axis) & np.delete(known, 0, axis)).ravel()
            smooth = smooth_edges(frames, tips, axis).ravel()
            low, smooth = low[both], smooth[both]
            self.linked[axis, low[smooth]] = True
            doubtful = low[~self.linked[axis, low]]
            high, _ = self._neighbors(doubtful, axis, 1)
            ends = self.gamma[doubtful], self.gamma[high]
            found = follow(self.solver, *ends, self._shots(doubtful)).shots
            same = are_same(found, self._shots(high), self.solver.tables.arm.length)
            self.linked[axis, doubtful[same]] = True

    def _whole_cells(self) -> Mask:
        whole = self.is_known.reshape(self.sizes)
        for axis, size in enumerate(self.sizes):
            if size > 1:
                whole = np.delete(whole, -1, axis) & np.delete(whole, 0, axis)
        for axis, size in enumerate(self.sizes):
            if size < 2:
                continue
            edges = np.delete(self.linked[axis].reshape(self.sizes), -1, axis)
            for other, length in enumerate(self.sizes):
                if other != axis and length > 1:
                    edges = np.delete(edges, -1, other) & np.delete(edges, 0, other)
            whole &= edges
        return whole


def are_same(shots: Shots, others: Shots, length: float, within: float = _SAME) -> Mask:
    """Mask of those that are the same posture of an arm of a length [m], to so much [rad, L]."""
    with np.errstate(invalid="ignore"):  # of what is not found
        moved = np.linalg.norm(shots.tips - others.tips, axis=1)
        apart = turn_between(shots.frame, others.frame)
    near = (apart < within) & (moved < within * length)
    return np.asarray(near & shots.is_found & others.is_found)


def smooth_edges(frames: Array, tips: Array, axis: int) -> Mask:
    """Edges of a grid along an axis that go on as an edge beside them does.

    Args:
        frames: At the nodes, shape (*nodes, components); NaN where none is known.
        tips: The same of the tips [L].
        axis: The axis.
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
