"""Triangulated surfaces: area, volume inside, distance to them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arrays import Faces, Points
from softreach.geometry.delaunay import unit_scale
from softreach.kernels.nearest import distances_to_faces

if TYPE_CHECKING:
    from scipy.spatial import KDTree

__all__ = ["Surface", "SurfaceMesh", "compact_surface", "enclosed_volume", "surface_area"]

Array = NDArray[np.float64]

_NEIGHBORS = 16  # with 4, distances to long triangles came out up to a cell too large


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
        """Distance of points to the nearest triangle around their 16 nearest vertices [m], (n,)."""
        if not len(self.faces):
            return np.full(len(points), np.inf)
        count = min(_NEIGHBORS, len(self.vertices))
        near = self._tree.query(points, count, workers=-1)[1].reshape(len(points), count)
        out = np.empty(len(points))
        distances_to_faces(points, self.vertices, self.faces, *self._incidence, near, out)
        return out

    def __repr__(self) -> str:
        corners, triangles = len(self.vertices), len(self.faces)
        return f"Surface: {triangles:,} triangles, {corners:,} vertices, area {self.area:.6g} m²"

    @cached_property
    def _tree(self) -> KDTree:
        from scipy.spatial import KDTree

        return KDTree(self.vertices)

    @cached_property
    def _incidence(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Faces around each vertex, one after the other, and where each vertex's begin."""
        corners = self.faces.ravel()
        ends = np.cumsum(np.bincount(corners, minlength=len(self.vertices)))
        return np.argsort(corners, kind="stable") // 3, np.concatenate([[0], ends])


def compact_surface(points: Points, faces: Faces) -> tuple[Points, Faces]:
    """The points that faces use, and the faces in their numbering."""
    used = np.zeros(len(points), bool)
    used[faces] = True
    number = np.cumsum(used, dtype=np.int32) - np.int32(1)
    return points[used], number[faces]


def enclosed_volume(vertices: Points, faces: Faces) -> float:
    """Volume inside an oriented closed surface [m³] by the divergence theorem."""
    if len(faces) == 0:
        return 0.0
    scaled, exponent = unit_scale(vertices)
    a, b, c = np.moveaxis((scaled - scaled.mean(axis=0))[faces], 1, 0)
    return float(np.ldexp(np.einsum("fi,fi->", a, np.cross(b, c)) / 6.0, 3 * exponent))


def surface_area(vertices: Points, faces: Faces) -> float:
    """Area of a surface [m²]."""
    scaled, exponent = unit_scale(vertices)  # squares of squares overflow early
    a, b, c = np.moveaxis(scaled[faces], 1, 0)
    twice = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    return float(np.ldexp(twice / 2.0, 2 * exponent))
