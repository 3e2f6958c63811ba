"""Volume that an image fills, by multiplicity, and that of its convex hull, with their errors.

The signed volume of the image of three bundles is what flows through its six faces.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.geometry.hull import convex_faces, convex_hull, enclosed_area
from softreach.geometry.surface import Surface, compact_surface, corner_areas, enclosed_volume
from softreach.rod.rods import refined
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Faces, Index, Points
from softreach.support.parallel import blocks
from softreach.workspace.grid import LiftedGrid, box_slopes, grid_ticks
from softreach.workspace.image import Image, Spans, covered_cubes, image_of

_LEFT = 0.35  # of what is removed of hulls; for four bundles 0.28 to 0.34 of it were found wrong
SURE_ACCURACY = 3e-3  # down from which integrals are as exact as a raster can ever use
FLUX_PART = 0.01  # of a larger accuracy: relative error of what flows through the faces
_NODES = 24  # Gauss nodes along each side of a face; two thirds of them tell the error
_ROUNDS = 8
_LESS = 0.5  # of the error before, that another round must leave
_CLIMBS = 25  # steps of a climb
_FIRST = 0.3  # of the box, that the first step goes
_ENOUGH = 0.05  # of the accuracy, of the size: slope that ends a climb
_FARTHEST = 0.02  # of the size, that a climb is taken to leave at most
_TOGETHER = 512  # facets


class Estimate(NamedTuple):
    """A number and how far off it may be."""

    value: float
    """The number, in the unit of what it estimates [unit]."""
    error: float = np.nan
    """How far off it may be [unit]; NaN where that is unknown."""


def named(**estimates: Estimate) -> dict[str, Any]:
    """Numbers with their errors, such as `volume` and `volume_error`."""
    return {
        f"{name}{suffix}": value
        for name, estimate in estimates.items()
        for suffix, value in zip(("", "_error"), estimate, strict=True)
    }


def extrapolated(fine: float, coarse: float, share: float = 1.0) -> Estimate:
    """The limit of numbers that err by O(1/n²), from grids of n and n/2 cells.

    A share of what is removed is the error stated: all, unless dense sets show that less will do.
    """
    removed = (fine - coarse) / 3.0
    return Estimate(fine + removed, share * abs(removed))


def solid_volume(image: Image, accuracy: float = SURE_ACCURACY) -> Estimate:
    """Volume of the image of a box [m³] from grids of n and n/2 cells along each of three axes.

    With the degree d(x), the sum of the orientations of the activations that reach x,
    V = ∫ [x is reached] dx = |∫ det J dγ| + ∫ ([x is reached] - |d|) dx for an image whose larger
    part keeps (or turns) the orientation. The first integral is what flows through the faces, exact
    to many digits, or to a hundredth of an accuracy above 0.003; NaN if a node has no stable
    equilibrium. The second lives only where the image folds or overlaps, and is rasterized.
    """
    rough = accuracy > SURE_ACCURACY
    nodes, enough = None if rough else _NODES, FLUX_PART * accuracy * rough
    signed = signed_volume(image.grid.tip_map, nodes, enough=enough)
    sense = 1 if signed.value >= 0 else -1
    at_fine, at_coarse = _correction(image, sense), _correction(image.coarse, sense)
    again = extrapolated(at_fine.value, at_coarse.value)
    value = abs(signed.value) + again.value
    return Estimate(value, signed.error + again.error + at_fine.error)


def torn_volume(image: Image) -> Estimate:
    """Volume of the image of several sheets [m³], where no integral over the box is known.

    As `solid_volume`, with the signed volume of the mapped tetrahedra, which at edges of sheets err
    by O(1/n). Half of what the finer grid changes is added, and all of it is the error; what it
    changes against a third of the cells counts by half.
    """
    third = image_of(LiftedGrid.of(image.grid.tip_map, image.grid.n // 3), image.lattice)
    value, *rough = map(covered_volume, (image, image.coarse, third))
    changes = [(value.value - each.value) / k for k, each in enumerate(rough, 1)]
    change = max(changes, key=abs)
    return Estimate(value.value + 0.5 * change, abs(change) + value.error)


def multiply_covered(image: Image) -> tuple[dict[int, float], float]:
    """Volumes reached by 2, 3, ... activations [m³], and how their sum changes on half the cells.

    A number whose volume is below the error, or changes by more than itself on half as fine a
    grid, is not a finding but the roughness of a fold: such places count with the next smaller.
    """
    images = image, image.coarse
    covers = [_mean(each, lambda spans: np.bincount(spans.cover, spans.length)) for each in images]
    size = max(*(len(cover) for cover in covers), 3)
    volumes, rough = (np.pad(v, (0, size - len(v)))[2:] for v in covers)
    error = float(abs(volumes.sum() - rough.sum()))
    sure = np.maximum(np.abs(volumes - rough), error) < volumes
    sure[0] = True
    measures, unsure = {}, 0.0
    for number in range(size - 1, 1, -1):
        unsure += float(volumes[number - 2])
        if sure[number - 2] and unsure > 0.0:
            measures[number], unsure = unsure, 0.0
    return dict(sorted(measures.items())), error


def fold_volume(image: Image) -> float:
    """Volume reached with both orientations [m³]; it errs by as much as the volume itself."""
    return float(_mean(image, lambda spans: spans.length[spans.cover > np.abs(spans.degree)].sum()))


def extrapolated_hull(points: Array, fewer: Array) -> Estimate:
    """Volume of the image's convex hull [m³] from mapped vertices and those of half a grid."""
    return extrapolated(convex_hull(points).volume, convex_hull(fewer).volume, _LEFT)


def outer_vertices(image: Image) -> Index:
    """Numbers of the vertices of critical triangles that may be corners of the convex hull.

    A plane through one leaves the image, and so one of the eight cell centers around it or more.
    """
    used = np.zeros(len(image.vertices), bool)
    used[image.triangles[:, :3]] = True
    vertices = np.flatnonzero(used)
    covered = covered_cubes(image.counts[0] > 0)
    i, j, k = np.floor(image.vertices[vertices] / image.unit).astype(int).T
    return vertices[~covered[i, j, k]]


def _correction(image: Image, sense: int) -> Estimate:
    """∫ ([x is reached] - sense · d) dx [m³], with the scatter of three directions of sight."""
    values = [
        float((spans.length * ((spans.cover > 0) - sense * spans.degree)).sum())
        for spans in image.spans
    ]
    scale = image.lattice.cell**3
    return Estimate(scale * float(np.mean(values)), scale * float(np.ptp(values)))


def covered_volume(image: Image) -> Estimate:
    """∫ [x is reached] dx [m³], with the scatter of three directions of sight."""
    signed = _signed_volume(image)
    sense = 1 if signed >= 0 else -1
    again = _correction(image, sense)
    return Estimate(sense * signed + again.value, again.error)


def _signed_volume(image: Image) -> float:
    """∫ d(x) dx of the mapped tetrahedra [m³]: the degree changes at critical triangles only."""
    if not len(image.triangles):
        return 0.0
    corners = image.vertices[image.triangles[:, :3]] / image.unit
    a, b, c = np.moveaxis(corners - corners.mean(axis=(0, 1)), 1, 0)
    flux = np.einsum("ti,ti->t", a, np.cross(b, c)) * image.triangles[:, 4]
    return -float(flux.sum()) / 6.0 * image.lattice.cell**3


def _mean(image: Image, quantity: Callable[[Spans], ArrayLike]) -> Array:
    """Mean over the three directions of sight, in m³; shorter arrays are filled with zeros."""
    rows = [np.atleast_1d(quantity(spans)) for spans in image.spans]
    size = max(len(row) for row in rows)
    mean = sum(np.pad(row, (0, size - len(row))) for row in rows) / 3.0
    return np.squeeze(mean * image.lattice.cell**3)


HullOf = Callable[[Points], Faces]  # faces or edges of the convex hull of points


class HullCorners(NamedTuple):
    """Activations whose tips are the corners of a convex hull."""

    cube: Array  # in the unit cube of the free bundles, (n, dimension)
    tips: Array  # [m], (n, 3)
    faces: Faces  # outwards, (f, 3); edges of a hull in the plane z = 0, (e, 2)

    @classmethod
    def of(cls, tips: Array, cube: Array, hull_of: HullOf = convex_faces) -> Self:
        """Corners of the hull of some tips at places of the cube; tips that are NaN are none."""
        known = np.isfinite(tips[:, 0])
        tips, cube = tips[known], cube[known]
        every = hull_of(tips)
        vertices, faces = compact_surface(tips, every)
        return cls(cube[np.unique(every)], vertices, faces)

    @property
    def area(self) -> Array:
        """∂V_convex/∂r of each corner [m²], shape (n, 3)."""
        return corner_areas(self.tips, self.faces)

    @property
    def facets(self) -> Array:
        """Outward area vectors of the faces [m²], shape (f, 3); of edges their normals [m]."""
        a, b, *c = np.moveaxis(self.tips[self.faces], 1, 0)
        return 0.5 * np.cross(b - a, c[0] - a) if c else np.cross(b - a, [0.0, 0.0, 1.0])

    @property
    def volume(self) -> float:
        """Of the hull [m³]; in a plane its area [m²]."""
        is_flat = self.faces.shape[1] == 2
        return (enclosed_area if is_flat else enclosed_volume)(self.tips, self.faces)


class ConvexHull(NamedTuple):
    """A hull of tips, the one that it was climbed from, and the volume of the image's own."""

    volume: Estimate  # the middle between two bounds, and half of what is between them [m³]
    corners: HullCorners
    before: HullCorners


def climbed_hull(
    tip_map: TipMap, cube: Array, accuracy: float, hull_of: HullOf = convex_faces
) -> ConvexHull:
    """The convex hull of the image of a box, climbed to an accuracy from places (n, dimension)."""
    tips = tip_map.tips(tip_map.box.from_free_cube(cube))
    before = corners = HullCorners.of(tips, cube, hull_of)
    if not len(corners.faces):
        return ConvexHull(Estimate(0.0, 0.0), corners, corners)
    size, error = float(np.ptp(corners.tips, axis=0).max()), np.inf
    for _ in range(_ROUNDS):
        before, low = corners, corners.volume
        vectors = corners.facets
        area = np.linalg.norm(vectors, axis=1)
        normals = vectors / np.maximum(area, np.finfo(float).tiny)[:, None]
        start = corners.cube[corners.faces[:, 0]]
        ends, tips, top = _climbed(tip_map, start, normals, _ENOUGH * accuracy * size, size)
        every = np.concatenate([corners.tips, tips])
        for block in blocks(len(top), _TOGETHER):
            attained = np.nanmax(every @ normals[block].T, axis=0)
            top[block] = np.fmax(top[block], attained)
        offset = np.einsum("fi,fi->f", corners.tips[corners.faces[:, 0]], normals)
        high = low + float(area @ (top - offset).clip(0.0))
        corners = HullCorners.of(every, np.concatenate([corners.cube, ends]), hull_of)
        last, error = error, 0.5 * (high - corners.volume)
        if error <= accuracy * high or error > _LESS * last:
            break
    return ConvexHull(Estimate(corners.volume + error, error), corners, before)


def _climbed(
    tip_map: TipMap, cube: Array, normals: Array, enough: float, size: float
) -> tuple[Array, Array, Array]:
    """Climb along a normal each, by projected gradients [BarzilaiBorwein1988].

    To places (n, dimension), tips (n, 3), and how far along normals they may go, by slopes, (n,).
    """
    box, free, n = tip_map.box, tip_map.box.free, len(cube)
    best, tips, top, value = cube.copy(), np.full((n, 3), np.nan), np.empty(n), np.full(n, -np.inf)
    rows, at, step = np.arange(n), cube, np.zeros(n)
    last, last_slope = at, np.zeros_like(at)
    for number in range(_CLIMBS):
        moved, slopes = tip_map.tips_and_slopes(box.from_free_cube(at))
        slope = np.einsum("ni,nij->nj", normals[rows], slopes[:, :, free]) * box.widths[free]
        height = np.einsum("ni,ni->n", moved, normals[rows])
        left = np.maximum(slope * (1.0 - at), -slope * at).sum(axis=1)
        up = height > value[rows]  # not of NaN
        which = rows[up]
        value[which], best[which], tips[which] = height[up], at[up], moved[up]
        top[which] = height[up] + np.minimum(left[up], _FARTHEST * size)
        lengths = np.linalg.norm(slope, axis=1).clip(1e-300)
        if number == 0:
            step = _FIRST / lengths
        else:
            way, turn = at - last, last_slope - slope
            both = (way * turn).sum(axis=1)
            bent = both > 1e-12 * (way**2).sum(axis=1)
            size_of = (way**2 if number % 2 else turn * way).sum(axis=1)
            over = (turn * way if number % 2 else turn**2).sum(axis=1)
            step = np.where(bent, size_of / np.where(bent, over, 1.0).clip(1e-300), 4.0 * step)
            step = np.clip(step, 1e-3 / lengths, 1e3 / lengths)
        ahead = (at + step[:, None] * slope).clip(0.0, 1.0)
        go = (left > enough) & (np.abs(ahead - at).max(axis=1) > 1e-9)  # not of NaN
        rows, last, last_slope, step = rows[go], at[go], slope[go], step[go]
        at = ahead[go]
        if not len(rows):
            break
    return best, tips, np.where(np.isfinite(value), top, -np.inf)


_TOL = 1e-11  # in L: there are few nodes, so that steps may be short
_ROUGH_TOL = 1e-9  # where a raster decides the error, and under loads, where each tip costs much
_ROUGH_ENOUGH = 1e-4  # of the volume, under loads in triangles
_LOADED_TOL = 1e-8  # both, as always under loads: of many breakpoints all count at 1e-9
_GAUSS_NODES = (8, 12, 16, 24, 32)
_KINKED = (24, 48, 96)  # cells along each edge of the box, for maps with kinks
_KINKED_SHARE = 2.0  # of what is removed, as a kink beside a line of the grid hides the half
_CELLS = 96  # along each edge of the box: an arm that bends by half a turn moves 2 degrees a cell


def signed_volume(tip_map: TipMap, nodes: int | None = None, *, enough: float = 0.0) -> Flux:
    """The signed volume of the image of three free bundles; NaN without a stable equilibrium.

    By Gauss and Legendre's rule on the faces, with nodes added until tips are no more exact than
    the rule; of maps with kinks by mapped triangles. With a number of nodes along each side the
    rule is taken for this and two thirds of it alone, on less exact tips. `enough` is the relative
    change of the volume that ends the adding of nodes, with tips of free arms as those of the map.
    """
    if tip_map.supports_unstable:
        tip_map = refined(tip_map, _LOADED_TOL)
    elif not enough:
        tip_map = refined(tip_map, flux_tol(tip_map) if nodes is None else _ROUGH_TOL)
    if not tip_map.is_smooth:
        return _of_triangles(tip_map, enough)
    counts = _GAUSS_NODES if nodes is None else (2 * nodes // 3, nodes)
    flux, change = _flux(tip_map, counts[0]), np.inf
    for count in counts[1:]:
        rough, flux = flux, _flux(tip_map, count)
        change = abs(flux.value - rough.value)
        if nodes is None and not change > max(flux.error, enough * abs(flux.value)):  # NaN too
            break
    return flux._replace(error=change + flux.error)


class Flux(NamedTuple):
    """∫ det J dγ by the divergence theorem, theory (81), and what it was computed from."""

    value: float  # signed volume [m³]: below zero if the map turns the orientation over
    error: float  # estimated error: from half as many nodes or so, and the error of the tips [m³]
    cube: Array  # nodes on the faces of the unit cube of the free bundles, (n, 3)
    area: Array  # area vectors of the nodes, with their weights [m²], (n, 3)


def _of_triangles(tip_map: TipMap, enough: float) -> Flux:
    """By mapped triangles of two grids on the faces, together nodes of a flux without O(1/n²)."""
    enough = max(enough, _ROUGH_ENOUGH * tip_map.supports_unstable)
    coarse = fine = _triangle_nodes(tip_map, _KINKED[0])
    removed = np.inf
    for cells in _KINKED[1:]:
        coarse, fine = fine, _triangle_nodes(tip_map, cells)
        removed = (fine.value - coarse.value) / 3.0
        if not abs(removed) > enough * abs(fine.value):  # NaN too
            break
    return Flux(
        fine.value + removed,
        _KINKED_SHARE * abs(removed) + fine.error,
        np.concatenate([fine.cube, coarse.cube]),
        np.concatenate([4.0 / 3.0 * fine.area, -1.0 / 3.0 * coarse.area]),
    )


def _triangle_nodes(tip_map: TipMap, cells: int) -> Flux:
    """Vertices of a grid on the faces, with kinks along its lines, and the areas of each."""
    grid, ticks = grid_faces(cells), grid_ticks(tip_map, cells)
    columns = zip(ticks, np.rint(cells * grid).astype(int).T, strict=True)
    cube = np.stack([each[numbers] for each, numbers in columns], axis=1)
    tips = tip_map.tips(tip_map.box.from_free_cube(cube))
    return _flux_of(tip_map, cube, tips, corner_areas(tips, face_triangles(grid, cells)))


def flux_tol(tip_map: TipMap) -> float:
    """Largest tip error on the faces, in L."""
    return min(tip_map.tol, _ROUGH_TOL if tip_map.supports_unstable else _TOL)


def face_image(tip_map: TipMap, cells: int = _CELLS) -> Surface:
    """The closed image of the faces of a box of three bundles, of so many cells along each edge.

    The map is one to one inside. Vertices lie on the boundary to the tolerance of the tips, NaN
    where there is no stable equilibrium, and so do edges of the box: sharp rims stay sharp.
    """
    cube = grid_faces(cells)
    tips, faces = tip_map.tips(tip_map.box.from_free_cube(cube)), face_triangles(cube, cells)
    surface = Surface(vertices=tips, faces=faces)  # which the map may turn over
    return Surface(vertices=tips, faces=faces[:, ::-1].copy()) if surface.volume < 0 else surface


def grid_faces(cells: int) -> Array:
    """Vertices of a grid of cells³ boxes that lie on the faces of the unit cube, each once."""
    outside = np.ones((cells + 1,) * 3, bool)
    outside[1:-1, 1:-1, 1:-1] = False
    return np.argwhere(outside) / cells


def _flux(tip_map: TipMap, nodes: int) -> Flux:
    """By Gauss and Legendre's nodes, as many along each side, all of a face one after the other."""
    x, w = np.polynomial.legendre.leggauss(nodes)
    weights, cube = np.outer(w / 2.0, w / 2.0).reshape(-1, 1), np.empty((3, 2, nodes**2, 3))
    for axis in range(3):
        cube[axis, :, :, axis] = [[0.0], [1.0]]
        cube[axis, :, :, (axis + 1) % 3] = np.repeat((1.0 + x) / 2.0, nodes)
        cube[axis, :, :, (axis + 2) % 3] = np.tile((1.0 + x) / 2.0, nodes)
    tips, slopes = box_slopes(tip_map, cube.reshape(-1, 3))
    area = np.empty(cube.shape)  # ∂r/∂a × ∂r/∂b outwards, times the weights
    for axis, face in enumerate(slopes.reshape(3, 2, -1, 3, 3)):
        across = np.cross(face[..., (axis + 1) % 3], face[..., (axis + 2) % 3])
        area[axis] = [-weights * across[0], weights * across[1]]
    return _flux_of(tip_map, cube.reshape(-1, 3), tips, area.reshape(-1, 3))


def _flux_of(tip_map: TipMap, cube: Array, tips: Array, area: Array) -> Flux:
    """Flux of nodes with area vectors; the error is that of the tips alone."""
    # From the middle, where products cancel least. Not BLAS, whose rounding depends on threads.
    value = float(((tips - tips.mean(axis=0)) * area).sum()) / 3.0
    moved = tip_map.tol * tip_map.length * float(np.linalg.norm(area, axis=1).sum())
    return Flux(value, moved, cube, area)


def face_triangles(cube: Array, cells: int) -> NDArray[np.int32]:
    """Two triangles for every square of the grid on the faces, oriented outwards."""
    number = np.full((cells + 1,) * 3, -1, np.int32)
    number[tuple(np.rint(cube * cells).astype(int).T)] = np.arange(len(cube))
    parts = []
    for axis in range(3):
        for side in (0, cells):
            # Axes in cyclic order: the square's first side times its second points along the axis.
            face = np.moveaxis(number, [axis, (axis + 1) % 3, (axis + 2) % 3], [0, 1, 2])[side]
            a, b, c, d = face[:-1, :-1], face[1:, :-1], face[1:, 1:], face[:-1, 1:]
            squares = (a, b, c, d) if side else (a, d, c, b)
            p, q, r, s = (corner.ravel() for corner in squares)
            parts += [np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1)]
    return np.concatenate(parts)
