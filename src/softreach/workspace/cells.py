"""Reach of the tip with four free bundles or more, by search instead of by simplices.

The box of m activations has m! simplices to a cell of its grid, its image has one boundary. So the
image is found in space: a lattice tells how far its centers are from the nearest tip, and a surface
of tips is wrapped around. Where this leaves a larger error, lines of sight through the centers that
are reached add up to the volume. Each place that counts as reached has an activation that proves
it; what searches miss is missing from the volume.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap
from softreach.sampling import cube_blocks
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask
from softreach.support.errors import InvalidInput
from softreach.support.lazy import lazy
from softreach.support.memory import free_memory
from softreach.support.progress import Progress
from softreach.workspace.crossings import Crossings, line_volume, swept_crossings
from softreach.workspace.image import Image, Lattice, covered_cubes
from softreach.workspace.measure import ConvexHull, Estimate, climbed_hull
from softreach.workspace.postures import AllPostures
from softreach.workspace.search import (
    CLOUD,
    ENOUGH,
    ReachedGrid,
    all_reached,
    cloud_on_faces,
    nearest_tips,
)
from softreach.workspace.wrap import Wrap, wrapped

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
CLIMBERS = 1024
"""Of these, for the convex hull beside tips on the boundary: more make countless facets."""


@dataclass(frozen=True, eq=False)
class ReachedCells:
    """Counterpart of `Image` for more than three free bundles: asked by search."""

    grid: ReachedGrid
    cloud: tuple[Array, Array]
    """Activations on faces of the box, and their tips [m]."""
    wrap: Wrap
    coarse: Wrap
    """The same on cells one and a half times as large."""
    hull: ConvexHull | None = None

    @property
    def tip_map(self) -> TipMap:
        """The tip map."""
        return self.grid.tip_map

    @property
    def lattice(self) -> Lattice:
        """The cells."""
        return self.grid.lattice

    @property
    def reached(self) -> Mask:
        """True for cells whose centers are reached."""
        return self.grid.reached

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
        tight, edge = self.wrap.volume_of_tips, self.lattice.cell
        change = abs(tight.value - self.coarse.volume_of_tips.value)
        volume = Estimate(tight.value, change + tight.error)
        if self.is_thick:
            lines, missed = self.swept
            area = len(lines.cell) * edge**2 / 1.5  # a plane cuts 1.5 edges to a square of a cell
            seen = line_volume(lines)
            error = (
                seen.error
                + missed
                + area * (ENOUGH * edge + self.tip_map.tol * self.tip_map.length)
            )
            if error < volume.error and abs(seen.value - volume.value) <= error + volume.error:
                volume = Estimate(seen.value, error)
        return volume

    @property
    def counts(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """1 at centers that are reached and 0 elsewhere; no orientation, 0."""
        return self.reached.astype(np.int32), np.zeros(self.reached.shape, np.int32)

    def are_deep(self, points: Array) -> Mask:
        """Mask of points [m] with all centers of the cells around reached, beyond neighbors."""
        from scipy.ndimage import binary_erosion

        cubes = covered_cubes(np.asarray(binary_erosion(self.reached), bool))
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
            nearest = nearest_tips(self.tip_map, start, points[left], enough)
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
            cells = np.ravel_multi_index(
                tuple(np.where(within, i, 0) for i in index.T), self.lattice.shape
            )
            yield within & (self.grid.gap[cells] == 0.0), self.grid.gamma[cells]

    @lazy
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(np.concatenate([self.wrap.vertices, self.cloud[1]]))


Covering = Image | ReachedCells
"""What a solid covers of space."""


def smallest_memory(tip_map: TipMap) -> float:
    """Memory that a search cannot do without [bytes]."""
    fixed, each = _bytes(tip_map)
    return fixed + 2e4 * each


def searched_set(
    tip_map: TipMap, accuracy: float, cell: float | None, memory: float | None, progress: Progress
) -> ReachedCells:
    """The image of a box of four free bundles or more.

    Args:
        tip_map: The tip map.
        accuracy: Relative error asked of the volume: cells become smaller until it is met, or
            `memory` is used.
        cell: Edge of a cell [m], instead of the rule's.
        memory: Memory that the search may use [bytes]; a quarter of what is free if None.
        progress: Called with the number of centers searched since its last call.

    Raises:
        InvalidInput: No activation has a stable equilibrium, too little memory, or cells too small
            for it.
    """
    least = smallest_memory(tip_map)
    memory = max(free_memory() / 4.0, least) if memory is None else memory
    if not least <= memory < np.inf:
        raise InvalidInput("memory", memory, f"at least {least:.3g} bytes")
    cloud = gamma, tips = cloud_on_faces(tip_map, 0)
    sides = np.ptp(tips, axis=0)
    smallest = _smallest_cell(tip_map, sides, memory)
    if cell is not None and not smallest <= cell < np.inf:  # NaN too
        raise InvalidInput("cell", cell, f"at least {smallest:.3g} m for {memory:.2g} bytes")
    mean = float(np.cbrt(np.prod(sides)))
    target = min(np.sqrt(accuracy) / _RULE, 1.0 / _FEWEST) * mean
    edge = float(max(target, smallest, sides.max() / 1024.0)) if cell is None else cell

    def of_cells(edge: float) -> ReachedGrid:
        return all_reached(ReachedGrid(tip_map, shifted_lattice(tips, edge), progress), *cloud)

    coarse = wrapped(of_cells(_FINER * edge))
    begin = tip_map.box.to_cube(np.concatenate([gamma[:CLIMBERS], coarse.gamma]))[
        :, tip_map.box.free
    ]
    hull = climbed_hull(tip_map, begin.clip(0.0, 1.0), accuracy)
    while True:
        grid = of_cells(edge)
        found = ReachedCells(grid, cloud, wrapped(grid), coarse, hull)
        if cell is not None or not _may_meet(found, accuracy, smallest, mean / _THINNEST):
            return found
        edge, coarse = edge / _FINER, found.wrap


def _may_meet(cells: ReachedCells, accuracy: float, smallest: float, of_sheets: float) -> bool:
    """True if an accuracy is not met but may be, by cells that are no smaller than allowed.

    Where nothing is seen between both sides of a sheet, its error falls as the square of the edge,
    until the sheet is thin enough for its thickness to be found.
    """
    edge = cells.lattice.cell
    value, error = cells.volume
    if error <= accuracy * value or edge / _FINER < smallest:
        return False
    if cells.is_thick:
        return True
    is_sheet = cells.wrap.volume_of_tips.value != cells.wrap.tight_volume
    needed = edge / _FINER if is_sheet else edge * np.sqrt(accuracy * max(value, 0.0) / error)
    return needed >= of_sheets


def cells_of(
    tip_map: TipMap, cell: float, inside: Callable[[Array], Mask] | None = None
) -> ReachedCells:
    """What is reached of the image of a box of any number of free bundles, without its hull.

    Args:
        tip_map: The tip map.
        cell: Edge of a cell [m]; larger where that takes more than 96 cells along the longest side.
        inside: Of places [m], shape (n, 3), tells some that are reached, (n,): there is no search,
            and nothing but the surface is right.
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
    fixed, each = _bytes(tip_map)
    most = min((memory - fixed) / each, _MOST_CELLS)
    low, high = 0.0, 1.0 + float(sides.max())
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if np.prod(sides / middle + 8.0) <= most else (middle, high)
    return high
