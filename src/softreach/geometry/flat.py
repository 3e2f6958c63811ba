"""Points in one plane: the plane, convex hulls, α-shapes and areas inside of closed curves."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.support.arrays import Array, Faces, Index, Mask, Points


class Plane(NamedTuple):
    """A plane in space with axes of its own: x and y in it, z its normal."""

    origin: Array  # [m], (3,)
    rotation: Array  # its axes as rows, a rotation, (3, 3)
    sides: Array  # extents of the points along its axes [m], (3,)

    def coordinates(self, points: Points) -> Points:
        """Points [m] in these axes, shape (n, 3)."""
        return (points - self.origin) @ self.rotation.T

    def places(self, coordinates: Points) -> Points:
        """The points back in space [m], shape (n, 3)."""
        return self.origin + coordinates @ self.rotation


def plane_of(points: Points, thickness: float) -> Plane | None:
    """The plane that points (n, 3) lie in to a thickness [m], its axes their principal ones."""
    origin = points.mean(axis=0)
    rotation = np.linalg.svd(points - origin, full_matrices=len(points) < 3)[2]
    rotation[2] *= np.sign(np.linalg.det(rotation))
    sides = np.ptp((points - origin) @ rotation.T, axis=0)
    return Plane(origin, rotation, sides) if sides[2] <= thickness else None


def convex_edges(points: Points) -> Index:
    """Edges of the convex hull of points in the plane z = 0, counterclockwise, shape (e, 2)."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        corners = ConvexHull(points[:, :2]).vertices
    except (QhullError, ValueError):  # on one line, or too few
        return np.empty((0, 2), np.intp)
    return np.stack([corners, np.roll(corners, -1)], axis=1).astype(np.intp)


def enclosed_area(points: Points, edges: Faces) -> float:
    """Area inside of closed curves in the plane z = 0 [m²], counterclockwise ones above 0."""
    if not len(edges):
        return 0.0
    a, b = np.moveaxis((points - points.mean(axis=0))[edges], 1, 0)
    return 0.5 * float((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]).sum())


def are_inside(points: Points, edges: Array) -> Mask:
    """Mask of points inside of closed curves in the plane z = 0, of edges (e, 2, 3)."""
    odd = np.zeros(len(points), bool)
    for (x, y, _), (u, v, _) in edges:
        if y != v:
            crossed = (points[:, 1] < y) != (points[:, 1] < v)
            odd[crossed] ^= points[crossed, 0] < x + (points[crossed, 1] - y) / (v - y) * (u - x)
    return odd


def alpha_area(points: Points, alpha: float) -> float:
    """Area [m²] of the α-shape, of a radius α [m], of points in the plane z = 0, by triangles."""
    from scipy.spatial import Delaunay, QhullError

    try:
        triangles = Delaunay(points[:, :2]).simplices
    except (QhullError, ValueError):  # on one line, or too few
        return 0.0
    a, b, c = np.moveaxis(points[triangles][..., :2], 1, 0)
    (x, y), (u, v) = (b - a).T, (c - a).T
    area = 0.5 * np.abs(x * v - y * u)
    sides = np.prod([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    return float(area[sides < 4.0 * alpha * area].sum())
