"""Solids inside closed triangles: read from files, their signed distances."""

import re
from dataclasses import dataclass, field
from functools import partial
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.regions import Region
from softreach.geometry.surface import enclosed_volume
from softreach.support import arrays, parallel
from softreach.support.arguments import as_path
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput, NotPossible, check_installed, counted
from softreach.support.lazy import lazy
from softreach.support.units import as_unit

_BLOCK = 4_096  # points at once
_MOST_BYTES = 256_000_000
_FILES = (".stl", ".ply", ".obj", ".off", ".glb")
_PACKED = (b"PK\x03\x04", b"\x1f\x8b", b"7z\xbc\xaf", b"BZh", b"\xfd7zXZ")  # starts of archives
_CREASE = np.cos(np.radians(20.0))  # of normals beside an edge that is drawn
_FEW = 4  # triangles of the smallest box around some
_ENDS = np.minimum, np.maximum
_ENOUGH = 0.97  # of a distance in a field, which is exact near by
_NODES = 65  # along each edge of a field
STACK = 128  # Room of a search in a tree: twice its depth


class TriangleTree(NamedTuple):
    """Boxes around triangles, each cut in two across where its triangles lie widest apart."""

    boxes: Array  # Lower and upper corner of each [m]; children of i are 2i + 1 and 2i + 2, (n, 6)
    starts: Index  # Of the triangles in each box of the last level, shape (2^level + 1,)
    corners: Array  # Of the triangles, in this order [m], shape (f, 3, 3)
    normals: Array  # Of each face, of its edges, and of its corners by their angles, (f, 7, 3)

    def nearest(self, points: Array, enough: float = 1.0) -> tuple[Array, Array, Index]:
        """Signed distances of points (n, 3) [m], gradients (n, 3), and the nearest triangles.

        With `enough` below 1 distances may be too large, but not so if they are multiplied by it.
        """
        from softreach.kernels.room.triangles import nearest_triangles

        distance, gradient = np.empty(len(points)), np.empty((len(points), 3))
        face, table = np.empty(len(points), np.int64), (*self,)
        points = np.require(points, requirements="CW")  # types that are compiled already

        def fill(b: slice) -> None:
            room = np.empty(STACK, np.int64)
            nearest_triangles(points[b], table, room, enough, distance[b], gradient[b], face[b])

        parallel.run(partial(fill, block) for block in parallel.blocks(len(points), _BLOCK))
        return distance, gradient, face


class DistanceField(NamedTuple):
    """Distances from a mesh at the nodes of a grid, and a triangle near to each."""

    grid: Array  # First node and spacing [m], shape (4,)
    shape: Index  # Nodes along each axis, shape (3,)
    distance: Array  # Signed [m], shape (node,)
    face: Index  # Numbers of triangles in the tree, shape (node,)


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
    is_turned: bool = field(init=False)
    """True if all triangles were given facing in."""

    def __post_init__(self) -> None:
        vertices = arrays.as_points("vertices", self.vertices)
        faces = arrays.as_faces("faces", self.faces, len(vertices))
        _check_closed(faces, self.source or "the mesh")
        volume = enclosed_volume(vertices, faces)
        if not abs(volume) > 0.0:
            raise NotPossible(f"{self.source or 'the mesh'} encloses no volume")
        object.__setattr__(self, "is_turned", volume < 0.0)
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
        return self.nearest(arrays.as_points("points", points))[0]

    def nearest(self, points: Array) -> tuple[Array, Array]:
        return self.tree.nearest(points)[:2]

    @lazy
    def tree(self) -> TriangleTree:
        """Boxes around its triangles, by which the nearest one is found."""
        corners, count = self._corners, len(self.faces)
        order, middles, boxes = np.arange(count), corners.mean(axis=1), list[Array]()
        depth = max(0, int(np.ceil(np.log2(count / _FEW))))
        for level in range(depth + 1):
            starts = np.arange(2**level + 1) * count // 2**level
            own = corners[order]
            ends = own.min(axis=1), own.max(axis=1)
            low, high = (f.reduceat(x, starts[:-1]) for f, x in zip(_ENDS, ends, strict=True))
            boxes.append(np.concatenate([low, high], axis=1))
            block = np.repeat(np.arange(2**level), np.diff(starts))
            along = middles[order, (high - low).argmax(axis=1)[block]]
            order = order[np.lexsort((along, block))]  # within each box
        starts = np.arange(2**depth + 1) * count // 2**depth
        return TriangleTree(np.concatenate(boxes), starts, corners[order], self._normals[order])

    def wireframe(self, around: Array) -> list[Array]:
        edges, beside = self._edges[:2]
        first, second = self._face_normals[beside].swapaxes(0, 1)
        sharp = (first * second).sum(axis=1) < _CREASE
        return list(self.vertices[edges[sharp]])

    @lazy
    def _corners(self) -> Array:
        return self.vertices[self.faces]

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


def field_around(mesh: Mesh, center: Array, half: float, nodes: int = _NODES) -> DistanceField:
    """Distances at so many nodes along each edge of a cube around a center [m], shape (3,)."""
    spacing = 2.0 * half / (nodes - 1)
    steps = np.array(list(np.ndindex(nodes, nodes, nodes)), float)
    low = np.asarray(center, float) - half
    distance, _, face = mesh.tree.nearest(low + spacing * steps, _ENOUGH)
    return DistanceField(np.append(low, spacing), np.full(3, nodes), distance, face)


@dataclass(frozen=True)
class MeshFile(Region):
    """Solid inside the closed triangles of a file, which is read when it is first asked for."""

    path: str | PathLike[str]
    """An STL, PLY, OBJ, OFF or GLB; see `Mesh.load`."""
    unit: str | None = None
    """Unit of length of the file; None for that which it names itself."""

    convex: ClassVar[bool] = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "path", str(Path(as_path("path", self.path)).absolute()))

    @lazy
    def mesh(self) -> Mesh:
        """Its triangles.

        Raises:
            InvalidInput: As `Mesh.load`.
            NotPossible: A mesh with holes, or one that is inside out.
        """
        mesh = Mesh.load(self.path, unit=self.unit)
        if mesh.is_turned:
            raise NotPossible(
                f"the triangles of {self.path} face in: turn them to face out of what is solid; "
                "for an arm inside of a mesh, say inside = true"
            )
        return mesh

    @property
    def volume(self) -> float:
        return self.mesh.volume

    @property
    def bounds(self) -> Array:
        return self.mesh.bounds

    def distance(self, points: ArrayLike) -> Array:
        return self.mesh.distance(points)

    def nearest(self, points: Array) -> tuple[Array, Array]:
        return self.mesh.nearest(points)

    def wireframe(self, around: Array) -> list[Array]:
        return self.mesh.wireframe(around)


def _unit_of(name: str) -> str | None:
    """The unit that the beginning of the file of a mesh states, if it does."""
    path = Path(name)
    if not path.is_file():
        raise InvalidInput("path", repr(name), "a file that exists")
    if path.suffix.lower() not in _FILES:
        raise InvalidInput("path", repr(name), f"a mesh of {', '.join(_FILES)}")
    with path.open("rb") as file:
        head, is_scene = file.read(65_536), path.suffix.lower() == ".glb"
    if head.startswith(_PACKED):
        raise InvalidInput("path", repr(name), "a mesh as it is, not an archive: unpack it first")
    size = int.from_bytes(head[12:16], "little") * 100 if is_scene else path.stat().st_size
    if size > _MOST_BYTES:  # the list of parts of a scene, each of which may be a copy
        raise InvalidInput("path", repr(name), f"a mesh of at most {_MOST_BYTES / 1e6:g} MB")
    said = re.search(rb"(?:lengths in|comment units:) (mm|cm|m|in)\b", head)
    return said[1].decode() if said else "m" if is_scene else None


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
