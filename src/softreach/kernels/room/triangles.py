"""Signed distances of closed triangles, by a tree of boxes around them.

A field of distances at the nodes of a grid says in a few operations how far a solid is, to at most
√3/2 of the spacing, as distances change no faster than places. It knows the triangle nearest to
each node too, from which the search of the tree for those near x begins.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, lean_kernel
from softreach.kernels.vector import dot, minus, plus, spot, squared, times

FIELD_ERROR = 0.87  # over the spacing of a field: √3/2, half a diagonal
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
        if squared(x, other) < squared(x, best):
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
def _beyond_box(x, boxes, n):
    """Squared distance of a point from a box of some (n, 5, 3): axes, and ends along these."""
    square = 0.0
    for axis in range(3):
        along = dot(x, spot(boxes, n, axis))
        beyond = max(max(boxes[n, 3, axis] - along, along - boxes[n, 4, axis]), 0.0)
        square += beyond * beyond
    return square


@inline
def nearest_in(x, m, guess, most, trees, stack, enough):
    """Signed distance of a point from the nearest triangle, its gradient, and the triangle.

    Of mesh m of `TriangleTree`s. A triangle near by, the `guess`, saves most of the search; `stack`
    has room for it. With `enough` below 1 a triangle does whose distance, times that, is no more
    than the least. Farther than `most` none is searched for, and the distance is that.
    """
    corners, root, begin = trees.corners, trees.firsts[m, 0], trees.firsts[m, 1]
    leaves = trees.firsts[m + 1, 1] - begin - 1
    face = guess
    foot, part = _on_face(x, corners, face)
    square, enough = min(squared(x, foot), most * most), enough * enough
    stack[0, 0], stack[0, 1], size = 0.0, 0.0, 1
    while size:
        size -= 1
        if stack[size, 0] >= enough * square:
            continue
        node = int(stack[size, 1])
        if node >= leaves - 1:
            leaf = begin + node - leaves + 1
            for f in range(trees.starts[leaf], trees.starts[leaf + 1]):
                place, its = _on_face(x, corners, f)
                if squared(x, place) < square:
                    square, face, part, foot = squared(x, place), f, its, place
            continue
        first, second = 2 * node + 1, 2 * node + 2
        near = _beyond_box(x, trees.boxes, root + first)
        far = _beyond_box(x, trees.boxes, root + second)
        if far < near:
            first, second, near, far = second, first, far, near
        stack[size, 0], stack[size, 1] = far, second
        stack[size + 1, 0], stack[size + 1, 1] = near, first  # comes next
        size += 2
    away, normal = minus(x, foot), spot(trees.normals, face, part)
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


@lean_kernel
def nearest_triangles(points, tree, stack, enough, distance, gradient, face):
    """Signed distances (n,) of points (n, 3), gradients (n, 3), and the nearest triangles (n,)."""
    guess = 0
    for i in range(points.shape[0]):
        x = points[i, 0], points[i, 1], points[i, 2]
        distance[i], u, v, w, guess = nearest_in(x, 0, guess, 1e150, tree, stack, enough)
        gradient[i, 0], gradient[i, 1], gradient[i, 2], face[i] = u, v, w, guess


@inline
def least_in_field(x, side, m, trees, fields):
    """A distance that no point of the solid m is nearer to x, one near, and a node.

    Or of all but the solid where side is -1. The square of a distance less that of the place is a
    least value of linear functions: it is no less than the mean of those at the nodes around.
    """
    grids, shapes, field = fields.grids, fields.shapes, fields.distance
    i, a, p = _cell(x[0], grids[m, 0], grids[m, 3], shapes[m, 0])
    j, b, q = _cell(x[1], grids[m, 1], grids[m, 3], shapes[m, 1])
    k, c, r = _cell(x[2], grids[m, 2], grids[m, 3], shapes[m, 2])
    rows, columns = shapes[m, 1], shapes[m, 2]
    n, up = trees.firsts[m, 2] + (i * rows + j) * columns + k, rows * columns
    low = _mean(_line(side, field, n, c), _line(side, field, n + columns, c), b)
    high = _mean(_line(side, field, n + up, c), _line(side, field, n + up + columns, c), b)
    square = low + a * (high - low)
    square -= grids[m, 3] ** 2 * (a * (1.0 - a) + b * (1.0 - b) + c * (1.0 - c))
    n += (up if a > 0.5 else 0) + (columns if b > 0.5 else 0) + (1 if c > 0.5 else 0)
    foot = _on_face(x, trees.corners, fields.face[n])[0]
    near = math.sqrt(max(square, 0.0)) - math.sqrt(p * p + q * q + r * r)
    return (
        near if near > 0.0 else -math.sqrt(squared(x, foot)),
        foot,
        n,
    )  # as if it were inside


@inline
def _cell(x, first, spacing, count):
    """Cell of a coordinate, its share there, and how far it is off the grid."""
    place = min(max((x - first) / spacing, 0.0), count - 1.001)
    return int(place), place - int(place), x - first - place * spacing


@inline
def _line(side, field, n, t):
    one, other = max(side * field[n], 0.0), max(side * field[n + 1], 0.0)
    return _mean(one * one, other * other, t)


@inline
def _mean(a, b, t):
    return a + t * (b - a)
