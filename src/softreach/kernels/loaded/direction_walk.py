"""Walks of the direction of gravity from tip to base: rods under forces along one direction."""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, pasted
from softreach.kernels.lanes import LANES, get, put
from softreach.kernels.loaded.explicit_rk8 import at_stages
from softreach.kernels.loaded.load_continuation import HEAD, LOAD, MARGIN, TRIAL
from softreach.kernels.loaded.step import tangent_step, tip_step
from softreach.kernels.loaded.unloaded_frames import NODE_ROWS
from softreach.kernels.vector import cross, dot, minus, times

__all__ = ["PLANE", "SIZE", "A", "B", "X", "Y", "tangents", "unit", "walk_tangents", "walk_tip"]

# Rows of the workspace, after those of the continuation.
X = HEAD  # G, M as walked
Y = HEAD + 6 * LANES  # the tip as seen by the section
A = HEAD + 9 * LANES  # tangents of G, M
B = HEAD + 15 * LANES
AXIS = HEAD + 21 * LANES  # first axis of the plane normal to G, carried along
PLANE = HEAD + 24 * LANES  # the tangents of G in that plane, a 2 x 2 matrix
SIZE = HEAD + 28 * LANES


@inline
def _six(w, at, i):
    return get(w, at, i) + get(w, at + 3 * LANES, i)


@inline
def _put_six(w, at, i, v):
    put(w, at, i, v[:3])
    put(w, at + 3 * LANES, i, v[3:])


@inline
def _node(unloaded, scalars, n, i, share):
    at, weight = NODE_ROWS * n * LANES + i, scalars[n, 3] * share
    growth, extension = unloaded[at], unloaded[at + 4 * LANES]
    d = (unloaded[at + LANES], unloaded[at + 2 * LANES], unloaded[at + 3 * LANES])
    return growth, extension, d, scalars[n, 0], scalars[n, 1], scalars[n, 2], weight


@inline
def _nodes(w, unloaded, scalars, i):
    share = w[LOAD + i]
    return at_stages(
        (
            _node(unloaded, scalars, 0, i, share),
            _node(unloaded, scalars, 1, i, share),
            _node(unloaded, scalars, 2, i, share),
            _node(unloaded, scalars, 3, i, share),
            _node(unloaded, scalars, 4, i, share),
        )
    )


@inline
def unit(v):
    """v / |v|."""
    return times(1.0 / math.sqrt(dot(v, v)), v)


@inline
def tangents(g):
    """Two orthonormal directions t1, t2 with t1 × t2 = g."""
    s = math.copysign(1.0, g[2])
    a = -1.0 / (s + g[2])
    b = g[0] * g[1] * a
    return (1.0 + s * g[0] * g[0] * a, s * b, -s * g[0]), (b, s + g[1] * g[1] * a, -g[1])


@inline
def _begin_tip(w, tip, i):
    """State at the tip, theory (62); `tip` holds the payload's lever times weight, and a moment."""
    g, share = get(w, TRIAL, i), w[LOAD + i]
    put(w, X, i, g)
    m = cross((tip[0], tip[1], tip[2]), g)
    m = (share * (m[0] + tip[3]), share * (m[1] + tip[4]), share * (m[2] + tip[5]))
    put(w, X + 3 * LANES, i, m)
    return g


@pasted
def walk_tip(w, unloaded, scalars, tip):
    """The direction that the base would have to see, and the tip."""
    for i in range(LANES):
        _begin_tip(w, tip, i)
        put(w, Y, i, (0.0, 0.0, 0.0))
    for k in range(unloaded.shape[0]):
        r, c = unloaded[k], scalars[k]
        for i in range(LANES):
            (x, y), _ = tip_step(_nodes(w, r, c, i), (_six(w, X, i), get(w, Y, i)))
            _put_six(w, X, i, x)
            put(w, Y, i, y)


@pasted
def walk_tangents(w, unloaded, scalars, tip):
    """The direction that the base would have to see, and its two tangents, theory (68)."""
    for i in range(LANES):
        g, share = _begin_tip(w, tip, i), w[LOAD + i]
        t1, t2 = tangents(g)
        lever = (share * tip[0], share * tip[1], share * tip[2])
        _put_six(w, A, i, t1 + cross(lever, t1))
        _put_six(w, B, i, t2 + cross(lever, t2))
        put(w, AXIS, i, t1)
        w[PLANE + i] = 1.0
        w[PLANE + LANES + i] = 0.0
        w[PLANE + 2 * LANES + i] = 0.0
        w[PLANE + 3 * LANES + i] = 1.0
        w[MARGIN + i] = 1.0
    for k in range(unloaded.shape[0]):
        r, c = unloaded[k], scalars[k]
        for i in range(LANES):
            state = _six(w, X, i), _six(w, A, i), _six(w, B, i)
            (x, a, b), _ = tangent_step(_nodes(w, r, c, i), state)
            _put_six(w, X, i, x)
            _put_six(w, A, i, a)
            _put_six(w, B, i, b)
        for i in range(LANES):
            _watch(w, i)


@inline
def _watch(w, i):
    """Note whether the tangents of G lost their independence during the step, theory (77), (78).

    With P and Q the 2 x 2 matrices before and after, Q P⁻¹ is near a positive multiple of the
    identity for a short step. One conjugate point within makes its determinant negative, two its
    trace.
    """
    g, a, b = get(w, X, i), get(w, A, i), get(w, B, i)
    e = get(w, AXIS, i)
    e = unit(minus(e, times(dot(e, g), g)))
    f = cross(g, e)
    p, q = w[PLANE + i], w[PLANE + LANES + i]
    r, s = w[PLANE + 2 * LANES + i], w[PLANE + 3 * LANES + i]
    t, u, v, z = dot(a, e), dot(b, e), dot(a, f), dot(b, f)
    before, after = p * p + q * q + r * r + s * s, t * t + u * u + v * v + z * z
    determinant = 2.0 * (t * z - u * v) / after
    trace = (t * s - u * r - v * q + z * p) / math.sqrt(before * after)
    w[MARGIN + i] = min(w[MARGIN + i], min(determinant, trace))
    put(w, AXIS, i, e)
    w[PLANE + i] = t
    w[PLANE + LANES + i] = u
    w[PLANE + 2 * LANES + i] = v
    w[PLANE + 3 * LANES + i] = z
