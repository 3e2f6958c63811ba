"""Distance from points to triangles."""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import strict
from softreach.kernels.strict_vector import dot, minus, row, times

__all__ = ["distances_to_faces"]


@strict
def distances_to_faces(points, vertices, faces, incident, starts, near, out):
    """Distance of each point to the nearest triangle around some vertices near it.

    Triangles without area count as segments or points.

    Args:
        points: Points, shape (n, 3).
        vertices: Corners, shape (v, 3).
        faces: Indices of the corners, shape (f, 3).
        incident: Triangles around vertex 0, then around vertex 1, ..., shape (3 f,).
        starts: Beginning of each vertex's, shape (v + 1,).
        near: Vertices near each point, shape (n, k).
        out: Result, shape (n,).
    """
    for i in range(len(points)):
        best, p = np.inf, row(points, i)
        for v in near[i]:
            for e in range(starts[v], starts[v + 1]):
                a, b, c = faces[incident[e]]
                corners = row(vertices, a), row(vertices, b), row(vertices, c)
                best = min(best, squared_distance(p, *corners))
        out[i] = np.sqrt(best)


@strict
def squared_distance(p, a, b, c):
    """Squared distance of p to triangle abc: to its plane if p lies above it, else to its edges."""
    u, v, w = minus(b, a), minus(c, a), minus(p, a)
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    scale = uu * vv - uv * uv
    s, t = vv * uw - uv * vw, uu * vw - uv * uw
    if scale > 0.0 and s >= 0.0 and t >= 0.0 and s + t <= scale:
        apart = minus(minus(w, times(s / scale, u)), times(t / scale, v))
        return dot(apart, apart)
    return min(segment(p, a, b), segment(p, b, c), segment(p, c, a))


@strict
def segment(p, a, b):
    """Squared distance of p to segment ab."""
    u, w = minus(b, a), minus(p, a)
    square = dot(u, u)
    t = 0.0
    if square > 0.0:
        t = min(max(dot(u, w) / square, 0.0), 1.0)
    apart = minus(w, times(t, u))
    return dot(apart, apart)
