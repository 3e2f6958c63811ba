"""Signed distances of closed triangles, by a tree of boxes around them.

A field of distances at the nodes of a grid says in a few operations how far a solid is, to at most
√3/2 of the spacing, as distances change no faster than places. It knows the triangle nearest to
each node too, from which the search of the tree for those near x begins.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import dot, minus, plus, spot, times

_FLAT = 1e-15  # sin² of an angle between sides, below which a triangle is its edges
FACE = 0  # Parts of a triangle: itself, its edges from corners 0, 1, 2 on, its corners


@inline
def nearest_on_triangle(x, a, b, c):
    """The point of a triangle that is nearest to x, and the part of the triangle that it is on."""
    u, v, w = minus(b, a), minus(c, a), minus(x, a)
    uu, uv, vv, uw, vw = dot(u, u), dot(u, v), dot(v, v), dot(u, w), dot(v, w)
    scale, s, t = uu * vv - uv * uv, vv * uw - uv * vw, uu * vw - uv * uw
    if scale > _FLAT * uu * vv and s > 0.0 and t > 0.0 and s + t < scale:
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
def _beyond_box(x, boxes, n):
    """Squared distance of a point from a box of some (n, 6): lower and upper corners."""
    a = max(max(boxes[n, 0] - x[0], x[0] - boxes[n, 3]), 0.0)
    b = max(max(boxes[n, 1] - x[1], x[1] - boxes[n, 4]), 0.0)
    c = max(max(boxes[n, 2] - x[2], x[2] - boxes[n, 5]), 0.0)
    return a * a + b * b + c * c


@inline
def nearest_in(x, guess, boxes, root, starts, begin, leaves, corners, normals, stack, enough):
    """Signed distance of a point from the nearest triangle, its gradient, and the triangle.

    Of a tree of boxes (node, 6), which begins at `root`, children of node i are 2i + 1 and 2i + 2.
    Its last level, of so many leaves, lists triangles between `starts` from number `begin` on;
    corners (f, 3, 3) and normals of parts (f, 7, 3) are in that order. A triangle near by, the
    `guess`, saves most of the search; `stack` has room for it. With `enough` below 1 a triangle
    does whose distance, times that, is no more than the least.
    """
    face = guess
    place, part = _on_face(x, corners, face)
    foot, square = place, _square(x, place)
    stack[0], size, enough = 0, 1, enough * enough
    while size:
        size -= 1
        node = stack[size]
        if _beyond_box(x, boxes, root + node) >= enough * square:
            continue
        if node >= leaves - 1:
            leaf = begin + node - leaves + 1
            for f in range(starts[leaf], starts[leaf + 1]):
                place, its = _on_face(x, corners, f)
                if _square(x, place) < square:
                    square, face, part, foot = _square(x, place), f, its, place
            continue
        first, second = 2 * node + 1, 2 * node + 2
        if _beyond_box(x, boxes, root + first) < _beyond_box(x, boxes, root + second):
            first, second = second, first
        stack[size], stack[size + 1] = first, second  # the nearer one comes next
        size += 2
    away, normal = minus(x, foot), spot(normals, face, part)
    near = math.sqrt(square)
    sign = -1.0 if dot(away, normal) < 0.0 else 1.0
    if near > 0.0:
        normal = times(sign / near, away)
    else:
        normal = times(1.0 / max(math.sqrt(dot(normal, normal)), 1e-300), normal)
    return sign * near, normal[0], normal[1], normal[2], face


@inline
def _on_face(x, corners, f):
    return nearest_on_triangle(x, spot(corners, f, 0), spot(corners, f, 1), spot(corners, f, 2))


@kernel
def nearest_triangles(points, table, stack, enough, distance, gradient, face):
    """Signed distances (n,) of points (n, 3), gradients (n, 3), and the nearest triangles (n,).

    The table is boxes, starts, corners and normals of a tree; the others are as of `nearest_in`.
    """
    guess, (boxes, starts, corners, normals) = 0, table
    for i in range(points.shape[0]):
        x = points[i, 0], points[i, 1], points[i, 2]
        found = nearest_in(
            x, guess, boxes, 0, starts, 0, len(starts) - 1, corners, normals, stack, enough
        )
        distance[i], face[i] = found[0], found[4]
        gradient[i, 0], gradient[i, 1], gradient[i, 2] = found[1], found[2], found[3]
        guess = found[4]


@inline
def in_field(x, grids, shapes, field, first, m):
    """Distance of x by field m, linear between nodes along each axis, and the node nearest to x.

    Grids (m, 4) are first nodes and spacings, shapes (m, 3) numbers of nodes, fields one list.
    """
    i, a = _cell(x[0], grids[m, 0], grids[m, 3], shapes[m, 0])
    j, b = _cell(x[1], grids[m, 1], grids[m, 3], shapes[m, 1])
    k, c = _cell(x[2], grids[m, 2], grids[m, 3], shapes[m, 2])
    rows, columns = shapes[m, 1], shapes[m, 2]
    n = first + (i * rows + j) * columns + k
    up = n + rows * columns
    low = (1.0 - b) * _line(field, n, c) + b * _line(field, n + columns, c)
    high = (1.0 - b) * _line(field, up, c) + b * _line(field, up + columns, c)
    node = n + (rows * columns if a > 0.5 else 0) + (columns if b > 0.5 else 0)
    return (1.0 - a) * low + a * high, node + (1 if c > 0.5 else 0)


@inline
def _cell(x, first, spacing, count):
    place = min(max((x - first) / spacing, 0.0), count - 1.001)
    return int(place), place - int(place)


@inline
def _line(field, n, t):
    return field[n] + t * (field[n + 1] - field[n])
