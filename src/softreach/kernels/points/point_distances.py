"""Distances of points: from triangles, and of a lattice from the nearest of many."""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import kernel, strict
from softreach.kernels.strict_vector import dot, minus, row, times

__all__ = ["claim_corners", "distances_to_faces", "nearest_faces"]


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


@kernel
def claim_corners(points, number, steps, closest, owner):
    """Let each point claim the corners of its cube that none before it is as close to.

    Args:
        points: In cells from the first center, within the lattice, shape (n, 3).
        number: Number to write where a point is closest, shape (n,).
        steps: From a center to the next along each axis in the flat arrays, shape (3,).
        closest: Distance in cells below which a claim counts, lowered to the closest, flat.
        owner: Filled with the number of the closest, flat.
    """
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        i, j, k = np.int64(x), np.int64(y), np.int64(z)
        for corner in range(8):
            a, b, c = i + (corner >> 2), j + (corner >> 1 & 1), k + (corner & 1)
            away = math.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)
            cell = a * steps[0] + b * steps[1] + c * steps[2]
            if away < closest[cell]:
                closest[cell], owner[cell] = away, number[n]
