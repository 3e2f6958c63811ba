"""Regions of space, in the world: boxes, spheres, half-spaces and closed meshes."""

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.surface import enclosed_volume
from softreach.kernels.points.triangles import nearest_faces
from softreach.support import arrays, parallel
from softreach.support.arguments import POSITIVE, as_integer, as_number, as_path
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput, NotPossible, check_installed, counted
from softreach.support.lazy import lazy
from softreach.support.units import as_unit

Triple = tuple[float, float, float]
Ends = tuple[Array, Array]  # Least and largest of something

_STEPS = np.array([0.8191725133961645, 0.6710436067037893, 0.5497004779019703])
"""1/g, 1/g² and 1/g³ with g⁴ = g + 1: steps of a sequence that fills the cube evenly."""
_BLOCK = 65_536  # points at once
_MOST_PLACES = 1_000_000
_MOST_BYTES = 256_000_000
_FILES = (".stl", ".ply", ".obj", ".off", ".glb")
_EMPTIEST = 1e-4  # share of its bounding box that a region fills at least, to draw places from it
_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 49)
_CREASE = np.cos(np.radians(20.0))  # of normals beside an edge that is drawn


class Region(ABC):
    """A part of space; lengths in m, in the world."""

    convex: ClassVar[bool] = True
    """True if it holds all between any two of its points."""

    @abstractmethod
    def distance(self, points: ArrayLike) -> Array:
        """Distance of points (n, 3) to its boundary [m], negative inside, shape (n,)."""

    @property
    @abstractmethod
    def volume(self) -> float:
        """Volume [m³]; infinite for a half-space."""

    @property
    @abstractmethod
    def bounds(self) -> Array:
        """Lower and upper corner of the box around it [m], shape (2, 3)."""

    @abstractmethod
    def wireframe(self, around: Array) -> list[Array]:
        """Lines to draw it by [m], each of shape (k, 3).

        Args:
            around: Lower and upper corner of what else is drawn [m], shape (2, 3).
        """

    def places(self, n: int) -> Array:
        """The first n places inside of a sequence that fills space evenly [m], shape (n, 3).

        Args:
            n: Number of places; the same n gives the same places.

        Raises:
            InvalidInput: The region has no end.
            NotPossible: It fills next to nothing of the box around it.
        """
        n, (low, high) = as_integer("n", n, 1, _MOST_PLACES), self.bounds
        if not np.isfinite(self.volume):
            raise InvalidInput("region", self, "bounded: a half-space has no end")
        kept, drawn = np.empty((0, 3)), 0
        while len(kept) < n:
            numbers = np.arange(drawn + 1, drawn + max(n, 256) + 1)[:, None]
            points = low + (0.5 + numbers * _STEPS) % 1.0 * (high - low)
            kept = np.concatenate([kept, points[self.distance(points) <= 0.0]])
            drawn += len(points)
            if len(kept) < _EMPTIEST * drawn and drawn > 1.0 / _EMPTIEST:
                raise NotPossible(f"{self} is too thin to draw places from it")
        return kept[:n]

    def section_distances(self, center: Array, tangent: Array, radius: Array) -> Ends:
        """Least and largest distance of the points of circular sections, negative inside.

        Exact for half-spaces and for spheres; of boxes the largest is exact by faces. Otherwise a
        ball takes the place of the section, so that the range is never too narrow.

        Args:
            center: Centers [m], shape (..., 3).
            tangent: Unit vectors across the sections, d3 [-], shape (..., 3).
            radius: Radii [m], shape (...).
        """
        distance = self._distances(center)
        return distance - radius, distance + radius

    def _distances(self, points: Array) -> Array:
        return self.distance(points.reshape(-1, 3)).reshape(points.shape[:-1])


@dataclass(frozen=True)
class Box(Region):
    """A box along the axes of the world.

    Raises:
        InvalidInput: No low < high along each axis.
    """

    low: Triple
    """Lower corner [m]."""
    high: Triple
    """Upper corner [m]."""

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            object.__setattr__(self, name, _triple(name, getattr(self, name)))
        for axis, start, end in zip("xyz", self.low, self.high, strict=True):
            if not start < end:
                allowed = f"below high = {end:g} m, so that the box is not empty"
                raise InvalidInput(f"low along {axis}", start, allowed)

    @property
    def volume(self) -> float:
        return float(np.prod(np.subtract(self.high, self.low)))

    @property
    def bounds(self) -> Array:
        return np.array([self.low, self.high])

    def distance(self, points: ArrayLike) -> Array:
        x = arrays.as_points("points", points)
        beyond = np.maximum(self.low - x, x - self.high)
        return np.linalg.norm(np.maximum(beyond, 0.0), axis=1) + np.minimum(beyond.max(axis=1), 0.0)

    def section_distances(self, center: Array, tangent: Array, radius: Array) -> Ends:
        reach = radius[..., None] * np.sqrt(np.maximum(1.0 - tangent**2, 0.0))
        beyond = np.maximum(self.low - center, center - self.high)
        ball = self._distances(center) - radius
        return np.maximum(ball, (beyond - reach).max(axis=-1)), (beyond + reach).max(axis=-1)

    def wireframe(self, around: Array) -> list[Array]:
        corners = np.array(list(np.ndindex(2, 2, 2)))
        ends = [(a, b) for a in corners for b in corners if (b - a).sum() == 1 and (b >= a).all()]
        return [self.bounds[np.stack(pair), range(3)] for pair in ends]


@dataclass(frozen=True)
class Sphere(Region):
    """A ball.

    Raises:
        InvalidInput: No finite center, or no radius > 0.
    """

    center: Triple
    """Middle of the sphere [m]."""
    radius: float
    """Radius of the sphere [m]."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _triple("center", self.center))
        allowed = POSITIVE._replace(unit="m")
        object.__setattr__(self, "radius", as_number("radius", self.radius, allowed))

    @property
    def volume(self) -> float:
        return 4.0 / 3.0 * np.pi * self.radius**3

    @property
    def bounds(self) -> Array:
        return np.array(self.center) + self.radius * np.array([[-1.0], [1.0]])

    def distance(self, points: ArrayLike) -> Array:
        apart = arrays.as_points("points", points) - self.center
        return np.linalg.norm(apart, axis=1) - self.radius

    def section_distances(self, center: Array, tangent: Array, radius: Array) -> Ends:
        apart = center - self.center
        height = (apart * tangent).sum(axis=-1)
        across = np.sqrt(np.maximum((apart**2).sum(axis=-1) - height**2, 0.0))
        least, most = np.maximum(across - radius, 0.0), across + radius
        return np.hypot(height, least) - self.radius, np.hypot(height, most) - self.radius

    def wireframe(self, around: Array) -> list[Array]:
        flat = np.stack([np.cos(_CIRCLE), np.sin(_CIRCLE), 0.0 * _CIRCLE], axis=1)
        return [self.center + self.radius * np.roll(flat, k, axis=1) for k in range(3)]


@dataclass(frozen=True)
class HalfSpace(Region):
    """Everything behind a plane: (x - point) · normal <= 0.

    Raises:
        InvalidInput: No finite point, or a normal without length.
    """

    point: Triple
    """A point of the plane [m]."""
    normal: Triple
    """Normal that points out of the half-space [-], of any length."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "point", _triple("point", self.point))
        (normal,) = arrays.as_directions("normal", self.normal, 1).tolist()
        object.__setattr__(self, "normal", tuple(normal))

    @property
    def volume(self) -> float:
        return np.inf

    @property
    def bounds(self) -> Array:
        return np.array([[-np.inf] * 3, [np.inf] * 3])

    def distance(self, points: ArrayLike) -> Array:
        return (arrays.as_points("points", points) - self.point) @ np.array(self.normal)

    def section_distances(self, center: Array, tangent: Array, radius: Array) -> Ends:
        distance, along = self._distances(center), tangent @ np.array(self.normal)
        reach = radius * np.sqrt(np.maximum(1.0 - along**2, 0.0))
        return distance - reach, distance + reach

    def wireframe(self, around: Array) -> list[Array]:
        """A square of the plane, about as large as what else is drawn [m]."""
        middle, half = around.mean(axis=0), 0.5 * float(np.ptp(around, axis=0).max())
        normal = np.array(self.normal)
        foot = middle - self.distance(middle[None]) * normal
        first = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
        first /= np.linalg.norm(first)
        second = np.cross(normal, first)
        corners = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1)], float)
        return [foot + half * corners @ np.stack([first, second])]


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Region):
    """Solid inside closed triangles.

    Raises:
        InvalidInput: Vertices or triangles that are none.
        NotPossible: Triangles that leave an edge open, share one by more than two, or do not face
            the same way; or nothing inside.
    """

    convex: ClassVar[bool] = False

    vertices: Array
    """Corners [m], shape (v, 3)."""
    faces: Index
    """Indices of the corners, shape (f, 3); they are turned so that all face out."""
    source: str = ""
    """File that it was read from; empty for none."""
    unit: str = "m"
    """Unit of length of that file."""

    def __post_init__(self) -> None:
        vertices = arrays.as_points("vertices", self.vertices)
        faces = arrays.as_faces("faces", self.faces, len(vertices))
        _check_closed(faces, self.source or "the mesh")
        volume = enclosed_volume(vertices, faces)
        if not abs(volume) > 0.0:
            raise NotPossible(f"{self.source or 'the mesh'} encloses no volume")
        faces = faces if volume > 0.0 else faces[:, ::-1]
        object.__setattr__(self, "vertices", arrays.read_only(vertices.copy()))
        object.__setattr__(self, "faces", arrays.read_only(np.ascontiguousarray(faces, np.int64)))  # pyright: ignore[reportArgumentType]

    @classmethod
    def load(cls, path: str | PathLike[str], *, unit: str | None = None) -> Self:
        """The mesh of an STL, PLY, OBJ, OFF or GLB, whose y points up and becomes z.

        Args:
            path: The file.
            unit: Unit of length that the file counts in: "m", "cm", "mm" or "in". None for that
                which softreach wrote into it, and m for a GLB.

        Raises:
            InvalidInput: No such file, too large a one, no triangles in it, or no unit where the
                file says none.
            NotPossible: A mesh with holes.
            MissingExtra: trimesh is not installed.
        """
        name = as_path("path", path)
        stated = _unit_of(name)
        if unit is None and stated is None:
            allowed = "m, cm or mm: the file of the mesh does not name its unit"
            raise InvalidInput("unit", None, allowed)
        size = as_unit(stated if unit is None else unit)
        if stated not in (None, size.name):
            raise InvalidInput("unit", size.name, f"{stated}, as {name} says")
        check_installed("trimesh")
        try:
            mesh: Any = import_module("trimesh").load(name, force="scene").to_mesh()
            mesh.merge_vertices()
            import_module("trimesh.repair").fix_winding(mesh)
            vertices, faces = np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)
        except Exception as error:  # of readers of many formats
            raise InvalidInput("path", repr(name), f"a mesh that can be read: {error}") from None
        if name.lower().endswith(".glb"):  # whose y points up
            vertices = vertices[:, [0, 2, 1]] * (1.0, -1.0, 1.0)
        return cls(vertices * size.size, faces, name, size.name)

    def __repr__(self) -> str:
        name = f" of {self.source}" if self.source else ""
        return f"Mesh{name}: {counted(len(self.faces), 'triangle')}, {self.volume:.4g} m³"

    @lazy
    def volume(self) -> float:  # pyright: ignore[reportIncompatibleMethodOverride]
        return enclosed_volume(self.vertices, self.faces)

    @property
    def bounds(self) -> Array:
        return np.stack([self.vertices.min(axis=0), self.vertices.max(axis=0)])

    def distance(self, points: ArrayLike) -> Array:
        """Distance of points (n, 3) to the nearest triangle [m], negative inside, shape (n,).

        The sign is that of the normal of the nearest face, edge or corner, weighted by angles.
        """
        points = arrays.as_points("points", points)
        out, face = np.empty(len(points)), np.empty(len(points), np.int64)
        table = (self.vertices, self.faces, *self._spheres)
        blocks = parallel.blocks(len(points), _BLOCK // 16)
        parallel.run(partial(nearest_faces, points[b], *table, face[b], out[b]) for b in blocks)
        for block in parallel.blocks(len(points), _BLOCK):
            is_inside = self._outside(points[block], face[block]) < 0.0
            out[block] = np.where(is_inside, -out[block], out[block])
        return out

    def wireframe(self, around: Array) -> list[Array]:
        edges, beside = self._edges[:2]
        first, second = self._face_normals[beside].swapaxes(0, 1)
        sharp = (first * second).sum(axis=1) < _CREASE
        return list(self.vertices[edges[sharp]])

    @lazy
    def _corners(self) -> Array:
        return self.vertices[self.faces]

    @lazy
    def _spheres(self) -> tuple[Array, Array]:
        center = self._corners.mean(axis=1)
        radius = np.linalg.norm(self._corners - center[:, None], axis=2).max(axis=1)
        return np.ascontiguousarray(center), radius

    @lazy
    def _face_normals(self) -> Array:
        a, b, c = self._corners.swapaxes(0, 1)
        normal = np.cross(b - a, c - a)
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        return np.divide(normal, size, out=np.zeros_like(normal), where=size > 0.0)

    @lazy
    def _edges(self) -> tuple[Index, Index, Index]:
        """Edges as vertices (e, 2), the faces beside each (e, 2), and edges of each face (f, 3)."""
        pairs = np.sort(np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2), axis=2)
        edges, number = np.unique(pairs.reshape(-1, 2), axis=0, return_inverse=True)
        number = number.ravel()
        beside = np.argsort(number, kind="stable").reshape(-1, 2) // 3
        return edges, beside, number.reshape(-1, 3)

    @lazy
    def _normals(self) -> Array:
        """Of each face, of its edges, and of its corners by their angles, shape (f, 7, 3)."""
        at_vertices = np.zeros_like(self.vertices)
        for k in range(3):
            here, after, before = (self._corners[:, (k + j) % 3] for j in range(3))
            u, v = after - here, before - here
            angle = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1))
            np.add.at(at_vertices, self.faces[:, k], angle[:, None] * self._face_normals)
        _, beside, edges = self._edges
        at_edges = self._face_normals[beside].sum(axis=1)[edges]
        own = self._face_normals[:, None]
        return np.concatenate([own, at_edges, at_vertices[self.faces]], axis=1)

    def _outside(self, points: Array, face: Index) -> Array:
        """Heights of points over what of a triangle is nearest: the face, an edge or a corner."""
        normal, corners = self._face_normals[face], self._corners[face]
        along, away = np.roll(corners, -1, axis=1) - corners, points[:, None] - corners
        height = (away[:, 0] * normal).sum(axis=1, keepdims=True)
        foot = points - height * normal
        turns = (np.cross(along, foot[:, None] - corners) * normal[:, None]).sum(axis=2)
        square = (along**2).sum(axis=2)
        share = ((away * along).sum(axis=2) / np.where(square > 0.0, square, 1.0)).clip(0.0, 1.0)
        places = corners + share[..., None] * along
        edge = np.linalg.norm(points[:, None] - places, axis=2).argmin(axis=1)
        row = np.arange(len(points))
        end = share[row, edge]
        feature = np.where(end <= 0.0, 4 + edge, np.where(end >= 1.0, 4 + (edge + 1) % 3, 1 + edge))
        is_inside = (turns >= 0.0).all(axis=1) & normal.any(axis=1)
        foot = np.where(is_inside[:, None], foot, places[row, edge])
        normal = self._normals[face, np.where(is_inside, 0, feature)]
        return ((points - foot) * normal).sum(axis=1)


def _unit_of(name: str) -> str | None:
    """The unit that the beginning of the file of a mesh states, if it does."""
    path = Path(name)
    if not path.is_file():
        raise InvalidInput("path", repr(name), "a file that exists")
    if path.suffix.lower() not in _FILES:
        raise InvalidInput("path", repr(name), f"a mesh of {', '.join(_FILES)}")
    with path.open("rb") as file:
        head, is_scene = file.read(65_536), path.suffix.lower() == ".glb"
    size = int.from_bytes(head[12:16], "little") * 100 if is_scene else path.stat().st_size
    if size > _MOST_BYTES:  # the list of parts of a scene, each of which may be a copy
        raise InvalidInput("path", repr(name), f"a mesh of at most {_MOST_BYTES / 1e6:g} MB")
    said = re.search(rb"(?:lengths in|comment units:) (mm|cm|m|in)\b", head)
    return said[1].decode() if said else "m" if is_scene else None


def _triple(name: str, value: object) -> Triple:
    allowed = "three finite numbers"
    numbers = arrays.check_finite(name, arrays.as_floats(name, value, allowed))
    if numbers.shape != (3,):
        raise InvalidInput(name, value, allowed)
    return tuple(numbers.tolist())


def _check_closed(faces: Any, name: str) -> None:
    if not len(faces):
        raise NotPossible(f"{name} has no triangles")
    ways = np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2)
    _, counts = np.unique(np.sort(ways, axis=1), axis=0, return_counts=True)
    if number := int((counts == 1).sum()):
        raise NotPossible(f"{name} has holes: close its {counted(number, 'open edge')}")
    if number := int((counts != 2).sum()):
        many = f"{counted(number, 'edge')} of more than two triangles"
        raise NotPossible(f"the surface of {name} branches: it has {many}")
    if len(np.unique(ways, axis=0)) < len(ways):
        raise NotPossible(f"some triangles of {name} face out and others in: make all face out")
