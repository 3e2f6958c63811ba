"""Walk of whole frames from tip to base, with tangents: rods under any loads.

A workspace is one array of rows of LANES numbers, so that the compiler can prove them disjoint.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, pasted
from softreach.kernels.explicit_rk8 import at_stages
from softreach.kernels.lanes import (
    along,
    copy,
    get,
    get_five,
    plus,
    put,
    put_five,
    times,
    turn_at,
    turned,
)
from softreach.kernels.loaded_column import column_step, state_step
from softreach.kernels.rest_frames import STEP_ROWS
from softreach.kernels.rod import LANES
from softreach.kernels.vector import cross, dot

__all__ = [
    "COLUMN",
    "DONE",
    "DRIVE",
    "HELD",
    "HELD_LOAD",
    "INCREMENT",
    "LAST",
    "LOAD",
    "MARGIN",
    "PAST",
    "PAST_LOAD",
    "PLANE",
    "REST",
    "SIZE",
    "STAGES",
    "STATE",
    "STEP",
    "TARGET",
    "TRIAL",
    "TURNS",
    "adjugate_rows",
    "rotation",
    "walk",
]

STATE = 0  # G, H, F, M, y
DRIVE = 30 * LANES  # turn of the unloaded arm per unit of an activation at five nodes
TARGET = 45 * LANES  # G, H that the base must see
TRIAL = 51 * LANES  # G, H at the tip
HELD = 57 * LANES
PAST = 63 * LANES
LOAD = 69 * LANES
HELD_LOAD = 70 * LANES
PAST_LOAD = 71 * LANES
INCREMENT = 72 * LANES
LAST = 73 * LANES
TURNS = 74 * LANES
DONE = 75 * LANES
MARGIN = 76 * LANES
PLANE = 77 * LANES  # rotations by the first three columns, in the directions of the world
STEP = 86 * LANES
COLUMN = 89 * LANES  # the tangent in hand
STAGES = 104 * LANES  # states at the stages of a step
REST = 269 * LANES  # the unloaded arm at the nodes of a step
SIZE = REST + STEP_ROWS * LANES


@inline
def _constants(scalars, n):
    """1/K1, 1/K3 - 1/K1, 1/K0 and the force at one node; read before the loop over lanes."""
    force = (scalars[n, 3], scalars[n, 4], scalars[n, 5])
    return scalars[n, 0], scalars[n, 1], scalars[n, 2], force


@inline
def _all_constants(scalars):
    return (
        _constants(scalars, 0),
        _constants(scalars, 1),
        _constants(scalars, 2),
        _constants(scalars, 3),
        _constants(scalars, 4),
    )


@inline
def _node(w, c, n, i):
    at, share = REST + 4 * n * LANES, w[LOAD + i]
    bending, twisting, axial, force = c[n]
    return w[at + i], get(w, at + LANES, i), bending, twisting, axial, times(share, force)


@inline
def _nodes(w, c, i):
    return at_stages(
        (
            _node(w, c, 0, i),
            _node(w, c, 1, i),
            _node(w, c, 2, i),
            _node(w, c, 3, i),
            _node(w, c, 4, i),
        )
    )


@inline
def _drives(w, change, unit, i):
    a, b, c, d, e = change
    return at_stages(
        (
            (a, get(w, DRIVE, i), unit),
            (b, get(w, DRIVE + 3 * LANES, i), unit),
            (c, get(w, DRIVE + 6 * LANES, i), unit),
            (d, get(w, DRIVE + 9 * LANES, i), unit),
            (e, get(w, DRIVE + 12 * LANES, i), unit),
        )
    )


@pasted
def _step_state(w, c):
    for i in range(LANES):
        s, at = state_step(_nodes(w, c, i), get_five(w, STATE, i))
        put_five(w, STATE, i, s)
        put_five(w, STAGES, i, at[0])
        put_five(w, STAGES + 15 * LANES, i, at[1])
        put_five(w, STAGES + 30 * LANES, i, at[2])
        put_five(w, STAGES + 45 * LANES, i, at[3])
        put_five(w, STAGES + 60 * LANES, i, at[4])
        put_five(w, STAGES + 75 * LANES, i, at[5])
        put_five(w, STAGES + 90 * LANES, i, at[6])
        put_five(w, STAGES + 105 * LANES, i, at[7])
        put_five(w, STAGES + 120 * LANES, i, at[8])
        put_five(w, STAGES + 135 * LANES, i, at[9])
        put_five(w, STAGES + 150 * LANES, i, at[10])


@pasted
def _step_column(w, c, change, unit):
    for i in range(LANES):
        n, v = _nodes(w, c, i), _drives(w, change, unit, i)
        places = (
            (n[0], get_five(w, STAGES, i), v[0]),
            (n[1], get_five(w, STAGES + 15 * LANES, i), v[1]),
            (n[2], get_five(w, STAGES + 30 * LANES, i), v[2]),
            (n[3], get_five(w, STAGES + 45 * LANES, i), v[3]),
            (n[4], get_five(w, STAGES + 60 * LANES, i), v[4]),
            (n[5], get_five(w, STAGES + 75 * LANES, i), v[5]),
            (n[6], get_five(w, STAGES + 90 * LANES, i), v[6]),
            (n[7], get_five(w, STAGES + 105 * LANES, i), v[7]),
            (n[8], get_five(w, STAGES + 120 * LANES, i), v[8]),
            (n[9], get_five(w, STAGES + 135 * LANES, i), v[9]),
            (n[10], get_five(w, STAGES + 150 * LANES, i), v[10]),
        )
        t, _ = column_step(places, get_five(w, COLUMN, i))
        put_five(w, COLUMN, i, t)


@inline
def _drive(w, lanes, rest, bends, change, j):
    """How an activation turns the unloaded arm over a step: P (dζ̂ û + ζ̂ U) at its five nodes.

    Args:
        w: Workspace.
        lanes: Activations.
        rest: Unloaded arm at the nodes.
        bends: U at the nodes (node, 3, bundle).
        change: dζ̂ dZ at the nodes (node,).
        j: Bundle.
    """
    for n in range(5):
        for i in range(LANES):
            x, y, z = 0.0, 0.0, 0.0
            for b in range(bends.shape[2]):
                x += bends[n, 0, b] * lanes[b, i]
                y += bends[n, 1, b] * lanes[b, i]
                z += bends[n, 2, b] * lanes[b, i]
            length, c = rest[4 * n * LANES + i], change[n]
            bend = (
                c * x + length * bends[n, 0, j],
                c * y + length * bends[n, 1, j],
                c * z + length * bends[n, 2, j],
            )
            q = turn_at(rest, (STEP_ROWS + 4 * n) * LANES, i)
            put(w, DRIVE + 3 * n * LANES, i, turned(q, bend))


@inline
def _jump(w, columns, rest, jump):
    """Loads at the tip end of a step: (lever x force (3, 3), moment, following force, moment)."""
    for i in range(LANES):
        q, share = turn_at(rest, STEP_ROWS * LANES, i), w[LOAD + i]
        a = turned(q, (share, 0.0, 0.0))
        b = turned(q, (0.0, share, 0.0))
        c = turned(q, (0.0, 0.0, share))
        l1 = along(jump[0], jump[3], jump[6], a, b, c)
        l2 = along(jump[1], jump[4], jump[7], a, b, c)
        l3 = along(jump[2], jump[5], jump[8], a, b, c)
        g, h, f, m, y = get_five(w, STATE, i)
        k = cross(g, h)
        m = plus(m, _dead_moment(jump, share, l1, l2, l3, g, h, k))
        m = plus(m, along(jump[15], jump[16], jump[17], a, b, c))
        f = plus(f, along(jump[12], jump[13], jump[14], a, b, c))
        put_five(w, STATE, i, (g, h, f, m, y))
        for n in range(columns.shape[0]):
            dg, dh, df, dm, dy = get_five(columns[n], 0, i)
            dk = plus(cross(dg, h), cross(g, dh))
            dm = plus(dm, _dead_moment(jump, share, l1, l2, l3, dg, dh, dk))
            put_five(columns[n], 0, i, (dg, dh, df, dm, dy))


@inline
def _dead_moment(jump, share, l1, l2, l3, g, h, k):
    m = plus(cross(l1, g), plus(cross(l2, h), cross(l3, k)))
    return plus(m, times(share, along(jump[9], jump[10], jump[11], g, h, k)))


@inline
def _begin(w, columns):
    for i in range(LANES):
        g, h, zero = get(w, TRIAL, i), get(w, TRIAL + 3 * LANES, i), (0.0, 0.0, 0.0)
        put_five(w, STATE, i, (g, h, zero, zero, zero))
        for n in range(columns.shape[0]):
            put_five(columns[n], 0, i, (zero, zero, zero, zero, zero))
        e = (1.0, 0.0, 0.0)
        put_five(columns[0], 0, i, (cross(e, g), cross(e, h), zero, zero, zero))
        e = (0.0, 1.0, 0.0)
        put_five(columns[1], 0, i, (cross(e, g), cross(e, h), zero, zero, zero))
        e = (0.0, 0.0, 1.0)
        put_five(columns[2], 0, i, (cross(e, g), cross(e, h), zero, zero, zero))
        w[MARGIN + i] = 1.0
        _put_rotations(w, columns, i)


@inline
def rotation(s, t):
    """The rotation that a tangent makes of the frame, in the directions of the world."""
    g, h, dg, dh = s[0], s[1], t[0], t[1]
    k = cross(g, h)
    return dot(dh, k), -dot(dg, k), dot(dg, h)


@inline
def _put_rotations(w, columns, i):
    s = get_five(w, STATE, i)
    for n in range(3):
        put(w, PLANE + 3 * n * LANES, i, rotation(s, get_five(columns[n], 0, i)))


@inline
def adjugate_rows(a, b, c):
    """Rows of det(A) A⁻¹ for a matrix of columns a, b, c."""
    return cross(b, c), cross(c, a), cross(a, b)


@inline
def _length(a, b, c):
    return math.sqrt(dot(a, a) + dot(b, b) + dot(c, c))


@inline
def _watch(w, columns, i):
    """Note whether the rotations lost their independence during the step.

    With P and Q the matrices before and after, Q P⁻¹ is near the identity for a short step. A
    conjugate point within gives it a negative eigenvalue, hence a negative trace, sum of principal
    minors or determinant.
    """
    a, b, c = (
        get(w, PLANE, i),
        get(w, PLANE + 3 * LANES, i),
        get(w, PLANE + 6 * LANES, i),
    )
    _put_rotations(w, columns, i)
    x, y, z = (
        get(w, PLANE, i),
        get(w, PLANE + 3 * LANES, i),
        get(w, PLANE + 6 * LANES, i),
    )
    p1, p2, p3 = adjugate_rows(a, b, c)
    q1, q2, q3 = adjugate_rows(x, y, z)
    before, after = _length(p1, p2, p3), _length(q1, q2, q3)
    trace = (dot(p1, x) + dot(p2, y) + dot(p3, z)) / (before * _length(x, y, z))
    minors = (dot(q1, a) + dot(q2, b) + dot(q3, c)) / (after * _length(a, b, c))
    determinant = 3.0 * dot(q1, x) / (after * _length(x, y, z))
    w[MARGIN + i] = min(w[MARGIN + i], min(determinant, min(trace, minors)))


@pasted
def _step_columns(w, columns, lanes, r, c, lengths, bends, bundles, unit_at, zero):
    """All tangents across one step."""
    for n in range(columns.shape[0]):
        j = n - 3
        driven = 0 <= j < bundles
        change = lengths[:, j] if driven else zero
        if driven:
            _drive(w, lanes, r, bends, change, j)
        elif j == bundles:
            w[DRIVE : DRIVE + 15 * LANES] = 0.0
        u = n - unit_at
        unit = (1.0 if u == 0 else 0.0, 1.0 if u == 1 else 0.0, 1.0 if u == 2 else 0.0)
        dz = (change[0], change[1], change[2], change[3], change[4])
        copy(w, COLUMN, columns[n], 0, 15 * LANES)
        _step_column(w, c, dz, unit)
        copy(columns[n], 0, w, COLUMN, 15 * LANES)


@pasted
def walk(w, columns, lanes, rest, tables, jumps, bundles, unit_at, trace):
    """From tip to base: three columns of rotations, some of activations, some of unit forces."""
    _, lengths, scalars, bends = tables
    zero = np.zeros(5)
    _begin(w, columns)
    for k in range(rest.shape[0]):
        if jumps[k].any():
            _jump(w, columns, rest[k], jumps[k])
            if k == 0:
                for i in range(LANES):
                    _put_rotations(w, columns, i)
        r, c = rest[k], _all_constants(scalars[k])
        copy(w, REST, r, 0, STEP_ROWS * LANES)
        if k == 0 and trace.shape[0] > 0:
            _keep(w, r, STEP_ROWS * LANES, trace[:, 0])
        _step_state(w, c)
        w[DRIVE : DRIVE + 15 * LANES] = 0.0
        _step_columns(w, columns, lanes, r, c, lengths[k], bends[k], bundles, unit_at, zero)
        for i in range(LANES):
            _watch(w, columns, i)
        if trace.shape[0] > 0:
            _keep(w, r, (STEP_ROWS + 16) * LANES, trace[:, k + 1])


@inline
def _keep(w, rest, turn, trace):
    """Put the sections that the lanes are at into their places."""
    for i in range(min(LANES, trace.shape[0])):
        s, q = get_five(w, STATE, i), turn_at(rest, turn, i)
        for row in range(3):
            trace[i, row] = s[0][row]
            trace[i, 3 + row] = s[1][row]
            trace[i, 6 + row] = s[3][row]
            trace[i, 9 + row] = s[4][row]
            trace[i, 16 + row] = s[2][row]
        for row in range(4):
            trace[i, 12 + row] = q[row]
