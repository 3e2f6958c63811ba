"""Vectors in rows of LANES numbers: component after component, samples side by side."""

from __future__ import annotations

from softreach.kernels.compiler import inline
from softreach.kernels.rod import LANES
from softreach.kernels.vector import cross

__all__ = [
    "along",
    "back",
    "copy",
    "get",
    "get_five",
    "plus",
    "put",
    "put_five",
    "times",
    "turn_at",
    "turned",
]


@inline
def get(w, at, i):
    """Three rows of one lane."""
    return w[at + i], w[at + LANES + i], w[at + 2 * LANES + i]


@inline
def put(w, at, i, v):
    """Write three rows of one lane."""
    w[at + i] = v[0]
    w[at + LANES + i] = v[1]
    w[at + 2 * LANES + i] = v[2]


@inline
def copy(into, at, values, start, count):
    """A loop: an assignment of slices would compile messages for shapes that do not fit."""
    for i in range(count):
        into[at + i] = values[start + i]


@inline
def get_five(w, at, i):
    """Five vectors of one lane."""
    return (
        get(w, at, i),
        get(w, at + 3 * LANES, i),
        get(w, at + 6 * LANES, i),
        get(w, at + 9 * LANES, i),
        get(w, at + 12 * LANES, i),
    )


@inline
def put_five(w, at, i, s):
    """Write five vectors of one lane."""
    put(w, at, i, s[0])
    put(w, at + 3 * LANES, i, s[1])
    put(w, at + 6 * LANES, i, s[2])
    put(w, at + 9 * LANES, i, s[3])
    put(w, at + 12 * LANES, i, s[4])


@inline
def times(s, a):
    """s a."""
    return s * a[0], s * a[1], s * a[2]


@inline
def plus(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inline
def turned(q, p):
    """q p q*."""
    v = q[1], q[2], q[3]
    t = times(2.0, cross(v, p))
    return plus(p, plus(times(q[0], t), cross(v, t)))


@inline
def turn_at(w, at, i):
    """A quaternion in four rows of one lane."""
    return w[at + i], w[at + LANES + i], w[at + 2 * LANES + i], w[at + 3 * LANES + i]


@inline
def back(q):
    """The quaternion that turns back."""
    return -q[0], q[1], q[2], q[3]


@inline
def along(x, y, z, a, b, c):
    """x a + y b + z c."""
    return plus(times(x, a), plus(times(y, b), times(z, c)))
