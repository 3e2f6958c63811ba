"""Reach of the tip with four free bundles or more, by search instead of by simplices.

A lattice tells how far its centers are from the nearest tip. A level set of these distances goes
around both sides of a sheet and its rim, and each of its vertices is drawn to the nearest tip.
Where this leaves a larger error, lines of sight through the centers that are reached add up to the
volume. What counts as reached has an activation that proves it; what searches miss is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.surface import Surface, corner_areas, level_set
from softreach.kernels.box.box_projection import project
from softreach.rod.rods import refined
from softreach.rod.tip_map import TipMap
from softreach.sampling import cube_blocks
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy
from softreach.support.memory import free_memory
from softreach.support.progress import Progress
from softreach.workspace.crossings import Crossings, line_volume, swept_crossings
from softreach.workspace.grid import AllPostures
from softreach.workspace.image import Image, Lattice, covered_cubes
from softreach.workspace.measure import ConvexHull, Estimate, climbed_hull
from softreach.workspace.search import (
    CLOUD,
    DISTANCE,
    ENOUGH,
    Nearest,
    ReachedGrid,
    all_reached,
    cloud_on_faces,
    nearest_tips,
)

if TYPE_CHECKING:
    from scipy.spatial import KDTree

_STARTS = 6  # tips nearby from which places are searched
_MORE_STARTS, _NEAR = 24, 0.1  # of places that are nearer than this, in cells, to a tip
_ON = 1e-2  # cells from a tip, where a place counts as reached
_THICK = 3.0  # cells, on average
_CORNERS = np.stack(np.meshgrid(*[[0, 1]] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
_CHUNK = 1 << 16
_SAMPLES = 1 << 14  # of the box, for the share that is lost
_RULE = 2.5  # cells along the mean side of the bounding box, times the root of the accuracy
_FEWEST = 16.0
_FINER = 1.5
_SHIFT = np.array([0.31, 0.17, 0.43])  # of a cell: lines on a plane of symmetry would all err alike
_MOST_ALONG = 96.0
_THINNEST = 128.0  # cells along the mean side: below are no sheets
_MOST_CELLS = 2.0**26
_ASIDE = 1e-4  # cells by which both sides of a sheet are kept apart
_SHEET = 2e-3  # of its width, the root of its area, that a sheet is thinner than
_SHEET_TOL = 1e-9  # in L, as a sheet may be no thicker than tips are exact otherwise
_WIDEST = 0.99  # of all thicknesses are below the one that the next pushes go beyond
_STRETCH = 30.0  # times as much as one to the side, a miss along the normal counts
_PUSHES, _PASSES = 12, 4
_DAMPING = 1e-8  # of the mean square of the slopes
CLIMBERS = 1024  # tips from which the convex hull is climbed beside the boundary: more make facets


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Wrap(Surface):
    """The surface, closed and outwards, a ten-thousandth of a cell outside of its tips."""

    tip_map: TipMap
    gamma: Array  # activations that lead to the vertices, (v, bundles)
    cell: float  # edge of the cells that it was found with [m]
    tight_volume: float  # volume inside of the tips themselves [m³]

    @lazy
    def volume_of_tips(self) -> Estimate:
        """Volume inside of the tips; of a thin sheet, its thickness over its area [m³].

        There from each vertex the tip is pushed along its normal, to which all columns of ∂r/∂γ are
        nearly square, to both sides: no search for the nearest tip sees so small a change.
        """
        half = 0.5 * self.area
        thickness = self.tight_volume / half if half > 0.0 else np.inf
        if self.tip_map.supports_unstable or thickness > _SHEET * np.sqrt(half):
            off = ENOUGH * self.cell + self.tip_map.tol * self.tip_map.length
            return Estimate(self.tight_volume, self.area * off)
        tip_map = refined(self.tip_map, _SHEET_TOL)
        areas = np.linalg.norm(self.corner_areas, axis=1)
        tips, slopes = tip_map.tips_and_slopes(self.gamma)
        normals = np.linalg.svd(slopes * tip_map.box.scales)[0][:, :, 2]
        thick = np.zeros(len(tips))
        for _ in range(_PASSES):
            ways = (2.0 * thickness * normals, -2.0 * thickness * normals)
            thick = sum(_pushed(tip_map, self.gamma, tips, way) for way in ways)
            thickness = float(np.quantile(thick, _WIDEST))
        return Estimate(0.5 * float(areas @ thick), self.area * _SHEET_TOL * tip_map.length)

    @lazy
    def cube(self) -> Array:
        """Places of the vertices in the unit cube of the free bundles, shape (v, dimension)."""
        box = self.tip_map.box
        return box.to_cube(self.gamma)[:, box.free].clip(0.0, 1.0)

    @lazy
    def corner_areas(self) -> Array:
        """Outward area that each vertex stands for [m²], shape (v, 3)."""
        return corner_areas(self.vertices, self.faces)


def _pushed(tip_map: TipMap, gamma: Array, tips: Array, way: Array) -> Array:
    """How far tips go along a way that is too far, with little to the side [m], shape (n,)."""
    size, box = np.linalg.norm(way, axis=1), tip_map.box
    unit, target = way / size[:, None], tips + way
    scale = np.eye(3) + (_STRETCH - 1.0) * unit[:, :, None] * unit[:, None, :]
    center, multiplier, step = np.zeros_like(gamma), np.empty_like(tips), np.empty_like(gamma)
    for _ in range(_PUSHES):
        # Least |miss - J d|² + μ |d|² inside the bounds, with d measured in ranges (Levenberg).
        at, slopes = tip_map.tips_and_slopes(gamma)
        miss, stretched = scale @ (target - at)[:, :, None], scale @ slopes * box.scales
        damping = _DAMPING * ((stretched**2).sum(axis=(1, 2)) / 3.0)
        low, high = (box.low - gamma) / box.scales, (box.high - gamma) / box.scales
        multiplier[:] = 0.0
        project(center, stretched, miss[:, :, 0], damping, low, high, step, multiplier)
        gamma = box.clip(gamma + step * box.scales)
    return ((tip_map.tips(gamma) - tips) * unit).sum(axis=1)


def drawn_tight(grid: ReachedGrid, at: Array) -> Nearest:
    """Nearest tips of places (n, 3) on edges of the lattice, in cells, from those at both ends."""
    places = grid.lattice.places(at)
    first, second = (
        nearest_tips(grid.tip_map, grid.gamma[cells], places, ENOUGH * grid.lattice.cell)
        for cells in (end(at).astype(np.int64) @ grid.steps for end in (np.floor, np.ceil))
    )
    closer = second.distance < first.distance
    for kept, new in zip(first, second, strict=True):
        kept[closer] = new[closer]
    return first


def wrapped(grid: ReachedGrid) -> Wrap:
    """The surface around what was found."""
    at, faces = level_set(grid.distances, DISTANCE)
    gamma, tips, _ = drawn_tight(grid, at)
    cell, away = grid.lattice.cell, grid.lattice.places(at) - tips
    away /= np.linalg.norm(away, axis=1).clip(1e-9 * cell)[:, None]
    return Wrap(
        vertices=tips + _ASIDE * cell * away,
        faces=faces,
        tip_map=grid.tip_map,
        cell=cell,
        gamma=gamma,
        tight_volume=Surface(vertices=tips, faces=faces).volume,
    )


@dataclass(frozen=True, eq=False)
class ReachedCells:
    """Counterpart of `Image` for more than three free bundles: asked by search."""

    grid: ReachedGrid
    cloud: tuple[Array, Array]  # activations on faces of the box, and their tips [m]
    wrap: Wrap
    coarse: Wrap  # the same on cells one and a half times as large
    hull: ConvexHull | None = None

    @property
    def lattice(self) -> Lattice:
        """The cells."""
        return self.grid.lattice

    @property
    def is_thick(self) -> bool:
        """True if lines of sight see enough of the set between its sides."""
        return 2.0 * self.wrap.tight_volume > _THICK * self.lattice.cell * self.wrap.area

    @lazy
    def swept(self) -> tuple[Crossings, float]:
        """Places where edges between centers are cut, and what they may miss [m³]."""
        return swept_crossings(self.grid)

    @lazy
    def volume(self) -> Estimate:
        """By the wrap; by lines of sight if these tell the volume better, and agree [m³]."""
        tight, edge, tip_map = self.wrap.volume_of_tips, self.lattice.cell, self.grid.tip_map
        change = abs(tight.value - self.coarse.volume_of_tips.value)
        volume = Estimate(tight.value, change + tight.error)
        if self.is_thick:
            lines, missed = self.swept
            area = len(lines.cell) * edge**2 / 1.5  # a plane cuts 1.5 edges to a square of a cell
            seen = line_volume(lines)
            off = ENOUGH * edge + tip_map.tol * tip_map.length
            error = seen.error + missed + area * off
            if error < volume.error and abs(seen.value - volume.value) <= error + volume.error:
                volume = Estimate(seen.value, error)
        return volume

    @property
    def counts(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """1 at centers that are reached and 0 elsewhere; no orientation, 0."""
        return self.grid.reached.astype(np.int32), np.zeros(self.lattice.shape, np.int32)

    def are_deep(self, points: Array) -> Mask:
        """Mask of points [m] with all centers of the cells around reached, beyond neighbors."""
        from scipy.ndimage import binary_erosion

        cubes = covered_cubes(np.asarray(binary_erosion(self.grid.reached), bool))
        index = np.floor(self.lattice.coordinates(points)).astype(np.int64)
        within = ((index >= 0) & (index < cubes.shape)).all(axis=1)
        return within & cubes[tuple(np.where(within, i, 0) for i in index.T)]

    def counts_at(self, points: Array) -> Index:
        """1 for points that are reached [m], 0 for others, shape (n,)."""
        return (self.distance(points) <= _ON * self.lattice.cell).astype(np.int64)

    def distance(self, points: Array) -> Array:
        """Distance from points to the nearest tip that searches find [m], shape (n,)."""
        out = np.full(len(points), np.inf)
        for block in parallel.blocks(len(points), _CHUNK):
            self._search(points[block], out[block])
        return out

    def _search(self, points: Array, out: Array) -> None:
        """Lower distances by what searches find, until they are 0 or there is no other start."""
        enough = _ON * self.lattice.cell

        def search(left: Index, start: Array) -> None:
            nearest = nearest_tips(self.grid.tip_map, start, points[left], enough)
            out[left] = np.minimum(out[left], nearest.distance)

        for known, start in self._starts_inside(points):
            left = np.flatnonzero((out > enough) & known)
            search(left, start[left])
        gamma = np.concatenate([self.wrap.gamma, self.cloud[0]])
        for count, within in ((_STARTS, np.inf), (_MORE_STARTS, _NEAR * self.lattice.cell)):
            left = np.flatnonzero((out > enough) & (out <= within))
            near = np.minimum(self._tree.query(points[left], k=count)[1], len(gamma) - 1)
            for k in range(count):
                rest = np.flatnonzero(out[left] > enough)
                search(left[rest], gamma[near[rest, k]])

    def _starts_inside(self, points: Array) -> Iterator[tuple[Mask, Array]]:
        """Masks of points with a reached center at a corner of their cube, and where to start."""
        at = self.lattice.coordinates(points)
        for corner in (np.rint(at), *(np.floor(at) + corner for corner in _CORNERS)):
            index = corner.astype(np.int64)
            within = ((index >= 0) & (index < self.lattice.shape)).all(axis=1)
            cells = self.grid.steps @ (index.T * within)
            yield within & (self.grid.gap[cells] == 0.0), self.grid.gamma[cells]

    @lazy
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(np.concatenate([self.wrap.vertices, self.cloud[1]]))


Covering = Image | ReachedCells  # what a solid covers of space


def smallest_memory(tip_map: TipMap) -> float:
    """Memory that a search cannot do without [bytes]."""
    fixed, each = _bytes(tip_map)
    return fixed + 2e4 * each


def searched_set(
    tip_map: TipMap, accuracy: float, cell: float | None, memory: float | None, progress: Progress
) -> ReachedCells:
    """The image of a box of more bundles, on cells as small as accuracy asks or memory allows."""
    least = smallest_memory(tip_map)
    memory = max(free_memory() / 4.0, least) if memory is None else memory
    if memory < least:
        raise InvalidInput("memory", memory, f"at least {least:.3g} bytes")
    cloud = gamma, tips = cloud_on_faces(tip_map, 0)
    sides = np.ptp(tips, axis=0)
    smallest = _smallest_cell(tip_map, sides, memory)
    if cell is not None and cell < smallest:
        raise InvalidInput("cell", cell, f"at least {smallest:.3g} m for {memory:.2g} bytes")
    mean = float(np.cbrt(np.prod(sides)))
    target = min(np.sqrt(accuracy) / _RULE, 1.0 / _FEWEST) * mean
    edge = float(max(target, smallest, sides.max() / 1024.0)) if cell is None else cell

    def of_cells(edge: float) -> ReachedGrid:
        return all_reached(ReachedGrid(tip_map, shifted_lattice(tips, edge), progress), *cloud)

    coarse = wrapped(of_cells(_FINER * edge))
    begin = tip_map.box.to_cube(np.concatenate([gamma[:CLIMBERS], coarse.gamma]))
    hull = climbed_hull(tip_map, begin[:, tip_map.box.free].clip(0.0, 1.0), accuracy)
    while True:
        grid = of_cells(edge)
        cells = ReachedCells(grid, cloud, wrapped(grid), coarse, hull)
        if cell is not None or not _may_meet(cells, accuracy, smallest, mean / _THINNEST):
            return cells
        edge, coarse = edge / _FINER, cells.wrap


def _may_meet(cells: ReachedCells, accuracy: float, smallest: float, of_sheets: float) -> bool:
    """True if an accuracy is not met but may be, by cells that are no smaller than allowed."""
    edge = cells.lattice.cell
    value, error = cells.volume
    if error <= accuracy * value or edge / _FINER < smallest:
        return False
    if cells.is_thick:
        return True
    # The error of a sheet falls as the square of the edge, until its thickness can be found.
    is_sheet = cells.wrap.volume_of_tips.value != cells.wrap.tight_volume
    needed = edge / _FINER if is_sheet else edge * np.sqrt(accuracy * max(value, 0.0) / error)
    return needed >= of_sheets


def cells_of(
    tip_map: TipMap, cell: float, inside: Callable[[Array], Mask] | None = None
) -> ReachedCells:
    """What any number of free bundles reach, on 96 cells along the longest side, without hull.

    With places `inside` that are known to be reached, nothing but the surface is right.
    """
    cloud = cloud_on_faces(tip_map, 0)
    edge = max(cell, float(np.ptp(cloud[1], axis=0).max()) / _MOST_ALONG)
    grid = ReachedGrid(tip_map, shifted_lattice(cloud[1], edge))
    if inside is not None:
        grid.add_inside(inside)
    grid = all_reached(grid, *cloud)
    wrap = wrapped(grid)
    return ReachedCells(grid, cloud, wrap, wrap)


def shifted_lattice(tips: Array, cell: float) -> Lattice:
    """A lattice around tips [m], shape (n, 3), that shares no plane of symmetry with them."""
    lattice = Lattice.around(tips, cell)
    return lattice._replace(origin=lattice.origin + cell * _SHIFT)


def lost_share(tip_map: TipMap) -> float:
    """Share of the activation box without a stable equilibrium [-], from a sample."""
    if isinstance(tip_map, AllPostures):
        return tip_map.lost_share
    if not tip_map.supports_unstable:
        return 0.0
    (cube,) = cube_blocks("sobol", _SAMPLES, tip_map.box.dimension, 0, _SAMPLES)
    tips = tip_map.tips(tip_map.box.from_free_cube(cube))
    return float(np.isnan(tips[:, 0]).mean())


def _bytes(tip_map: TipMap) -> tuple[float, float]:
    """Of clouds, and of a center: its gap and activation, masks, and its part of the edges."""
    return 16.0 * 8.0 * CLOUD * (tip_map.box.bundles + 3), 16.0 * tip_map.box.bundles + 120.0


def _smallest_cell(tip_map: TipMap, sides: Array, memory: float) -> float:
    """Edge of as many cells as memory holds, with eight more along each side [m]."""
    fixed, each = _bytes(tip_map)
    count = np.poly1d([1.0])
    for side in sides:
        count *= np.poly1d([side, 8.0])  # over 1 / edge
    roots = (count - min((memory - fixed) / each, _MOST_CELLS)).roots
    return float(1.0 / np.real(roots[np.isreal(roots)]).max())
