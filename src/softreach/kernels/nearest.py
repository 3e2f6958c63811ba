"""Distance from points to triangles."""

from __future__ import annotations

import numpy as np
from numba import njit

__all__ = ["distances_to_faces"]


@njit(cache=True, nogil=True)
def distances_to_faces(points, vertices, faces, incident, starts, near, out):
    """Distance of each point to the nearest triangle around some vertices near it.

    Triangles without area count as segments or points.

    Args:
        points: Points, shape (n, 3).
        vertices: Corners, shape (v, 3).
        faces: Indices of the corners, shape (f, 3).
        incident: Triangles around vertex 0, then around vertex 1, ..., shape (3 f,).
        starts: Where each vertex's begin, shape (v + 1,).
        near: Vertices near each point, shape (n, k).
        out: Result, shape (n,).
    """
    for i in range(len(points)):
        best = np.inf
        for v in near[i]:
            for e in range(starts[v], starts[v + 1]):
                a, b, c = faces[incident[e]]
                best = min(best, squared_distance(points[i], vertices[a], vertices[b], vertices[c]))
        out[i] = np.sqrt(best)


@njit(cache=True, nogil=True)
def squared_distance(p, a, b, c):
    """Squared distance of p to triangle abc: to its plane if p lies above it, else to its edges."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    wx, wy, wz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    uu, uv, vv = (
        ux * ux + uy * uy + uz * uz,
        ux * vx + uy * vy + uz * vz,
        vx * vx + vy * vy + vz * vz,
    )
    uw, vw = ux * wx + uy * wy + uz * wz, vx * wx + vy * wy + vz * wz
    scale = uu * vv - uv * uv
    s, t = vv * uw - uv * vw, uu * vw - uv * uw
    if scale > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= scale:
        s, t = s / scale, t / scale
        dx, dy, dz = wx - s * ux - t * vx, wy - s * uy - t * vy, wz - s * uz - t * vz
        return dx * dx + dy * dy + dz * dz
    return min(segment(p, a, b), segment(p, b, c), segment(p, c, a))


@njit(cache=True, nogil=True)
def segment(p, a, b):
    """Squared distance of p to segment ab."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    wx, wy, wz = p[0] - a[0], p[1] - a[1], p[2] - a[2]
    square = ux * ux + uy * uy + uz * uz
    t = 0.0
    if square > 0.0:
        t = min(max((ux * wx + uy * wy + uz * wz) / square, 0.0), 1.0)
    dx, dy, dz = wx - t * ux, wy - t * uy, wz - t * uz
    return dx * dx + dy * dy + dz * dz
