"""Volume that an image fills, by multiplicity, and that of its convex hull, with their errors."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.flat import enclosed_area
from softreach.geometry.hull import convex_faces, convex_hull
from softreach.geometry.surface import compact_surface, corner_areas, enclosed_volume
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Faces, Index, Points
from softreach.support.parallel import blocks
from softreach.workspace.flux import signed_volume
from softreach.workspace.grid import LiftedGrid
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
    error: float = np.nan


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
    sense = 1 if _signed_volume(image) >= 0 else -1
    third = image_of(LiftedGrid.of(image.grid.tip_map, image.grid.n // 3), image.lattice)
    value, *rough = (_covered(each, sense) for each in (image, image.coarse, third))
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


def _covered(image: Image, sense: int) -> Estimate:
    """∫ [x is reached] dx [m³], with the scatter of three directions of sight."""
    again = _correction(image, sense)
    return Estimate(sense * _signed_volume(image) + again.value, again.error)


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
