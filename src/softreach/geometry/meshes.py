"""Solids inside closed triangles: read from files, their signed distances."""

import re
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.geometry.regions import Region
from softreach.geometry.surface import enclosed_volume
from softreach.kernels.room.triangles import listed_near, nearest_triangles
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
_FEW, _DEEPEST = 32, 9  # triangles of a cube of a tree that is not cut, and how often one is
FAR = 0.1  # of its distance, up to which half a diagonal is short: such a cube lists no triangles


class TriangleTree(NamedTuple):
    """Cubes around a place, each with its distance from a mesh and the triangles near it."""

    root: Array  # Center and half edge of the largest [m], shape (4,)
    children: Index  # Of each node the first of eight, -1 for a leaf, shape (n,)
    middle: Array  # Signed distance of the center of each [m], shape (n,)
    starts: Index  # Of the triangles of each in the list, shape (n + 1,)
    listed: Index  # Those of all leaves that are not far from the mesh
    corners: Array  # Of the mesh [m], shape (f, 3, 3)
    spheres: Array  # Around these: center and radius [m], shape (f, 4)
    normals: Array  # Of each face, of its edges, and of its corners by their angles, (f, 7, 3)


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
        return self.nearest(arrays.as_points("points", points))[0]

    def nearest(self, points: Array) -> tuple[Array, Array]:
        distance, gradient = np.empty(len(points)), np.empty((len(points), 3))
        table = np.arange(len(self.faces)), self._corners, self._spheres, self._normals
        parallel.run(
            partial(nearest_triangles, points[block], *table, distance[block], gradient[block])
            for block in parallel.blocks(len(points), _BLOCK)
        )
        return distance, gradient

    def tree(self, center: Array, half: float) -> TriangleTree:
        """Cubes within the one around a center (3,) with half an edge [m], until few are near."""
        children, middles, lists = [-1], list[Array](), dict[int, Array]()
        table = self._corners, self._spheres, self._normals
        number, places = np.zeros(1, np.int64), np.asarray(center, float)[None]
        parent, starts = np.zeros(1, np.int64), np.array([0, len(self.faces)])
        listed = np.arange(len(self.faces), dtype=np.int32)
        for depth in range(_DEEPEST + 1):
            reach = half * 0.5**depth * np.sqrt(3.0)
            middle, count = np.empty(len(places)), np.empty(len(places), np.int64)
            near = places, parent, starts, listed, 2.0 * reach, *table, middle, count
            listed_near(*near, kept := np.empty(0, np.int32))
            kept = np.empty(int(count.sum()), np.int32)
            if len(kept):
                listed_near(*near, kept)
            middles.append(middle)
            starts, listed = np.append(0, np.cumsum(count)), kept
            is_far = reach <= FAR * np.abs(middle)
            is_leaf = is_far | (count <= _FEW) | (depth == _DEEPEST)
            for k in np.flatnonzero(is_leaf & ~is_far):
                lists[number[k]] = listed[starts[k] : starts[k + 1]]
            parent = np.flatnonzero(~is_leaf)
            if not len(parent):
                break
            first = len(children) + 8 * np.arange(len(parent))
            children += [-1] * (8 * len(parent))
            for node, child in zip(number[parent], first, strict=True):
                children[node] = int(child)
            corner = 2.0 * np.array(list(np.ndindex(2, 2, 2))) - 1.0
            number = (first[:, None] + np.arange(8)).ravel()
            places = (places[parent, None] + half * 0.5 ** (depth + 1) * corner).reshape(-1, 3)
            parent = np.repeat(parent, 8)
        sizes = np.zeros(len(children), np.int64)
        sizes[[*lists]] = [len(each) for each in lists.values()]
        every = np.concatenate([np.empty(0, np.int32), *(lists[node] for node in sorted(lists))])
        ends, root = np.append(0, np.cumsum(sizes)), np.append(center, half)
        return TriangleTree(root, np.array(children), np.concatenate(middles), ends, every, *table)

    def wireframe(self, around: Array) -> list[Array]:
        edges, beside = self._edges[:2]
        first, second = self._face_normals[beside].swapaxes(0, 1)
        sharp = (first * second).sum(axis=1) < _CREASE
        return list(self.vertices[edges[sharp]])

    @lazy
    def _corners(self) -> Array:
        return self.vertices[self.faces]

    @lazy
    def _spheres(self) -> Array:
        center = self._corners.mean(axis=1)
        radius = np.linalg.norm(self._corners - center[:, None], axis=2).max(axis=1)
        return np.column_stack([center, radius])

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
