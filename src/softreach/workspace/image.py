"""A triangulated box mapped into space, and how its image covers a lattice of cells."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, binary_erosion, gaussian_filter

from softreach.geometry.surface import Surface, compact_surface, enclosed_volume, level_set
from softreach.kernels.image import raster
from softreach.kernels.image.activation_mesh import corner_bits, kuhn_simplices
from softreach.picture.zbuffer import vertex_normals
from softreach.support import parallel
from softreach.support.arrays import Array, Index, Mask, joined, rows
from softreach.support.lazy import lazy
from softreach.support.memory import check_memory
from softreach.support.progress import Progress, silent
from softreach.workspace.grid import LiftedGrid

DIAGONAL = math.sqrt(3.0)  # of a cell, in edges
_DET_BITS = 50  # of the largest det J: sums of four are exact in any order
_BYTES = 16  # of a cell: two counts, and what questions make of them
_BAND = 2.5  # cells from the boundary beyond which the field is constant
_CLOSEST = 1e-3  # cells: a center on the boundary itself would make triangles without area
_MARGIN = 3  # empty cells around the image
_ROWS = 1 << 20  # triangles a task may have to judge
_POINTS = 1 << 14
_TRIANGLES = 1 << 14  # critical triangles that a task rasterizes
_AWAY, _EVENED, _FAR = 1.0, 0.7, 3.0  # cells: a level set, widths of a filter, and no farther


class Lattice(NamedTuple):
    """Cubic cells that cover an image with room around it."""

    origin: Array
    """Center of cell (0, 0, 0) [m]."""
    cell: float
    """Edge h of a cell [m]."""
    shape: tuple[int, int, int]
    """Number of cells along x, y and z."""

    @classmethod
    def around(cls, points: Array, cell: float) -> Lattice:
        """The lattice around points, shape (n, 3) [m]."""
        low, high = points.min(axis=0), points.max(axis=0)
        count = np.ceil((high - low) / cell).astype(int) + 2 * _MARGIN
        origin = (low + high - (count - 1) * cell) / 2.0
        return cls(origin, cell, (int(count[0]), int(count[1]), int(count[2])))

    def centers(self) -> dict[str, tuple[str, Array, dict[str, str]]]:
        """Coordinates of the cell centers for a dataset over x, y and z [m]."""
        return {
            name: (name, start + self.cell * np.arange(size), {"units": "m"})
            for name, start, size in zip("xyz", self.origin, self.shape, strict=True)
        }

    def coordinates(self, points: Array) -> Array:
        """Points [m] in cells from the center of cell (0, 0, 0)."""
        return (points - self.origin) / self.cell

    def places(self, coordinates: Array | Index) -> Array:
        """Such coordinates as points [m]."""
        return self.origin + self.cell * coordinates


def covered_cubes(covered: Mask) -> Mask:
    """Cubes between eight neighboring centers of a lattice that are all covered."""
    for axis in range(3):
        rolled = np.moveaxis(covered, axis, 0)
        covered = np.moveaxis(rolled[:-1] & rolled[1:], 0, axis)
    return covered


class Spans(NamedTuple):
    """Pieces of lines of sight between crossings, line by line, upwards."""

    column: Index  # its line (i, j) as i · width + j over the axes that follow, cyclically
    start: Array  # beginning of the piece, in cells
    length: Array  # length of the piece, in cells; 0 after the last crossing of a line
    cover: Index  # number of activations that reach it
    degree: Index  # those of which the map keeps the orientation minus those that it turns over
    triangle: Index  # number of the critical triangle where it begins


@dataclass(frozen=True, eq=False)
class Image:
    """The image of a triangulated box under the map that is linear on its tetrahedra."""

    grid: LiftedGrid
    """Tips at the vertices of the box."""
    lattice: Lattice
    """Cells of space that cover the image."""
    unit: float
    """Whole units to a cell [-]: vertices are rounded to cell / unit."""
    vertices: Array
    """Mapped vertices from the lattice's origin [cell / unit], shape (n, 3)."""
    triangles: Index
    """Critical triangles, as `kernels.image.raster.critical_triangles` lists them."""
    half: LiftedGrid | None = None
    """The grid of half as many cells, if it is known."""

    @lazy
    def coarse(self) -> Image:
        """The image of half as fine a grid on the same lattice."""
        known = self.half if self.grid.is_torn else None
        return image_of(known or self.grid.coarser(), self.lattice)

    @property
    def is_one_to_one(self) -> bool:
        """True if det J keeps its sign at the vertices, and no line of sight meets a second layer.

        Pieces that none covers may have a degree: walls thinner than triangles are flat cross.
        """
        dets = self.grid.jacobian_dets
        return bool(dets.min() * dets.max() > 0.0) and all(
            (spans.cover <= np.minimum(1, np.abs(spans.degree)))[spans.length > 0.0].all()
            for spans in self.spans
        )

    @lazy
    def spans(self) -> tuple[Spans, Spans, Spans]:
        """Cover of the lines through the cell centers along each axis, to rounding."""
        return self._spans(0), self._spans(1), self._spans(2)

    def _spans(self, axis: int) -> Spans:
        crossing = self._crossings(axis)
        order = np.lexsort((crossing.height, crossing.column))
        column, height = crossing.column[order], crossing.height[order]
        same = np.diff(column, append=-1) == 0
        length = np.where(same, np.diff(height, append=0.0), 0.0)
        # Crossings at one height come in any order, folds are rough: sums may fall below zero.
        cover = np.maximum(np.cumsum(crossing.cover[order]), 0)
        degree = np.cumsum(crossing.degree[order])
        return Spans(column, height, length, cover, degree, crossing.triangle[order])

    def with_more_lines(self, times: int) -> Image:
        """The same image under lines of sight as many times as close, a power of two."""
        lattice = self.lattice
        i, j, k = (times * size for size in lattice.shape)
        finer = lattice._replace(cell=lattice.cell / times, shape=(i, j, k))
        return replace(self, lattice=finer, unit=self.unit / times)

    def cube_places(self, spans: Spans, axis: int, which: Index) -> Array:
        """Places of the unit cube that go to where some spans along an axis begin, (n, 3)."""
        corners = self.triangles[spans.triangle[which], :3]
        at = np.stack(np.divmod(spans.column[which], self.lattice.shape[(axis + 2) % 3]), axis=1)
        plane = [(axis + 1) % 3, (axis + 2) % 3]
        flat = self.vertices[corners][:, :, plane] - at[:, None] * self.unit
        a, b, c = flat[:, 0], flat[:, 1], flat[:, 2]
        shares = np.stack([_twice_area(b, c), _twice_area(c, a), _twice_area(a, b)], axis=1)
        shares /= shares.sum(axis=1, keepdims=True)
        places = np.einsum("tk,tki->ti", shares, self.cube_vertices(corners))
        return places.clip(0.0, 1.0)  # to rounding they are within

    def cube_vertices(self, which: Index) -> Array:
        """Vertices of the grid of n³ boxes in the unit cube by number, shape (*which.shape, 3)."""
        n = self.grid.n
        return np.stack(np.unravel_index(which, (n + 1,) * 3), axis=-1) / n

    @lazy
    def critical_surface(self) -> Surface:
        """All critical triangles: the boundary of the image, and folds and walls inside it."""
        vertices, faces = compact_surface(self.places, self.triangles[:, :3])
        return Surface(vertices=vertices, faces=faces)

    def distance(self, points: Array) -> Array:
        """Distance from points outside to the image [m], shape (n,)."""
        return self.critical_surface.distance(points)

    def are_deep(self, points: Array) -> Mask:
        """Mask of points [m] inside by the diagonal of a cell, where nothing is to be decided."""
        from scipy.ndimage import map_coordinates

        at = self.lattice.coordinates(points).T
        return map_coordinates(self.signed_field, at, order=1, cval=np.inf) < -DIAGONAL

    @lazy
    def signed_field(self) -> Array:
        """Distance of the cell centers to the boundary [cells], negative inside, up to 2.5.

        A plane that cuts the axes at distances a, b, c is 1/√(1/a² + 1/b² + 1/c²) away: linear
        interpolation between centers gives the crossings back, to second order in the cell.
        """
        inverse_square = np.zeros(self.lattice.shape)
        for axis in range(3):
            along = np.full(self.lattice.shape, np.inf)  # beyond two cells from the boundary
            index, behind = self.boundary_crossings(axis)
            for step in (-1, 0, 1, 2):
                shifted = list(index)
                shifted[axis] = index[axis] + step
                np.minimum.at(along, tuple(shifted), np.abs(behind - step).clip(_CLOSEST))
            inverse_square += along**-2
        with np.errstate(divide="ignore"):
            distance = np.clip(inverse_square**-0.5, _CLOSEST, _BAND)
        return np.where(self.counts[0] > 0, -distance, distance)

    @property
    def places(self) -> Array:
        """Mapped vertices [m], shape (n, 3)."""
        return self.lattice.origin + self.vertices * (self.lattice.cell / self.unit)

    @lazy
    def counts(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Cover counts and degrees at the cell centers, exactly; both of the lattice's shape.

        Counts may be below zero where a fold is rough.

        Raises:
            InvalidInput: The lattice has more cells than fit into memory.
        """
        shape = self.lattice.shape
        cells = math.prod(shape)
        check_memory("cells of the lattice", f"{cells:,}", _BYTES * cells)
        counts, degrees = np.zeros((2, shape[0] * shape[1], shape[2]), np.int32)
        raster.add_counts(self._crossings(2), counts, degrees)
        return counts.reshape(shape), degrees.reshape(shape)

    def counts_at(self, points: Array) -> Index:
        """Cover counts of 0 or more at any points [m], but for rounding to units, shape (n,)."""
        where = np.rint(self.lattice.coordinates(points) * self.unit)
        out, shape = np.empty(len(where), np.int64), self.lattice.shape[:2]
        image = self.vertices, self.triangles, self.unit, shape, *self._bins
        parallel.run(
            partial(raster.cover_at, *image, where[block], out[block])
            for block in parallel.blocks(len(where), _POINTS)
        )
        return np.maximum(out, 0)

    @lazy
    def _bins(self) -> tuple[Index, Index]:
        shape = self.lattice.shape[:2]
        return raster.bin_triangles(self.vertices, self.triangles, self.unit, shape)

    def boundary_crossings(self, axis: int) -> tuple[tuple[Index, Index, Index], Array]:
        """Places where the boundary of the image cuts the edges between cell centers along an axis.

        Returns:
            The centers just before the boundary, as an index of arrays of the lattice's shape, and
            how far behind them it lies, in cells, 0 to 1, shape (n,).
        """
        counts = np.moveaxis(self.counts[0], axis, 2)
        crossing = self._crossings(axis)
        i, j = np.divmod(crossing.column, self.lattice.shape[(axis + 2) % 3])
        # np.moveaxis leaves the other two axes in ascending order, `_crossings` in cyclic order
        i, j = (j, i) if axis == 1 else (i, j)
        before = counts[i, j, crossing.center - 1]
        near = np.flatnonzero((before > 0) != (counts[i, j, crossing.center] > 0))
        near = near[np.lexsort((crossing.height[near], crossing.center[near], j[near], i[near]))]
        i, j, k = i[near], j[near], crossing.center[near] - 1
        cover = crossing.cover[near]
        total, of_edge = np.cumsum(cover), np.stack([i, j, k])  # sums begin anew at every edge
        starts = np.flatnonzero((np.diff(of_edge, prepend=-1) != 0).any(axis=0))
        earlier = np.repeat((total - cover)[starts], np.diff(starts, append=len(cover)))
        after = before[near] + total - earlier
        flips = (after > 0) != (after - cover > 0)
        index = [i[flips], j[flips]]
        index.insert(axis, k[flips])
        return (index[0], index[1], index[2]), crossing.height[near][flips] - k[flips]

    def _crossings(self, axis: int) -> raster.Crossings:
        p, q = (axis + 1) % 3, (axis + 2) % 3
        blocks, width = parallel.blocks(len(self.triangles), _TRIANGLES), self.lattice.shape[q]
        parts: list[raster.Crossings] = [raster.empty_crossings(0)] * len(blocks)

        def task(number: int) -> None:
            part = self.vertices, self.triangles[blocks[number]], self.unit
            out = raster.empty_crossings(raster.most_crossings(*part, p, q))
            used = raster.crossings(*part, axis, width, out)
            out.triangle[:used] += blocks[number].start
            parts[number] = rows(out, slice(used))

        parallel.run(partial(task, number) for number in range(len(blocks)))
        return joined([raster.empty_crossings(0), *parts])


def _twice_area(a: Array, b: Array) -> Array:
    """Of triangles of the origin, a and b in the plane, shape (n,)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def image_of(
    grid: LiftedGrid, lattice: Lattice, progress: Progress = silent, half: LiftedGrid | None = None
) -> Image:
    """The image of a grid of three free bundles; `half` is that of half as many cells, if known."""
    scaled, nodes = lattice.coordinates(grid.tips), (grid.n + 1) ** 3
    places = scaled[:nodes].reshape(*(grid.n + 1,) * 3, 3)
    steps = [np.nanmax(np.abs(np.diff(places, axis=axis))) for axis in range(3)]
    longest = max(float(np.sum(steps)), 1.0)
    longest = max(longest, float(np.ptp(scaled[grid.lifted], axis=1).sum(axis=1).max(initial=0.0)))
    # Determinants of the kernels are then exact, as rounding adds no more than 1 unit.
    unit = 2.0 ** np.floor(raster.EXACT_BITS - 1 - np.log2(longest))
    vertices = np.rint(scaled * unit)
    vertices[np.isnan(vertices)] = 0.0
    triangles = _critical_triangles(vertices[:nodes], grid.jacobian_dets, grid.is_lifted, progress)
    if len(grid.lifted):
        triangles = np.concatenate([triangles, _lifted_triangles(vertices, grid.lifted)])
    return Image(grid, lattice, unit, vertices, triangles, half)


def _lifted_triangles(vertices: Array, cells: Index) -> Index:
    """Critical triangles of cells by themselves; those that they share with equals cancel."""
    parts, simplices = list[Index](), kuhn_simplices(3)
    boxes = np.linalg.det(np.diff(corner_bits(3)[simplices], axis=1))
    for simplex, box in zip(simplices, np.rint(boxes).astype(int), strict=True):
        for apex in range(4):
            faces = np.sort(cells[:, np.delete(simplex, apex)], axis=1)
            a, b, c = np.moveaxis(vertices[faces], 1, 0)
            away = vertices[cells[:, simplex[apex]]] - a
            side = np.sign(np.einsum("ni,ni->n", np.cross(b - a, c - a), away)).astype(int)
            a, b, c = np.moveaxis(vertices[cells[:, simplex[1:]]], 1, 0) - vertices[cells[:, 0]]
            turn = np.sign(np.einsum("ni,ni->n", np.cross(a, b), c)).astype(int) * box
            parts.append(np.column_stack([faces, side, side * turn]))
    rows = np.concatenate(parts)
    key = rows[:, :3] @ len(vertices) ** np.arange(2, -1, -1)
    _, first, number = np.unique(key, return_index=True, return_inverse=True)
    sums = [np.bincount(number, column) for column in rows[:, 3:].T]
    balance = np.stack(sums, axis=1).astype(np.int64)
    kept = balance.any(axis=1)
    return np.concatenate([rows[first[kept], :3], balance[kept]], axis=1)


def _critical_triangles(
    vertices: Array, jacobian_dets: Array, is_lifted: Mask, progress: Progress
) -> Index:
    star, axes = raster.stars(is_lifted.shape), np.array(is_lifted.shape)
    gaps = np.pad(is_lifted, [(0, 1)] * 3).ravel()  # of the cells whose least vertex this is
    largest = np.abs(jacobian_dets).max() or 1.0
    jacobian_dets = np.rint(jacobian_dets / largest * 2.0**_DET_BITS)
    blocks = parallel.blocks(len(vertices), max(1, _ROWS // len(star.triangles)))
    parts: list[Index] = [np.empty((0, 5), np.int64)] * len(blocks)

    def task(number: int) -> None:
        first, last = blocks[number].start, blocks[number].stop
        out = np.empty(((last - first) * len(star.triangles), 5), np.int64)
        grid = vertices, jacobian_dets, axes, gaps
        used = raster.critical_triangles(*grid, first, last, star, out)
        parts[number] = out[:used].copy()
        progress(last - first)

    parallel.run(partial(task, number) for number in range(len(blocks)))
    return np.concatenate(parts)


def boundary_surface(image: Image, volume: float) -> Surface:
    """The closed surface around a volume where the field is constant, by marching cubes.

    The image of a grid is a little small where it is convex: the same offset everywhere mends it.
    """
    surface = _level_set(image, 0.0)
    if surface.area == 0.0:
        return surface
    offset = (volume - surface.volume) / (surface.area * image.lattice.cell)
    return _level_set(image, float(np.clip(offset, -0.5, 0.5)))


def _level_set(image: Image, level: float) -> Surface:
    field = image.signed_field
    if not (field < level).any():
        return Surface(vertices=np.empty((0, 3)), faces=np.empty((0, 3), np.int32))
    vertices, faces = level_set(field, level)
    return Surface(vertices=image.lattice.places(vertices), faces=faces)


def wrapped_surface(image: Image, volume: float) -> Surface:
    """A closed surface around a volume without teeth and holes, however thin and rough parts are.

    The level set one cell away from the image is evened out, and all its vertices are moved back as
    far along their normals as encloses the volume. Gaps below two cells are filled.
    """
    covered, surface = image.counts[0] > 0, image.critical_surface
    near = covered & ~np.asarray(binary_erosion(covered), bool)
    near[tuple(np.rint(image.lattice.coordinates(surface.vertices)).astype(int).T)] = True
    near = np.asarray(binary_dilation(near, np.ones((3, 3, 3)), iterations=2), bool) & ~covered
    # From cell centers to the image, 0 inside, in cells up to three.
    distances, centers = np.where(covered, 0.0, _FAR), image.lattice.places(np.argwhere(near))
    distances[near] = np.minimum(surface.distance(centers) / image.lattice.cell, _FAR)
    vertices, faces = level_set(gaussian_filter(distances, _EVENED), _AWAY)
    places = image.lattice.places(vertices)
    back = _AWAY * image.lattice.cell * vertex_normals(places, faces)
    far, near = (enclosed_volume(places - part * back, faces) for part in (0.0, 1.0))
    part = float(np.clip((far - volume) / (far - near), 0.5, 1.5))
    return Surface(vertices=places - part * back, faces=faces)
