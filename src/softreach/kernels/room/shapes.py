"""Signed distances of simple solids, negative inside, with their gradients.

A solid is a kind and numbers: point and outward normal of a half-space; lower and upper corner of a
box; center and radius of a sphere; start, axis, length and radius of a cylinder, and the inner
radius of a tube, whose ends are open.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, lean_kernel
from softreach.kernels.room import BOX, HALF_SPACE, SPHERE, TUBE
from softreach.kernels.vector import dot, minus, times


@inline
def signed_distance(kind, q, x):
    """Signed distance of a point, and its gradient: four numbers."""
    first = minus(x, (q[0], q[1], q[2]))
    if kind == HALF_SPACE:
        normal = q[3], q[4], q[5]
        return dot(first, normal), normal[0], normal[1], normal[2]
    if kind == SPHERE:
        size = math.sqrt(dot(first, first))
        each = 1.0 / max(size, 1e-300)
        return size - q[3], each * first[0], each * first[1], each * first[2]
    if kind == BOX:
        return _of_box(q, x)
    axis = q[3], q[4], q[5]
    height = dot(first, axis)
    away = minus(first, times(height, axis))
    radius = math.sqrt(dot(away, away))
    out, each = 1.0, 1.0 / max(radius, 1e-300)
    along, across = abs(height - 0.5 * q[6]) - 0.5 * q[6], radius - q[7]
    if kind == TUBE and radius < 0.5 * (q[7] + q[8]):
        out, across = -1.0, q[8] - radius
    up = 1.0 if height > 0.5 * q[6] else -1.0
    p, r = max(along, 0.0), max(across, 0.0)
    distance = math.sqrt(p * p + r * r)
    if distance > 0.0:
        p, r = p / distance, r / distance
    elif along > across:
        distance, p = along, 1.0
    else:
        distance, r = across, 1.0
    p, r = p * up, r * out * each
    return (
        distance,
        p * axis[0] + r * away[0],
        p * axis[1] + r * away[1],
        p * axis[2] + r * away[2],
    )


@inline
def _of_box(q, x):
    (a, u), (b, v), (c, w) = _beyond(q, x, 0), _beyond(q, x, 1), _beyond(q, x, 2)
    p, r, s = max(a, 0.0), max(b, 0.0), max(c, 0.0)
    distance = math.sqrt(p * p + r * r + s * s)
    if distance > 0.0:
        return distance, u * p / distance, v * r / distance, w * s / distance
    if a >= b and a >= c:
        return a, u, 0.0, 0.0
    if b >= c:
        return b, 0.0, v, 0.0
    return c, 0.0, 0.0, w


@inline
def _beyond(q, x, k):
    """How far a coordinate is beyond the nearer side of a box, and the way out."""
    below, above = q[k] - x[k], x[k] - q[3 + k]
    return (below, -1.0) if below > above else (above, 1.0)


@lean_kernel
def signed_distances(kind, q, points, distance, gradient):
    """Distances (n,) of points (n, 3) and their gradients (n, 3) into place."""
    for i in range(points.shape[0]):
        found = signed_distance(kind, q, (points[i, 0], points[i, 1], points[i, 2]))
        distance[i] = found[0]
        gradient[i, 0], gradient[i, 1], gradient[i, 2] = found[1], found[2], found[3]
