"""Triangulated surfaces: area, volume inside, distance to them; tubes and ribbons along curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.picture.zbuffer import vertex_normals
from softreach.support import parallel
from softreach.support.arrays import Array, Faces, Index, Points
from softreach.support.errors import InvalidInput, check_installed
from softreach.support.lazy import lazy

FINEST = 200  # bits below the largest coordinate that `kernels.points.predicates` may see
STACK = 128  # room of a search in a tree of triangles: twice its depth
_BLOCK = 4_096  # points at once
_FEW = 8  # triangles of the smallest box around some
_ENDS = np.minimum, np.maximum
_ASIDE = 1e-3  # of the length of an edge, by which a wedge is drawn back


class TriangleTree(NamedTuple):
    """Boxes around triangles, each cut in two across where its triangles lie widest apart.

    Or several such trees, one after another.
    """

    firsts: Index  # First box, start, node of a field and triangle of each, and the end, (m + 1, 4)
    boxes: Array  # Axes, and ends along them [m]; children of i are 2i + 1 and 2i + 2, (n, 5, 3)
    starts: Index  # Of the triangles in each box of the last level, shape (2^level + 1,)
    corners: Array  # Of the triangles, in this order [m], shape (f, 3, 3)
    normals: Array  # Of each face, of its edges, and of its corners by their angles, (f, 7, 3)

    @classmethod
    def of(cls, corners: Array, normals: Array) -> Self:
        """The tree of triangles (f, 3, 3) [m] with normals of their parts (f, 7, 3)."""
        count, order, boxes = len(corners), np.arange(len(corners)), list[Array]()
        depth = max(0, int(np.ceil(np.log2(count / _FEW))))
        for level in range(depth + 1):
            starts = np.arange(2**level + 1) * count // 2**level
            block = np.repeat(np.arange(2**level), np.diff(starts))
            axes = _axes(corners[order], starts, block)
            along = corners[order] @ axes.swapaxes(1, 2)[block]
            ends = along.min(axis=1), along.max(axis=1)
            low, high = (f.reduceat(x, starts[:-1]) for f, x in zip(_ENDS, ends, strict=True))
            boxes.append(np.concatenate([axes, np.stack([low, high], axis=1)], axis=1))
            longest = (high - low).argmax(axis=1)[block]
            middles = along.mean(axis=1)[np.arange(count), longest]
            order = order[np.lexsort((middles, block))]  # within each box
        starts = np.arange(2**depth + 1) * count // 2**depth
        firsts = np.array([[0] * 4, [2 * len(starts) - 3, len(starts), 0, count]])
        return cls(firsts, np.concatenate(boxes), starts, corners[order], normals[order])

    def nearest(self, points: Array, enough: float = 1.0) -> tuple[Array, Array, Index]:
        """Signed distances of points (n, 3) [m], gradients (n, 3), and the nearest triangles.

        With `enough` below 1 distances may be too large, but not so if they are multiplied by it.
        """
        from softreach.kernels.room.triangles import nearest_triangles

        distance, gradient = np.empty(len(points)), np.empty((len(points), 3))
        face = np.empty(len(points), np.int64)
        points = np.require(points, requirements=["C", "W"])  # types that are compiled already

        def fill(b: slice) -> None:
            room = np.empty((STACK, 2))
            nearest_triangles(points[b], self, room, enough, distance[b], gradient[b], face[b])

        parallel.run(partial(fill, block) for block in parallel.blocks(len(points), _BLOCK))
        return distance, gradient, face


def _axes(corners: Array, starts: Index, block: Index) -> Array:
    """Principal axes of triangles (f, 3, 3) in blocks between starts, (n, 3, 3)."""
    middles = corners.mean(axis=1)
    mean = np.add.reduceat(middles, starts[:-1]) / np.diff(starts)[:, None]
    apart = (corners - mean[block, None]).swapaxes(1, 2)
    spread = np.add.reduceat(apart @ apart.swapaxes(1, 2), starts[:-1])
    return np.linalg.eigh(spread).eigenvectors.swapaxes(1, 2)


class SurfaceMesh(Protocol):
    """Anything with vertices and triangles: a `Surface`, a `Hull`, a trimesh.Trimesh."""

    @property
    def vertices(self) -> ArrayLike:
        """Corners [m], shape (v, 3)."""
        ...

    @property
    def faces(self) -> ArrayLike:
        """Indices into vertices, shape (f, 3)."""
        ...


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Surface:
    """Triangles; around a solid they are closed and oriented outwards."""

    vertices: Points
    """Corners [m], shape (v, 3)."""
    faces: Faces
    """Indices into vertices, shape (f, 3)."""

    @property
    def volume(self) -> float:
        """Volume inside, if the surface is closed [m³]."""
        return enclosed_volume(self.vertices, self.faces)

    @property
    def area(self) -> float:
        """Area [m²]."""
        return surface_area(self.vertices, self.faces)

    def distance(self, points: Array) -> Array:
        """Distance of points to the nearest triangle [m], shape (n,)."""
        return self._tree.nearest(points)[0] if len(self.faces) else np.full(len(points), np.inf)

    def __repr__(self) -> str:
        corners, triangles = len(self.vertices), len(self.faces)
        return f"Surface: {triangles:,} triangles, {corners:,} vertices, area {self.area:.6g} m²"

    @lazy
    def _tree(self) -> TriangleTree:
        corners = self.vertices[np.asarray(self.faces)]
        return TriangleTree.of(corners, np.zeros((len(corners), 7, 3)))  # no side is inside


def level_set(field: Array, level: float) -> tuple[Points, Faces]:
    """Places (v, 3) in edges of a grid (i, j, k), and triangles toward larger values of a field."""
    check_installed("skimage")
    from skimage.measure import marching_cubes

    places, faces, _, _ = marching_cubes(field, level, allow_degenerate=False)
    return places.astype(float), faces


def compact_surface(points: Points, faces: Faces) -> tuple[Points, Faces]:
    """The points that faces use, and the faces in their numbering."""
    used = np.zeros(len(points), bool)
    used[faces] = True
    number = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return points[used], number[faces]


def components(pairs: Faces | Index, size: int) -> Index:
    """Number of the connected component of each of so many nodes, of pairs that are linked."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(size, size))
    return connected_components(graph, directed=False)[1]


def without_flakes(surface: Surface, error: float) -> Surface:
    """A closed surface without the smallest parts that add up to less than an error [m³]."""
    vertices, faces = surface.vertices, surface.faces
    part = components(faces[:, [0, 1, 1, 2]].reshape(-1, 2), len(vertices))
    count = part.max(initial=0) + 1
    if count <= 1:
        return surface
    a, b, c = np.moveaxis((vertices - vertices.mean(axis=0))[faces], 1, 0)
    volumes = np.bincount(part[faces[:, 0]], np.einsum("fi,fi->f", a, np.cross(b, c)) / 6.0, count)
    order = np.argsort(np.abs(volumes))[:-1]  # the largest part always stays
    left_out = order[np.cumsum(np.abs(volumes[order])) <= error]
    vertices, faces = compact_surface(vertices, faces[~np.isin(part[faces[:, 0]], left_out)])
    return Surface(vertices=vertices, faces=faces)


def simplified(vertices: Points, faces: Faces, most: int) -> tuple[Points, Faces]:
    """A coarser surface of so many triangles at most, for pictures: vertices in a cube become one.

    Those that face other ways are kept apart, so that thin parts have two sides.
    """
    facing = vertex_normals(vertices, faces)
    way = np.abs(facing).argmax(axis=1)
    way += 3 * (facing[np.arange(len(way)), way] < 0.0)
    edge = np.sqrt(surface_area(vertices, faces) / max(most, 1))
    while len(faces) > most:
        cube = np.floor((vertices - vertices.min(axis=0)) / edge).astype(np.int64)
        places = np.column_stack([way, cube])
        number = np.ravel_multi_index(tuple(places.T), tuple(places.max(axis=0) + 1))
        _, place, count = np.unique(number, return_inverse=True, return_counts=True)
        sums = [np.bincount(place, weights=axis) for axis in vertices.T]
        corners = place[faces]
        after = np.roll(corners, -1, axis=1)
        fewer = corners[(corners != after).all(axis=1)]
        if len(fewer) <= most:
            return compact_surface(np.stack(sums, axis=1) / count[:, None], fewer)
        edge *= 1.2
    return vertices, faces


def enclosed_volume(vertices: Points, faces: Faces) -> float:
    """Volume inside an oriented closed surface [m³] by the divergence theorem."""
    if len(faces) == 0:
        return 0.0
    scaled, exponent = unit_scale(vertices)
    a, b, c = np.moveaxis((scaled - scaled.mean(axis=0))[faces], 1, 0)
    return float(np.ldexp(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0, 3 * exponent))


def corner_areas(vertices: Points, faces: Faces) -> Points:
    """∂V/∂r of each vertex of an oriented closed surface [m²], (v, 3): V = Σ r · ∂V/∂r / 3."""
    area, corners = np.zeros_like(vertices), (vertices - vertices.mean(axis=0))[faces]
    for k in range(3):
        share = np.cross(corners[:, (k + 1) % 3], corners[:, (k + 2) % 3]) / 6.0
        for axis in range(3):
            area[:, axis] += np.bincount(faces[:, k], share[:, axis], len(vertices))
    return area


def volume_beyond(surface: Surface, axis: int, at: float, side: int = 1) -> float:
    """Volume [m³] inside a closed surface where a coordinate is above a value; side -1: below.

    By the divergence theorem ∮ max(h, 0) n dA with the height h above the plane: on a triangle with
    heights a <= b <= c the mean of max(h, 0) is (a + b + c)/3 plus -a³/(3 (b - a)(c - a)) where
    a < 0 <= b, and c³/(3 (c - a)(c - b)) where b < 0 < c.
    """
    heights = side * (surface.vertices[:, axis] - at)
    a, b, c = np.sort(heights[surface.faces], axis=1).T
    p, q, r = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    area = side * np.cross(q - p, r - p)[:, axis] / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        lowest = (a + b + c) / 3.0 - a**3 / (3.0 * (b - a) * (c - a))
        highest = c**3 / (3.0 * (c - a) * (c - b))
    cases = [a >= 0, b >= 0, c > 0]
    return float((np.select(cases, [(a + b + c) / 3.0, lowest, highest], 0.0) * area).sum())


def surface_area(vertices: Points, faces: Faces) -> float:
    """Area of a surface [m²]."""
    scaled, exponent = unit_scale(vertices)  # squares of squares overflow early
    a, b, c = np.moveaxis(scaled[faces], 1, 0)
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return float(np.ldexp(twice / 2.0, 2 * exponent))


def plane_cut(surface: Surface, axis: int, at: float) -> list[Array]:
    """Curves (n, 3) of a surface in the plane where the coordinate along an axis has a value.

    Those of a closed surface end where they begin.
    """
    vertices, faces = np.asarray(surface.vertices, float), np.asarray(surface.faces)
    height = vertices[:, axis] - at
    above = height[faces] >= 0.0  # also a vertex in the plane
    count = above.sum(axis=1)
    is_cut = (count == 1) | (count == 2)
    # Of each triangle that is cut the vertex on its own side, and the two edges from there.
    first = (above[is_cut] == (count[is_cut] == 1)[:, None]).argmax(axis=1)[:, None]
    a, b, c = np.take_along_axis(faces[is_cut], (first + np.arange(3)) % 3, axis=1).T
    pieces = np.sort(np.array([[a, b], [a, c]]).transpose(2, 0, 1), axis=2)
    edges, ends = np.unique(pieces.reshape(-1, 2), axis=0, return_inverse=True)
    low, high = height[edges].T
    share = (low / (low - high))[:, None]
    places = (1.0 - share) * vertices[edges[:, 0]] + share * vertices[edges[:, 1]]
    places[:, axis] = at
    return [places[curve] for curve in _chained(ends.reshape(-1, 2), len(edges))]


def section_area(curves: list[Array], axis: int) -> float:
    """Area within closed curves in a plane across an axis, holes left out."""
    from matplotlib.path import Path

    flat = [np.delete(curve, axis, axis=1) for curve in curves]
    total = 0.0
    for k, curve in enumerate(flat):
        around = sum(Path(other).contains_point(curve[0]) for j, other in enumerate(flat) if j != k)
        (x, y), sign = curve.T, -1.0 if around % 2 else 1.0
        total += sign * abs(float(x[:-1] @ y[1:] - x[1:] @ y[:-1])) / 2
    return total


def _chained(pieces: NDArray[np.integer], count: int) -> list[list[int]]:
    """Curves through places that pieces connect; open ones first, from an end to the other."""
    touching: list[list[int]] = [[] for _ in range(count)]
    for number, (start, end) in enumerate(pieces.tolist()):
        touching[start].append(number)
        touching[end].append(number)
    used, curves = np.zeros(len(pieces), bool), list[list[int]]()
    for place in sorted(range(count), key=lambda place: len(touching[place]) % 2 == 0):
        curve = [place]
        while (ahead := next((k for k in touching[curve[-1]] if not used[k]), None)) is not None:
            used[ahead] = True
            curve.append(int(pieces[ahead].sum()) - curve[-1])  # its other end
        curves.append(curve)
    return [curve for curve in curves if len(curve) > 1]


def unit_scale(points: Points) -> tuple[Points, int]:
    """Points times 2^-e in [-1, 1], and e: exact, but for what lies below 2^-200 of the largest."""
    exponent = int(np.frexp(np.abs(points).max(initial=0.0))[1])
    scaled = np.ldexp(points, -exponent)
    return np.ldexp(np.round(np.ldexp(scaled, FINEST)), -FINEST), exponent


def parted(vertices: Points, faces: Faces) -> tuple[Points, Faces]:
    """A closed surface with two triangles at every edge; one that has them, or is open, as it is.

    Where it touches itself along edges, as the boundary of an α-shape does, each wedge that the
    solid fills gets a corner of its own, in the middle of the edge and a little within.
    """
    faces = np.asarray(faces, np.int64)
    starts, ends = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(starts, ends), np.maximum(starts, ends)
    _, edge, count = np.unique(low * len(vertices) + high, return_inverse=True, return_counts=True)
    ups = np.bincount(edge, weights=starts < ends)
    several = np.flatnonzero(count > 2)
    if not len(several) or (count != 2 * ups).any():
        return vertices, faces
    order = np.argsort(edge, kind="stable")
    first = np.cumsum(count) - count
    corners = np.full(faces.size, -1)  # of the middle of each side, by face and side
    middles = list[Array]()
    for k in several:
        sides = order[first[k] : first[k] + count[k]]
        for side, other, place in _wedges(vertices, faces, sides):
            corners[[side, other]] = len(vertices) + len(middles)
            middles.append(place)
    touching = corners.reshape(-1, 3)
    cut = (touching >= 0).any(axis=1)
    pieces = [piece for face, mid in zip(faces[cut], touching[cut], strict=True)
              for piece in _cut(face.tolist(), mid.tolist())]  # fmt: skip
    return np.concatenate([vertices, middles]), np.concatenate([faces[~cut], pieces])


def _wedges(vertices: Points, faces: Faces, sides: Index) -> list[tuple[int, int, Array]]:
    """Pairs of sides with solid between them, and a place in its middle."""
    triangles, k = np.divmod(sides, 3)
    starts, ends = faces[triangles, k], faces[triangles, (k + 1) % 3]
    a, b = vertices[min(starts[0], ends[0])], vertices[max(starts[0], ends[0])]
    length = np.linalg.norm(b - a)
    along = (b - a) / length
    out = vertices[faces[triangles, (k + 2) % 3]] - a
    across = np.eye(3)[np.argmin(np.abs(along))]
    across = np.cross(along, across) / np.linalg.norm(np.cross(along, across))
    angle = np.arctan2(out @ np.cross(along, across), out @ across)
    # The solid lies where angles fall from a side that runs along the edge to one that runs back.
    wedges = []
    for side in np.flatnonzero(starts < ends):
        fall = (angle[side] - angle) % (2.0 * np.pi)
        back = np.where(starts > ends, fall, np.inf)
        other = int(np.argmin(back))
        middle = angle[side] - back[other] / 2.0
        inward = np.cos(middle) * across + np.sin(middle) * np.cross(along, across)
        place = (a + b) / 2.0 + _ASIDE * length * inward
        wedges.append((int(sides[side]), int(sides[other]), place))
    return wedges


def _cut(face: list[int], middle: list[int]) -> list[tuple[int, int, int]]:
    """The triangles of one with corners in the middle of some sides; -1 for none."""
    while middle[0] < 0 or (middle[1] < 0 <= middle[2]):  # the side cut, or the first of two
        face, middle = face[1:] + face[:1], middle[1:] + middle[:1]
    (a, b, c), (ab, bc, ca) = face, middle
    if ca >= 0:
        return [(a, ab, ca), (ab, b, bc), (bc, c, ca), (ab, bc, ca)]
    if bc >= 0:
        return [(ab, b, bc), (ab, bc, c), (ab, c, a)]
    return [(ab, b, c), (ab, c, a)]


def tube_surface(
    centerline: ArrayLike, normal: ArrayLike, binormal: ArrayLike, radii: ArrayLike, sides: int = 32
) -> Surface:
    """A tube of circular sections of some radii [m], capped at both ends, with outward faces.

    Centers [m] and unit vectors in the sections have shape (stations, 3); normal x binormal points
    along the centerline. Shorter vectors make ellipses of sections. Vertices come ring by ring, the
    centers of both caps last.
    """
    center = np.asarray(centerline, float)
    if center.ndim != 2 or center.shape[1] != 3 or len(center) < 2:
        raise InvalidInput("centerline.shape", center.shape, "(stations, 3) with stations >= 2")
    if sides < 3:
        raise InvalidInput("sides", sides, "at least 3")
    angles = 2 * np.pi * np.arange(sides) / sides
    spokes = np.multiply.outer(np.cos(angles), np.asarray(normal, float))
    spokes += np.multiply.outer(np.sin(angles), np.asarray(binormal, float))
    reach = np.broadcast_to(np.asarray(radii, float), len(center))[:, None]
    rings = (center + reach * spokes).swapaxes(0, 1).reshape(-1, 3)
    vertices = np.concatenate([rings, center[[0, -1]]])
    ring, last = np.arange(sides), (len(center) - 1) * sides
    after = np.roll(ring, -1)
    quad = np.column_stack([ring, after, after + sides, ring + sides])
    walls = (quad + sides * np.arange(len(center) - 1)[:, None, None]).reshape(-1, 4)
    first_cap = np.column_stack([np.full(sides, last + sides), after, ring])
    last_cap = np.column_stack([np.full(sides, last + sides + 1), ring + last, after + last])
    faces = np.concatenate([_halves(walls), first_cap, last_cap])
    return Surface(vertices=vertices, faces=faces)


def ribbon_surface(lower: ArrayLike, upper: ArrayLike) -> Surface:
    """The closed skin between two patches (stations, across, 3) [m]; the lower comes first.

    The upper one is on the side that (along x across) points to; faces are outward.
    """
    low, high = np.asarray(lower, float), np.asarray(upper, float)
    index = np.arange(low.shape[0] * low.shape[1]).reshape(low.shape[:2])
    rim = np.concatenate([index[:-1, 0], index[-1, :-1], index[:0:-1, -1], index[0, :0:-1]])
    after, grid = np.roll(rim, -1), _grid(index)
    wall = np.column_stack([rim, after, after + index.size, rim + index.size])
    quads = np.concatenate([grid[:, ::-1], grid + index.size, wall])
    vertices = np.concatenate([low.reshape(-1, 3), high.reshape(-1, 3)])
    return Surface(vertices=vertices, faces=_halves(quads))


def grid_faces(stations: int, across: int) -> Faces:
    """Triangles of an open grid of points (stations, across), turning from the first axis to it."""
    return _halves(_grid(np.arange(stations * across).reshape(stations, across)))


def joined(parts: Sequence[Any]) -> Surface:
    """Several surfaces, each with vertices and faces, as one; none is one without vertices."""
    if len(parts) == 1:
        return parts[0]
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    faces = [part.faces + start for part, start in zip(parts, starts, strict=False)]
    return Surface(
        vertices=np.concatenate([np.empty((0, 3)), *(part.vertices for part in parts)]),
        faces=np.concatenate([np.empty((0, 3), np.int64), *faces]),
    )


def _grid(index: Index) -> Index:
    """The quads of a grid of vertices, turning from the first axis to the second."""
    corners = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return np.column_stack([corner.ravel() for corner in corners])


def _halves(quads: Index) -> Faces:
    return np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
