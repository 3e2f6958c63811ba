"""Frames of the world as sections see them: two directions G, H, and their turns along the axes.

The third axis is G × H. A matrix is a tuple of its three columns.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline
from softreach.kernels.lanes import LANES, get, put
from softreach.kernels.vector import combination, cross, dot, minus, plus, times

_SINGULAR = 1e-12


@inline
def unit(v):
    """v / |v|."""
    return times(1.0 / math.sqrt(dot(v, v)), v)


@inline
def normal_to(g):
    """A unit vector normal to g."""
    s = math.copysign(1.0, g[2])
    a = -1.0 / (s + g[2])
    return 1.0 + s * g[0] * g[0] * a, s * g[0] * g[1] * a, -s * g[0]


@inline
def world(w, at, i):
    """G, H and G × H."""
    g, h = get(w, at, i), get(w, at + 3 * LANES, i)
    return g, h, cross(g, h)


@inline
def orthonormal(g, h):
    """G, H and G × H made of G, and of an H that may lean a little."""
    g = unit(g)
    h = unit(minus(h, times(dot(g, h), g)))
    return g, h, cross(g, h)


@inline
def put_world(w, at, i, g, h):
    """Write G, and H normal to it."""
    axes = orthonormal(g, h)
    put(w, at, i, axes[0])
    put(w, at + 3 * LANES, i, axes[1])


@inline
def three(w, at, i):
    """Three vectors of one lane: a matrix by its columns."""
    return get(w, at, i), get(w, at + 3 * LANES, i), get(w, at + 6 * LANES, i)


@inline
def put_three(w, at, i, s):
    """Write three vectors of one lane."""
    put(w, at, i, s[0])
    put(w, at + 3 * LANES, i, s[1])
    put(w, at + 6 * LANES, i, s[2])


@inline
def product(columns, c):
    """Columns of a matrix times those of another."""
    return combination(c[0], columns), combination(c[1], columns), combination(c[2], columns)


@inline
def along(axes, v):
    """Components of v along three axes."""
    return dot(axes[0], v), dot(axes[1], v), dot(axes[2], v)


@inline
def adjugate_rows(a):
    """Rows of det(A) A⁻¹ for a matrix of columns a."""
    return cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1])


@inline
def size_of(a):
    """Frobenius norm of a matrix."""
    return math.sqrt(dot(a[0], a[0]) + dot(a[1], a[1]) + dot(a[2], a[2]))


@inline
def inverse_rows(a):
    """Rows of the inverse; of a singular matrix, where a conjugate point is, of one near it."""
    rows = adjugate_rows(a)
    determinant = dot(rows[0], a[0])
    least = _SINGULAR * size_of(a) * size_of(rows)
    scale = 1.0 / math.copysign(max(abs(determinant), least), determinant)
    return times(scale, rows[0]), times(scale, rows[1]), times(scale, rows[2])


@inline
def missing_turn(now, wanted):
    """The rotation from one frame to another, along their axes."""
    twice = plus(cross(now[0], wanted[0]), plus(cross(now[1], wanted[1]), cross(now[2], wanted[2])))
    sine = 0.5 * math.sqrt(dot(twice, twice))
    cosine = 0.5 * (dot(now[0], wanted[0]) + dot(now[1], wanted[1]) + dot(now[2], wanted[2]) - 1.0)
    scale = 0.5 * (math.atan2(sine, cosine) / sine if sine > 1e-9 else 1.0)
    return times(scale, along(now, twice))


@inline
def missing_direction(now, wanted):
    """The same of the first axes alone, as the sine of the angle between them."""
    return 0.0, -dot(now[2], wanted[0]), dot(now[1], wanted[0])
