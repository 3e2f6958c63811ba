"""Grids over the activation box: tips and det J at their vertices, and all postures over them.

Cells with one posture at each corner, all on one branch, are mapped as those of any map. The others
have as many images as there are branches over them, each up to where its branch ends. Postures to
which activations do not lead straight from rest lie on sheets, and all together are one map.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation

from softreach.arm.base import Base
from softreach.arm.manipulator import Manipulator
from softreach.geometry.surface import components
from softreach.kernels.image.activation_mesh import corner_steps
from softreach.kernels.image.raster import stretches
from softreach.rod.inputs import ActivationBox
from softreach.rod.rods import ArmMap
from softreach.rod.tip_map import Held, TipMap, TipOutputs, no_equilibrium
from softreach.support.arrays import Array, Index, Mask
from softreach.support.lazy import lazy
from softreach.support.parallel import blocks
from softreach.support.progress import Progress, silent

_BLOCK = 1 << 16  # vertices
_NEARLY_ALL = 0.9
_DIFFERENCES = 200.0  # over n², more than differences on n cells err by, of the largest det J


def grid_ticks(tip_map: TipMap, cells: int) -> list[Array]:
    """Ticks along each free bundle in the unit cube, a multiple of four cells between kinks."""
    box, ticks = tip_map.box, list[Array]()
    for k in box.free:
        places = np.unique((tip_map.kinks[k] - box.low[k]) / box.widths[k])
        knots = np.array([0.0, *places[(places > 1e-6) & (places < 1.0 - 1e-6)], 1.0])
        counts = 4 * np.maximum(np.rint(np.diff(knots) * cells / 4).astype(int), 1)
        counts[counts.argmax()] += cells - counts.sum()
        ticks.append(np.interp(np.arange(cells + 1), np.cumsum([0, *counts]), knots))
    return ticks


def grid_tips(
    tip_map: TipMap, cells: int, progress: Progress = silent, ticks: list[Array] | None = None
) -> Array:
    """Tips [m] of the grid of cells^m boxes over the free bundles, in C order, (nodes, 3).

    NaN where there is no stable equilibrium. Ticks along each axis are even if none are given.
    """
    even = [np.linspace(0.0, 1.0, cells + 1)] * tip_map.box.dimension
    places = product_of(ticks or even)
    tips = np.empty((len(places), 3))
    for rows in blocks(len(places), _BLOCK):
        tips[rows] = tip_map.tips(tip_map.box.from_free_cube(places[rows]))
        progress(0)
    if tip_map.supports_unstable and np.isnan(tips[:, 0]).all():
        raise no_equilibrium(len(tips))
    return tips


def cube_grid(cells: int, m: int = 3) -> Array:
    """Vertices of a grid of cells^m boxes over the unit cube, in C order, shape (n, m)."""
    return np.indices((cells + 1,) * m).reshape(m, -1).T / cells


def box_slopes(tip_map: TipMap, cube: Array) -> tuple[Array, Array]:
    """Tips [m] (n, 3) and derivatives (n, 3, dimension) by places in the cube of free bundles."""
    tips, slopes = tip_map.tips_and_slopes(tip_map.box.from_free_cube(cube))
    free = tip_map.box.free
    return tips, slopes[:, :, free] * tip_map.box.widths[free]


def product_of(ticks: list[Array]) -> Array:
    """All combinations of the values, the last varying fastest, shape (n, len(ticks))."""
    if not ticks:
        return np.zeros((1, 0))
    return np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1).reshape(-1, len(ticks))


@dataclass(frozen=True, eq=False)
class LiftedGrid:
    """The mapped vertices of a grid, and the cells over it."""

    tip_map: TipMap
    tips: Array  # [m]: of its nodes in C order, NaN where no posture is held, then others, (v, 3)
    is_lifted: Mask  # cells in whose place those of `lifted` are, (n,) * m
    lifted: Index  # vertices at the corners of cells, in the order of their bits, (k, 2^m)
    lost_share: float = 0.0  # share of activations at which no posture is held [-]
    hysteresis_share: float = 0.0  # share of activations at which two are held on one side [-]
    finer: LiftedGrid | None = None  # a grid without sheets of which this has every so many nodes

    @classmethod
    def of(
        cls, tip_map: TipMap, n: int, progress: Progress = silent, ticks: list[Array] | None = None
    ) -> LiftedGrid:
        """The grid of n cells along each free bundle; see `grid_tips`."""
        m, held = tip_map.box.dimension, None
        if tip_map.supports_unstable:
            held = tip_map.held(tip_map.box.from_free_cube(cube_grid(n, m)), (n + 1,) * m)
        if held is None:
            tips = grid_tips(tip_map, n, progress, ticks)
            return cls(tip_map, tips, np.zeros((n,) * m, bool), np.empty((0, 1 << m), np.int64))
        progress(0)
        if not len(held.node):
            raise no_equilibrium((n + 1) ** m)
        return _lifted(tip_map, held, n, m)

    @property
    def is_torn(self) -> bool:
        """True if it is not one sheet over the whole box."""
        return bool(self.is_lifted.any())

    @property
    def n(self) -> int:
        """Number of cells along each axis."""
        return len(self.is_lifted)

    @property
    def cells(self) -> Index:
        """Vertices at the corners of all cells, in the order of their bits, shape (k, 2^m)."""
        corners = cell_corners(self.n, self.is_lifted.ndim)
        return np.concatenate([corners[~self.is_lifted.ravel()], self.lifted])

    @lazy
    def jacobian_dets(self) -> Array:
        """det J of three free bundles at its nodes [m³ per unit of each activation], (nodes,).

        From differences of the tips, and by J itself where these might have the wrong sign or the
        map has kinks. 0 at nodes of no cells but lifted ones.
        """
        n, tip_map, shape = self.n, self.tip_map, (self.n + 1,) * 3
        if self.finer is not None:
            return every_node(self.finer.jacobian_dets, self.finer.n // n, self.finer.n)
        used = np.full((n + 1) ** 3, not self.is_torn)
        if self.is_torn:
            used[cell_corners(n, 3)[~self.is_lifted.ravel()]] = True
        dets = np.where(used, stretches(self.tips[: len(used)], np.array([n] * 3)), 0.0)
        dets *= n**3 / (8.0 * tip_map.box.volume)
        share = _NEARLY_ALL if tip_map.supports_unstable else 1.0  # |det J| grows toward snaps
        largest = float(np.quantile(np.abs(dets[used]), share)) if used.any() else 0.0
        unsure = np.abs(dets) <= _DIFFERENCES / n**2 * largest
        small = np.flatnonzero((unsure | (not tip_map.is_smooth)) & used)
        places = np.stack(np.unravel_index(small, shape), axis=1) / n
        slopes = tip_map.tips_and_slopes(tip_map.box.from_free_cube(places))[1]
        with np.errstate(invalid="ignore"):  # NaN where there is no stable equilibrium
            dets[small] = np.linalg.det(slopes[:, :, tip_map.box.free])
        dets[~np.isfinite(dets)] = 0.0
        return dets

    def coarser(self, times: int = 2) -> LiftedGrid:
        """The grid of fewer cells along each axis."""
        n, m = self.n // times, self.is_lifted.ndim
        if self.is_torn:
            return LiftedGrid.of(self.tip_map, n)
        tips, uncut = every_node(self.tips, times, self.n, m), np.zeros((n,) * m, bool)
        return LiftedGrid(self.tip_map, tips, uncut, self.lifted, finer=self)


def every_node(values: Array, times: int, n: int, m: int = 3) -> Array:
    """Those of the nodes of a grid of n cells that one of so many times larger cells has."""
    of_nodes = values.reshape(*(n + 1,) * m, *values.shape[1:])[(slice(None, None, times),) * m]
    return np.ascontiguousarray(of_nodes).reshape(-1, *values.shape[1:])


def _lifted(tip_map: TipMap, held: Held, n: int, m: int) -> LiftedGrid:
    count = np.bincount(held.node, minlength=(n + 1) ** m)
    order = np.argsort(held.node, kind="stable")
    rank = np.empty_like(order)  # of each posture among those of its node
    rank[order] = np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
    at_node = np.full((len(count), count.max()), -1)
    at_node[held.node, rank] = np.arange(len(rank))
    vertex = np.where(rank == 0, held.node, len(count) - 1 + np.cumsum(rank > 0))
    tips = np.full((len(count) + np.count_nonzero(rank), 3), np.nan)
    tips[vertex] = held.tips
    torn = ~_is_plain(held, count == 1, n, m)
    is_lifted = np.asarray(binary_dilation(torn, np.ones((3,) * m)), bool)
    corners = cell_corners(n, m)[is_lifted.ravel()]
    cell, states = _sheets(held, at_node[corners])
    beyond, end_tips = _edges(held, states, corners[cell])
    return LiftedGrid(
        tip_map,
        np.concatenate([tips, end_tips]),
        is_lifted,
        np.where(states < 0, len(tips) + beyond, vertex[states]),
        share_of_box(count == 0, n, m),
        share_of_box(held.is_doubled, n, m),
    )


def cell_corners(n: int, m: int) -> Index:
    """Nodes at the corners of all cells of a grid, in the order of their bits, (n^m, 2^m)."""
    first = np.arange((n + 1) ** m).reshape((n + 1,) * m)[(slice(-1),) * m]
    return first.reshape(-1, 1) + corner_steps((n,) * m)


def _edges_of_cell(m: int) -> list[tuple[int, int]]:
    return [(k, k | 1 << j) for k, j in product(range(1 << m), range(m)) if not k >> j & 1]


def _is_plain(held: Held, is_single: Mask, n: int, m: int) -> Mask:
    """Cells with one posture at each corner, linked along all edges."""
    corners, steps = cell_corners(n, m), corner_steps((n,) * m)
    plain: Mask = np.asarray(is_single[corners].all(axis=1))
    low, high = np.sort(held.node[held.links], axis=1).T
    linked = {step: np.zeros(len(is_single), bool) for step in steps[1 << np.arange(m)]}
    for step, mask in linked.items():
        mask[low[high - low == step]] = True
    for a, b in _edges_of_cell(m):
        plain &= linked[steps[b] - steps[a]][corners[:, a]]
    return plain.reshape((n,) * m)


def _sheets(held: Held, states: Index) -> tuple[Index, Index]:
    """Cells (k,) of each branch over some, and one posture or -1 for each corner (k, 2^m).

    States are numbers of postures at the corners of cells, -1 for none, (cells, 2^m, postures).
    """
    corners, joined = states.shape[1], _joined(held, states)
    cell, corner, _ = np.nonzero(states >= 0)
    state, label = states[states >= 0], components(joined, len(cell))
    sheet = np.full((label.max(initial=-1) + 1, corners), -1)
    sheet[label, corner] = state
    of_cell = np.empty(len(sheet), np.int64)
    of_cell[label] = cell
    # Around a pitchfork or a cusp corners have two postures on one branch: it is parted again.
    forked = np.bincount(label * corners + corner)[label * corners + corner] > 1
    part = components(joined[forked[joined].all(axis=1)], len(cell))[forked]
    _, first, part = np.unique(part, return_index=True, return_inverse=True)
    parted = label[forked][first]
    parts = sheet[parted]
    parts[part, corner[forked]] = state[forked]
    simple = np.setdiff1d(np.arange(len(sheet)), parted)
    every = np.concatenate([simple, parted])
    return of_cell[every], np.concatenate([sheet[simple], parts])


def _joined(held: Held, states: Index) -> Index:
    """Pairs of postures of cells that are linked, numbered in order, shape (k, 2)."""
    total, pairs = len(held.node), [np.empty((0, 2), np.int64)]
    links = np.sort(np.append(np.sort(held.links, axis=1) @ [total, 1], -1))
    number = np.cumsum(states >= 0).reshape(states.shape) - 1
    places = range(states.shape[2])
    for (a, b), i, j in product(_edges_of_cell(states.shape[1].bit_length() - 1), places, places):
        ends = np.stack([states[:, a, i], states[:, b, j]], axis=1)
        key = np.sort(ends, axis=1) @ [total, 1]
        near = links[np.searchsorted(links, key).clip(max=len(links) - 1)] == key
        rows = np.flatnonzero(near & (ends >= 0).all(axis=1))
        pairs.append(np.stack([number[rows, a, i], number[rows, b, j]], axis=1))
    return np.concatenate(pairs)


def _edges(held: Held, states: Index, corners: Index) -> tuple[Index, Array]:
    """Numbers (k, 2^m) of the places where branches end on the way to corners, and the places.

    All cells of a branch share its place beside one node, so that its sheet has no cracks.
    """
    total = len(held.node)
    row, corner = np.nonzero(states < 0)
    slot, other = np.nonzero(states[row] >= 0)
    key = corners[row, corner][slot] * total + states[row[slot], other]
    keys, of_key = np.unique(key, return_inverse=True)
    pairs = np.stack([slot, len(row) + of_key], axis=1)
    label = components(pairs, len(row) + len(keys))
    groups, group = np.unique(label[: len(row)], return_inverse=True)
    place = np.searchsorted(keys, ends := held.ends @ [1, total]).clip(max=max(len(keys) - 1, 0))
    known = np.flatnonzero(keys[place] == ends) if len(keys) else place[:0]
    group_of_end = np.searchsorted(groups, label[len(row) + place[known]])
    tips = _means(held.end_tips[known], group_of_end, len(groups))
    for _ in range(corners.shape[1]):  # corners that no edge of a cell leads to
        around = _means(tips[group], row, len(states))
        tips = np.where(np.isnan(tips), _means(around[row], group, len(groups)), tips)
    at_others = _means(held.tips[states[row[slot], other]], group[slot], len(groups))
    numbers = np.zeros_like(states)
    numbers[row, corner] = group
    return numbers, np.where(np.isnan(tips), at_others, tips)


def _means(places: Array, number: Index, size: int) -> Array:
    """Means of the places of each number that are known, shape (size, 3); NaN where none is."""
    known = np.isfinite(places[:, 0])
    count = np.bincount(number[known], minlength=size)
    sums = [np.bincount(number[known], column, size) for column in places[known].T]
    with np.errstate(invalid="ignore"):
        return np.stack(sums, axis=1) / count[:, None]


def share_of_box(nodes: Mask, n: int, m: int) -> float:
    """Share of the box in which something holds that holds at some nodes."""
    share = nodes.reshape((n + 1,) * m).astype(float)
    for axis in range(m):
        share = 0.5 * (np.delete(share, -1, axis) + np.delete(share, 0, axis))
    return float(share.mean())


_SAME = 1e-4  # [L] between tips of one posture
_NODES, _MOST_ALONG = 1 << 13, 64  # of a grid by default, and cells along it


class Sheet(NamedTuple):
    """Postures to which activations do not lead straight from rest."""

    tip_map: TipMap  # the tip map that goes on from the nearest of them
    gamma: Array  # activations at which they are known, (n, bundles)


@dataclass(frozen=True, eq=False, repr=False)
class AllPostures(TipMap):
    """The map of a loaded arm in all of its postures: its last input is the number of a sheet.

    Along that nothing changes, so that a search that begins on a sheet stays there.
    """

    from_rest: TipMap
    sheets: list[Sheet]  # the others, numbered from 1
    lost_share: float  # share of activations at which no posture is held [-]
    hysteresis_share: float  # share of activations at which two are held on one side [-]
    arm: Manipulator = field(init=False)
    tol: float = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "arm", self.from_rest.arm)
        object.__setattr__(self, "tol", self.from_rest.tol)

    def seen_from(self, pose: Base) -> AllPostures:
        """The same in a frame in which the frame of places has a pose."""
        sheets = [sheet._replace(tip_map=ArmMap.of(sheet.tip_map, pose)) for sheet in self.sheets]
        return replace(self, from_rest=ArmMap.of(self.from_rest, pose), sheets=sheets)

    def with_sheets(self, gamma: Array, tips: Array) -> tuple[Array, Array]:
        """Activations of postures from rest and their tips, and all that are known of others."""
        others, places = self._known
        every = np.concatenate([np.column_stack([gamma, np.zeros(len(gamma))]), others])
        return every, np.concatenate([tips, places])

    @lazy
    def _known(self) -> tuple[Array, Array]:
        every = [each.gamma for each in self.sheets]
        number = np.repeat(np.arange(len(every)) + 1.0, [len(gamma) for gamma in every])
        gamma = np.column_stack([np.concatenate(every), number]).astype(np.float64)
        held = np.isfinite(tips := self.tips(gamma)).all(axis=1)
        return gamma[held], tips[held]

    @lazy
    def box(self) -> ActivationBox:
        """Bounds of the bundles, and of the number of the sheet."""
        box = self.from_rest.box
        bounds = np.stack([box.low, box.high], axis=1)
        ends = np.concatenate([bounds, [[0.0, len(self.sheets)]]])
        return ActivationBox.between(ends, [*box.names, "sheet"])

    @lazy
    def supports_unstable(self) -> bool:
        return True

    def prepare(self) -> None:
        for tip_map in (self.from_rest, *(sheet.tip_map for sheet in self.sheets)):
            tip_map.prepare()

    def fill(self, gamma: Array, out: TipOutputs) -> None:
        """Put tips, slopes and status into place; the others are not known."""
        assert out.twists is None
        assert out.directions is None
        number = np.rint(gamma[:, -1])
        for k, tip_map in enumerate([self.from_rest, *(sheet.tip_map for sheet in self.sheets)]):
            if not len(rows := np.flatnonzero(number == k)):
                continue
            inner = np.ascontiguousarray(gamma[rows, :-1])
            at, kept = np.empty((len(rows), 3)), np.empty(len(rows), np.int8)
            along = None if out.slopes is None else np.empty((len(rows), 3, inner.shape[1]))
            tip_map.fill(inner, TipOutputs(at, along, status=kept))
            out.tips[rows] = at
            if out.slopes is not None and along is not None:
                out.slopes[rows] = np.pad(along, ((0, 0), (0, 0), (0, 1)))
            if out.status is not None:
                out.status[rows] = kept


def all_postures(tip_map: TipMap, cells: int | None = None) -> AllPostures | None:
    """All postures that an arm holds, on sheets that are known at the nodes of a grid.

    A sheet that is narrower than the cells may be missing. Each goes on beyond its last nodes, as
    far as the cells beside. The grid has so many cells along each free bundle, by default as many
    as 8,192 nodes allow. None where all are those to which activations lead straight from rest.
    """
    m, box = tip_map.box.dimension, tip_map.box
    if not tip_map.supports_unstable:
        return None
    cells = cells or min(int(_NODES ** (1 / m) + 1e-9) - 1, _MOST_ALONG)
    nodes = box.from_free_cube(cube_grid(cells, m))
    held = tip_map.held(nodes, (cells + 1,) * m)
    if held is None or held.frames is None or not len(held.node):
        return None
    apart = np.linalg.norm(held.tips - tip_map.tips(nodes)[held.node], axis=1)
    is_other = ~(apart <= _SAME * tip_map.length)  # no posture from rest is another, too
    is_other[held.ends[:, 0]] = True
    sheet = components(held.links[is_other[held.links].all(axis=1)], len(held.node))
    # Where a sheet holds several postures of a node, each has a part of its own.
    key = sheet * len(nodes) + held.node
    order = np.argsort(key, kind="stable")
    part = sheet * len(key)
    part[order] += np.arange(len(key)) - np.searchsorted(key[order], key[order])
    sheets = list[Sheet]()
    for each in np.unique(part[is_other]):
        states = np.flatnonzero((part == each) & is_other)
        gamma = nodes[held.node[states]]
        sheets.append(Sheet(tip_map.continued_from(gamma, held.frames[states]), gamma))
    is_lost = np.bincount(held.node, minlength=len(nodes)) == 0
    lost, doubled = (share_of_box(each, cells, m) for each in (is_lost, held.is_doubled))
    return AllPostures(tip_map, sheets, lost, doubled) if sheets else None
