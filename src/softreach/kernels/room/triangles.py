"""Signed distances of closed triangles, by a tree of cubes that list the triangles near them.

Of a cube around c with the half diagonal ρ only triangles within |d(c)| + 2ρ of c can be the
nearest of a point in it, as distances change no faster than places. A cube is cut into eight until
few are left, or until d(c) alone says enough: |d(x) - d(c)| <= |x - c|.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import dot, minus, plus, row, times

FACE = 0  # Parts of a triangle: itself, its edges from corners 0, 1, 2 on, its corners


@inline
def nearest_on_triangle(x, a, b, c):
    """The point of a triangle that is nearest to x, and the part of the triangle that it is on."""
    u, v, w = minus(b, a), minus(c, a), minus(x, a)
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    scale, s, t = uu * vv - uv * uv, vv * uw - uv * vw, uu * vw - uv * uw
    if scale > 0.0 and s > 0.0 and t > 0.0 and s + t < scale:
        return plus(a, plus(times(s / scale, u), times(t / scale, v))), FACE
    best, part = _on_edge(x, a, b, 0)
    for k in range(1, 3):
        other, its = _on_edge(x, b, c, 1) if k == 1 else _on_edge(x, c, a, 2)
        if _square(x, other) < _square(x, best):
            best, part = other, its
    return best, part


@inline
def _on_edge(x, a, b, edge):
    u = minus(b, a)
    size = dot(u, u)
    t = dot(u, minus(x, a)) / size if size > 0.0 else 0.0
    if t <= 0.0:
        return a, 4 + edge
    if t >= 1.0:
        return b, 4 + (edge + 1) % 3
    return plus(a, times(t, u)), 1 + edge


@inline
def _square(a, b):
    apart = minus(a, b)
    return dot(apart, apart)


@inline
def nearest_of(x, listed, first, last, corners, spheres, normals):
    """Signed distance of x from the nearest triangle in a list, and its gradient: four numbers.

    Corners (f, 3, 3), spheres (f, 4) around triangles as center and radius, and normals (f, 7, 3)
    of the parts of each, by which it is told what is inside.
    """
    near, square = np.inf, np.inf
    face, part, foot = listed[first], FACE, x
    for k in range(first, last):
        f = listed[k]
        apart = minus(x, (spheres[f, 0], spheres[f, 1], spheres[f, 2]))
        limit = near + spheres[f, 3]
        if dot(apart, apart) >= limit * limit:
            continue
        a, b, c = row(corners[f], 0), row(corners[f], 1), row(corners[f], 2)
        place, its = nearest_on_triangle(x, a, b, c)
        if _square(x, place) < square:
            square, face, part, foot = _square(x, place), f, its, place
            near = math.sqrt(square)
    away, normal = minus(x, foot), row(normals[face], part)
    sign = -1.0 if dot(away, normal) < 0.0 else 1.0
    if near > 0.0:
        normal = times(sign / near, away)
    else:
        normal = times(1.0 / max(math.sqrt(dot(normal, normal)), 1e-300), normal)
    return sign * near, normal[0], normal[1], normal[2]


@kernel
def nearest_triangles(points, listed, corners, spheres, normals, distance, gradient):
    """Signed distances (n,) of points (n, 3) from listed triangles, and gradients (n, 3)."""
    for i in range(points.shape[0]):
        x = points[i, 0], points[i, 1], points[i, 2]
        found = nearest_of(x, listed, 0, len(listed), corners, spheres, normals)
        distance[i] = found[0]
        gradient[i, 0], gradient[i, 1], gradient[i, 2] = found[1], found[2], found[3]


@kernel
def listed_near(
    centers, parent, starts, listed, reach, corners, spheres, normals, middle, count, kept
):
    """Distances d(c) of centers (n, 3) of cubes, and the triangles within |d(c)| + reach of each.

    Candidates of cube i are those of its parent. `count` (n,) says how many there are; where `kept`
    has room for all, they are put there one after another.
    """
    room, place = len(kept), 0
    for i in range(centers.shape[0]):
        x = centers[i, 0], centers[i, 1], centers[i, 2]
        first, last = starts[parent[i]], starts[parent[i] + 1]
        if room == 0:
            middle[i] = nearest_of(x, listed, first, last, corners, spheres, normals)[0]
        count[i], limit = 0, abs(middle[i]) + reach
        for k in range(first, last):
            f = listed[k]
            apart = minus(x, (spheres[f, 0], spheres[f, 1], spheres[f, 2]))
            most = limit + spheres[f, 3]
            if dot(apart, apart) <= most * most:
                if room:
                    kept[place] = f
                    place += 1
                count[i] += 1


@inline
def leaf_of(x, root, children):
    """The leaf of a tree that holds x, the center of its cube, and whether x is in the root."""
    cx, cy, cz, half = root[0], root[1], root[2], root[3]
    inside = max(abs(x[0] - cx), max(abs(x[1] - cy), abs(x[2] - cz))) <= half
    node = 0
    while children[node] >= 0:
        half *= 0.5
        i, j, k = x[0] > cx, x[1] > cy, x[2] > cz
        cx += half if i else -half
        cy += half if j else -half
        cz += half if k else -half
        node = children[node] + 4 * i + 2 * j + k
    return node, (cx, cy, cz), inside
