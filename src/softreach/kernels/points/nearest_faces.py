"""The triangle of a surface that is nearest to each point, exactly."""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import strict
from softreach.kernels.points.point_distances import squared_distance
from softreach.kernels.strict_vector import dot, minus, row

__all__ = ["nearest_faces"]


@strict
def nearest_faces(points, vertices, faces, centers, radii, face, out):
    """Nearest triangle of each point and the distance to it; spheres around triangles cull.

    Args:
        points: Points, shape (n, 3).
        vertices: Corners, shape (v, 3).
        faces: Indices of the corners, shape (f, 3).
        centers: Centers of spheres around the triangles, shape (f, 3).
        radii: Radii of these, shape (f,).
        face: Result, index of the triangle, shape (n,).
        out: Result, distance, shape (n,).
    """
    for i in range(len(points)):
        best, near, p = np.inf, np.inf, row(points, i)
        face[i] = 0
        for f in range(len(faces)):
            apart = minus(p, row(centers, f))
            limit = near + radii[f]
            if dot(apart, apart) >= limit * limit:
                continue
            a, b, c = faces[f]
            square = squared_distance(p, row(vertices, a), row(vertices, b), row(vertices, c))
            if square < best:
                best, near, face[i] = square, np.sqrt(square), f
        out[i] = near
