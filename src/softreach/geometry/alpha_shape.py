"""The Delaunay triangulation of a cloud, exact whatever the points, and its alpha shapes.

Of every radius they come from one triangulation, of one radius box by box: a tetrahedron whose
circumscribed sphere has a radius R <= α and its center in a box is Delaunay if and only if it is so
among the points within α of the box, so that boxes that together are all of space give the whole
shape, each on a thread. Points enter every triangulation in the same order, and sums and faces have
an order of their own: whatever the boxes, all are those of one triangulation.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.geometry.hull import Hull
from softreach.geometry.surface import compact_surface, surface_area, unit_scale
from softreach.kernels.points import alpha as kernels
from softreach.kernels.points.bowyer_watson import insertion_order, triangulate
from softreach.kernels.points.predicates import scratch
from softreach.support import parallel
from softreach.support.arrays import Array, Faces, Index, Mask, Points
from softreach.support.lazy import lazy

_SAMPLED = 512
_NEIGHBORS = 16


def delaunay(points: np.ndarray) -> Delaunay:
    """Triangulate finite points (n, 3) [m], by exact predicates and so right for any input.

    Coordinates smaller than 2^-200 of the largest count as zero.
    """
    scaled, _ = unit_scale(points)
    tetrahedra = neighbors = np.empty((0, 4), np.int32)
    if len(points) >= 4:
        order = insertion_order(scaled)  # keeps the work local
        cells, neighbors, _ = triangulate(scaled[order], partial(lies_on_curve, scaled))
        tetrahedra = order.astype(np.int32)[cells]
    return Delaunay(points=points, tetrahedra=tetrahedra, neighbors=neighbors)


@dataclass(frozen=True, kw_only=True, eq=False)
class Delaunay:
    """Tetrahedra whose circumscribed spheres hold no other point; of equal points one is a vertex.

    Points in one plane, on one line or fewer than four give no tetrahedra at all; nor do more than
    some hundreds on a curve in space, of which nearly every pair would have an edge.
    """

    points: Points  # positions [m], (n, 3)
    tetrahedra: np.ndarray  # vertices as indices of points, positively oriented, (m, 4)
    neighbors: np.ndarray  # number i shares the face opposite vertex i; -1 outside the hull, (m, 4)


def lies_on_curve(points: Points) -> bool:
    """True if neighbors of points are strung along a line, as the tips of one bundle are."""
    return local_dimension(points) < 1.5


def local_dimension(points: Points) -> float:
    """The power with which the number of neighbors grows with distance: 1 on a curve, 2, 3.

    The estimate of largest likelihood over the 16 nearest others of 512 points at most (Levina,
    Bickel 2004, NIPS 17; likelihoods multiplied: MacKay, Ghahramani 2005), to some percent; 0 for
    fewer than 17 different points.
    """
    from scipy.spatial import KDTree  # lazily

    distinct = np.unique(points, axis=0)
    if len(distinct) <= _NEIGHBORS:
        return 0.0
    count = min(_SAMPLED, len(distinct))
    chosen = np.random.default_rng(0).choice(len(distinct), count, replace=False)
    distance = np.asarray(KDTree(distinct).query(distinct[chosen], k=_NEIGHBORS + 1)[0])[:, 1:]
    growth = np.log(distance[:, -1:] / distance[:, :-1]).sum()
    return float(count * (_NEIGHBORS - 1) / growth) if growth > 0 else 0.0  # one sets the scale


BLOCK = 200_000  # cells measured by one thread at a time
FEWEST = 10_000  # points of a box, on average: fewer are triangulated before threads pay
SAMPLED = 4096  # points by which boxes are cut
WORTHWHILE = 1.4  # times as many points in a box as without overlap, at most
WHOLE = np.array([[-np.inf] * 3, [np.inf] * 3])


class AlphaComplex:
    """A triangulation with the radius from which on each tetrahedron belongs to the shape.

    The alpha shape of radius α is the union of the tetrahedra whose circumscribed sphere has a
    radius R <= α (Edelsbrunner and Mücke 1994): what is left of the convex hull after a ball of
    that radius has scooped out everything it can reach without enclosing a point. Radii that
    rounding of the coordinates can make equal to α count as such, and what is as flat as that
    rounding has no volume and is no region (`kernels.points.alpha`).
    """

    def __init__(self, *, triangulation: Delaunay) -> None:
        """Measure all tetrahedra."""
        self.triangulation = mesh = triangulation
        points, exponent = unit_scale(mesh.points)
        radii, least, volumes = np.empty((3, len(mesh.tetrahedra)))
        flat, names = np.empty(len(mesh.tetrahedra), bool), np.arange(len(points))

        def task(part: slice) -> Callable[[], object]:
            results = (each[part] for each in (radii, least, volumes, flat))
            cells = mesh.tetrahedra[part]
            return partial(kernels.measure_cells, points, cells, names, WHOLE, scratch(), *results)

        parallel.run(task(part) for part in parallel.blocks(len(radii), BLOCK))
        # Circumscribed radii [m], and the least that rounding of the coordinates leaves possible.
        self.radii, self.least = np.ldexp(radii, exponent), np.ldexp(least, exponent)
        self.volumes = np.ldexp(volumes, 3 * exponent)  # [m³]
        self.flat = flat  # whether a tetrahedron is no thicker than that rounding

    @lazy
    def _curve(self) -> tuple[np.ndarray, np.ndarray]:
        """Least radii in increasing order, and the volumes summed up to each."""
        order = np.argsort(self.least)
        return self.least[order], np.cumsum(np.where(self.flat, 0.0, self.volumes)[order])

    def volume(self, alpha: float | np.ndarray) -> float | np.ndarray:
        """Volume [m³] of the shape at one radius or at an array of radii [m]."""
        if np.ndim(alpha) == 0:  # one sum takes a fiftieth of the time of the sorted curve
            return float(self.volumes[(self.least <= alpha) & ~self.flat].sum())
        radii, volumes = self._curve
        steps = np.searchsorted(radii, alpha, side="right")
        return np.where(steps > 0, volumes[steps - 1], 0.0) if len(volumes) else 0.0 * steps

    def regions(self, alpha: float) -> int:
        """Number of parts of the shape that are connected through faces."""
        return self._joined(alpha)[2]

    def critical_alpha(self) -> float:
        """The smallest radius [m] at which one region covers all points; inf for a flat cloud.

        From the radius that covers every point the tetrahedra are added one by one: the number of
        regions is not monotone in the radius, so that a bisection can settle on a larger one.
        """
        mesh = self.triangulation
        at_points = np.full(len(mesh.points), -1.0)
        kernels.least_radii(mesh.tetrahedra, self.least, at_points)
        covering = at_points.max(initial=-1.0)
        if not 0.0 <= covering < np.inf:
            return np.inf
        radius = self.radii[self.least == covering].max()
        alike = 2.0 * radius - covering
        parent, solid, regions = self._joined(alike)
        if regions == 1:
            return float(max(radius, self.least[self.least <= alike].max()))
        later = np.flatnonzero(self.least > alike)
        order = later[np.argsort(self.least[later])]
        joined = self.radii, self.least, solid, parent, regions
        return float(kernels.radius_of_one_region(mesh.neighbors, *joined, order))

    def _joined(self, alpha: float) -> tuple[np.ndarray, Mask, int]:
        """Sets for `kernels.added_regions` to add tetrahedra to, and the number of regions."""
        parent, solid = np.full(len(self.radii), -1, np.int32), ~self.flat
        kept = self.least <= alpha
        regions = kernels.join_regions(self.triangulation.neighbors, kept, solid, parent)
        return parent, solid, int(regions)

    def hull(self, alpha: float) -> Hull:
        """The shape of one radius [m]: surface, volume, area and regions."""
        mesh, kept = self.triangulation, self.least <= alpha
        surface = _joined([_kept_piece(mesh.tetrahedra, mesh.neighbors, kept, self.flat)])
        volume = _sum(self.volumes[kept & ~self.flat])
        return _hull(mesh.points, *surface, volume, alpha)


def alpha_hull(
    points: Points, alpha: float, *, part: Mask | None = None, boxes: int | None = None
) -> tuple[Hull, float]:
    """`AlphaComplex.hull` of one radius on all threads, and the volume [m³] of that of a part.

    The part, a mask of points, comes first into the triangulation and is measured on the way.
    """
    scaled, exponent = unit_scale(points)
    radius = float(np.ldexp(alpha, -exponent))
    most = min(parallel.threads_here(), len(points) // FEWEST) if boxes is None else boxes
    parts = [WHOLE]
    if min(most, len(points)) > 1 and np.isfinite(radius):
        # A sample will do: the boxes decide how long the shape takes, and nothing else.
        chosen = np.random.default_rng(0).integers(len(points), size=SAMPLED)
        parts = _divided(scaled[chosen], radius, WHOLE, most)
    pieces = _pieces(scaled, radius, part, parts)
    surface = _joined(pieces)
    volume, volume_of_part = (
        float(np.ldexp(_sum(np.concatenate(volumes)), 3 * exponent))
        for volumes in zip(*(piece.volumes for piece in pieces), strict=True)
    )
    return _hull(points, *surface, volume, alpha), volume_of_part


class _Piece(NamedTuple):
    """The tetrahedra of a shape whose centers are in one box."""

    faces: Faces  # Those between them and the rest, as indices of points
    sets: Index  # Set of connected tetrahedra at each face, counted from 0
    solid: Mask  # Whether each set is a region: not all of it is flat
    # Of the tetrahedra, and of those that a part of the points has by itself [m³]
    volumes: tuple[Array, Array] = (np.empty(0), np.empty(0))


class _Crowded(Exception):
    """One triangulation of all points must decide whether they lie on a curve."""


def _pieces(points: Points, alpha: float, part: Mask | None, boxes: list[Array]) -> list[_Piece]:
    """The shape box by box; in one piece where too many tetrahedra crowd in a box."""

    def pieces(boxes: list[Array], lies_on_curve: Callable[[], bool]) -> list[_Piece]:
        tasks = (partial(_piece, points, alpha, part, box, lies_on_curve) for box in boxes)
        return list(parallel.in_order(tasks))

    def give_up() -> bool:
        raise _Crowded

    if len(boxes) > 1:
        with suppress(_Crowded):
            return pieces(boxes, give_up)
    return pieces([WHOLE], partial(lies_on_curve, points))


def _piece(
    points: Points, alpha: float, part: Mask | None, box: Array, lies_on_curve: Callable[[], bool]
) -> _Piece:
    """Triangulate the points around a box, and keep the tetrahedra with centers in it."""
    members = np.flatnonzero(_near(points, alpha, box))
    order = insertion_order(points, members, part)
    inserted, work = points[order], scratch()
    volumes_of_part = [np.empty(0)]

    def measured(cells: np.ndarray) -> tuple[Mask, Mask, Array]:
        radii, least, volumes = np.empty((3, len(cells)))
        flat = np.empty(len(cells), bool)
        kernels.measure_cells(inserted, cells, order, box, work, radii, least, volumes, flat)
        return least <= alpha, flat, volumes

    def look(cells: np.ndarray) -> None:
        kept, flat, volumes = measured(cells)
        volumes_of_part[0] = volumes[kept & ~flat]

    early = 0 if part is None else int(part[members].sum())
    cells, neighbors, _ = triangulate(inserted, lies_on_curve, early, look)
    kept, flat, volumes = measured(cells)
    piece = _kept_piece(cells, neighbors, kept, flat)
    return piece._replace(
        faces=order[piece.faces], volumes=(volumes[kept & ~flat], volumes_of_part[0])
    )


def _kept_piece(cells: np.ndarray, neighbors: np.ndarray, kept: Mask, flat: Mask) -> _Piece:
    """The faces between kept tetrahedra and the rest, normals outwards, and whose they are."""
    room = 4 * len(cells)  # of which only what is written takes memory
    faces, owners = np.empty((room, 3), np.int32), np.empty(room, np.int32)
    count = kernels.boundary_faces(cells, neighbors, kept, faces, owners)
    faces, owners = faces[:count].copy(), owners[:count].copy()
    parent, solid = np.full(len(kept), -1, np.int32), ~flat
    kernels.join_regions(neighbors, kept, solid, parent)
    roots = np.flatnonzero(parent == np.arange(len(parent)))
    while not np.array_equal(above := parent[owners], owners):
        owners = above
    return _Piece(faces, np.searchsorted(roots, owners), solid[roots])


def _joined(pieces: list[_Piece]) -> tuple[Faces, Index]:
    """The faces around the regions of all pieces together, and the region of each."""
    solid = np.concatenate([piece.solid for piece in pieces])
    firsts = np.cumsum([0, *(len(piece.solid) for piece in pieces)])
    faces = np.concatenate([piece.faces for piece in pieces])
    sets = np.concatenate([k + piece.sets for k, piece in zip(firsts, pieces, strict=False)])
    if len(pieces) == 1:
        return faces[solid[sets]], sets[solid[sets]]
    inner = np.zeros(len(faces), bool)
    table = np.full(1 << (2 * len(faces)).bit_length(), -1)
    parent = np.arange(len(solid))
    kernels.join_pieces(np.sort(faces, axis=1), sets, solid, parent, table, inner)
    while not np.array_equal(above := parent[sets], sets):
        sets = above
    outer = ~inner & solid[sets]
    return faces[outer], sets[outer]


def _divided(sample: Points, alpha: float, box: Array, most: int) -> list[Array]:
    """A box cut in two, and these again, until there are enough or it costs too much."""
    if most == 1:
        return [box]
    share = (most // 2) / most
    load, at, axis = min((*_cut(sample[:, axis], alpha, share), axis) for axis in range(3))
    if load > WORTHWHILE:
        return [box]
    lower, upper = box.copy(), box.copy()
    lower[1, axis] = upper[0, axis] = at
    halves = zip((lower, upper), (most // 2, most - most // 2), strict=True)
    return [
        smaller
        for half, count in halves
        for smaller in _divided(sample[_near(sample, alpha, half)], alpha, half, count)
    ]


def _cut(x: Array, alpha: float, share: float) -> tuple[float, float]:
    """The greater load of two parts, over what it would be without overlap, and where to cut."""
    x = np.sort(x)
    left = np.searchsorted(x, x + alpha, side="right") / share
    right = (len(x) - np.searchsorted(x, x - alpha)) / (1.0 - share)
    best = np.maximum(left, right).argmin()
    return float(max(left[best], right[best]) / len(x)), float(x[best])


def _near(points: Points, alpha: float, box: Array) -> Mask:
    """Mask of the points in a box widened by the largest radius kept, and by rounding."""
    margin = alpha * (1.0 + 2.0 * kernels.LARGEST_SLACK) + 2.0**-50
    near = np.ones(len(points), bool)
    for x, low, high in zip(points.T, *box, strict=True):
        if low > -np.inf:
            near &= x >= low - margin
        if high < np.inf:
            near &= x <= high + margin
    return near


def _hull(points: Points, faces: Faces, sets: Index, volume: float, alpha: float) -> Hull:
    """A shape, its faces in an order that does not depend on where they come from."""
    regions, region = np.unique(sets, return_inverse=True)
    a, b, c = np.moveaxis(points[faces] - points[faces[:1, :1]], 1, 0)
    parts = np.bincount(region, np.einsum("fi,fi->f", a, np.cross(b, c)) / 6.0)
    vertices, faces = compact_surface(points, faces)
    first = faces.argmin(axis=1)[:, None] if len(faces) else faces[:, :1]
    faces = np.take_along_axis(faces, (first + np.arange(3)) % 3, axis=1)
    faces = faces[np.lexsort(faces.T[::-1])]
    return Hull(
        vertices=vertices,
        faces=faces,
        volume=volume,
        area=surface_area(vertices, faces),
        alpha=float(alpha),
        regions=len(regions),
        largest_region=float(parts.max(initial=0.0)),
        n=len(points),
    )


def _sum(volumes: Array) -> float:
    """Their sum from the smallest to the largest: the same for every order of tetrahedra."""
    return float(np.sort(volumes).sum())
