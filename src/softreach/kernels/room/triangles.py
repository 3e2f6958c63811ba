"""Signed distances of closed triangles, by a tree of boxes around them.

A field of distances at the nodes of a grid says how far a solid is at least, as distances change no
faster than places: |d(x) - d(node)| <= |x - node|. It knows the triangle nearest to each node too,
from which the search of the tree for those near x begins.
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
def _beyond_box(x, box):
    """Squared distance of a point from a box (6,): its lower and upper corner."""
    total = 0.0
    for k in range(3):
        beyond = max(max(box[k] - x[k], x[k] - box[3 + k]), 0.0)
        total += beyond * beyond
    return total


@inline
def nearest_in(x, guess, boxes, starts, corners, normals, stack, enough):
    """Signed distance of a point from the nearest triangle, its gradient, and the triangle.

    Children of node i of a tree of boxes (node, 6) are 2i + 1 and 2i + 2; its last level lists
    triangles from `starts` on, whose corners (f, 3, 3) and normals of parts (f, 7, 3) are in that
    order. A triangle near by, the `guess`, saves most of the search; `stack` has room for it. With
    `enough` below 1 one will do whose distance, times that, is no more than the least.
    """
    leaves = len(starts) - 1
    face = guess
    place, part = _on_face(x, corners, face)
    foot, square = place, _square(x, place)
    stack[0], size, enough = 0, 1, enough * enough
    while size:
        size -= 1
        node = stack[size]
        if _beyond_box(x, boxes[node]) >= enough * square:
            continue
        if node >= leaves - 1:
            for f in range(starts[node - leaves + 1], starts[node - leaves + 2]):
                place, its = _on_face(x, corners, f)
                if _square(x, place) < square:
                    square, face, part, foot = _square(x, place), f, its, place
            continue
        first, second = 2 * node + 1, 2 * node + 2
        if _beyond_box(x, boxes[first]) < _beyond_box(x, boxes[second]):
            first, second = second, first
        stack[size], stack[size + 1] = first, second  # the nearer one comes next
        size += 2
    away, normal = minus(x, foot), row(normals[face], part)
    near = math.sqrt(square)
    sign = -1.0 if dot(away, normal) < 0.0 else 1.0
    if near > 0.0:
        normal = times(sign / near, away)
    else:
        normal = times(1.0 / max(math.sqrt(dot(normal, normal)), 1e-300), normal)
    return sign * near, normal[0], normal[1], normal[2], face


@inline
def _on_face(x, corners, f):
    return nearest_on_triangle(x, row(corners[f], 0), row(corners[f], 1), row(corners[f], 2))


@kernel
def nearest_triangles(points, table, stack, enough, distance, gradient, face):
    """Signed distances (n,) of points (n, 3), gradients (n, 3), and the nearest triangles (n,).

    The table is boxes, starts, corners and normals of a tree; the others are as of `nearest_in`.
    """
    guess, (boxes, starts, corners, normals) = 0, table
    for i in range(points.shape[0]):
        x = points[i, 0], points[i, 1], points[i, 2]
        found = nearest_in(x, guess, boxes, starts, corners, normals, stack, enough)
        distance[i], face[i] = found[0], found[4]
        gradient[i, 0], gradient[i, 1], gradient[i, 2] = found[1], found[2], found[3]
        guess = found[4]


@inline
def node_near(x, grid, shape):
    """Number of the node of a field that is nearest to x, and its distance from x.

    The grid (4,) is its first node and its spacing.
    """
    square, node = 0.0, 0
    for k in range(3):
        place = (x[k] - grid[k]) / grid[3]
        nearest = min(max(math.floor(place + 0.5), 0.0), shape[k] - 1.0)
        square += (place - nearest) ** 2
        node = node * shape[k] + np.int64(nearest)
    return node, grid[3] * math.sqrt(square)
