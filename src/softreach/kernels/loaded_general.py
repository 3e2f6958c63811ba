"""Equilibria of rods under any loads, how they respond, and what they look like.

Unknown is the whole frame of the tip: three numbers. Each walk carries a column of tangents for
each of them; once the equilibrium is found, further columns follow for every activation and for
three unit forces at the tip.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel, pasted
from softreach.kernels.explicit_rk8 import at_stages
from softreach.kernels.loaded_column import column_step, state_step
from softreach.kernels.rest_frames import STEP_ROWS, TURN, TURN_ROWS, rest_frames
from softreach.kernels.rest_frames import WORK as REST_WORK
from softreach.kernels.rod import LANES, load
from softreach.kernels.vector import cross, dot

__all__ = ["TRACE", "solve"]

TRACE = 19
"""Numbers kept of a section: G, H, M, y, the turn of the unloaded arm as a quaternion, F."""

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

_FOUND, _GIVEN_UP = 1.0, 2.0
_CONTRACTION = 0.6
_MOST_TURNS = 8
_SMALLEST_INCREMENT = 1 / 4096


@inline
def _get(w, at, i):
    return w[at + i], w[at + LANES + i], w[at + 2 * LANES + i]


@inline
def _put(w, at, i, v):
    w[at + i] = v[0]
    w[at + LANES + i] = v[1]
    w[at + 2 * LANES + i] = v[2]


@inline
def _copy(into, at, values, start, count):
    """A loop: an assignment of slices would compile messages for shapes that do not fit."""
    for i in range(count):
        into[at + i] = values[start + i]


@inline
def _get_five(w, at, i):
    return (
        _get(w, at, i),
        _get(w, at + 3 * LANES, i),
        _get(w, at + 6 * LANES, i),
        _get(w, at + 9 * LANES, i),
        _get(w, at + 12 * LANES, i),
    )


@inline
def _put_five(w, at, i, s):
    _put(w, at, i, s[0])
    _put(w, at + 3 * LANES, i, s[1])
    _put(w, at + 6 * LANES, i, s[2])
    _put(w, at + 9 * LANES, i, s[3])
    _put(w, at + 12 * LANES, i, s[4])


@inline
def _times(s, a):
    return s * a[0], s * a[1], s * a[2]


@inline
def _sum(a, b):
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inline
def _turned(q, p):
    """q p q*."""
    v = q[1], q[2], q[3]
    t = _times(2.0, cross(v, p))
    return _sum(p, _sum(_times(q[0], t), cross(v, t)))


@inline
def _turn_at(w, at, i):
    return w[at + i], w[at + LANES + i], w[at + 2 * LANES + i], w[at + 3 * LANES + i]


@inline
def _back(q):
    return -q[0], q[1], q[2], q[3]


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
    return w[at + i], _get(w, at + LANES, i), bending, twisting, axial, _times(share, force)


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
            (a, _get(w, DRIVE, i), unit),
            (b, _get(w, DRIVE + 3 * LANES, i), unit),
            (c, _get(w, DRIVE + 6 * LANES, i), unit),
            (d, _get(w, DRIVE + 9 * LANES, i), unit),
            (e, _get(w, DRIVE + 12 * LANES, i), unit),
        )
    )


@pasted
def _step_state(w, c):
    for i in range(LANES):
        s, at = state_step(_nodes(w, c, i), _get_five(w, STATE, i))
        _put_five(w, STATE, i, s)
        _put_five(w, STAGES, i, at[0])
        _put_five(w, STAGES + 15 * LANES, i, at[1])
        _put_five(w, STAGES + 30 * LANES, i, at[2])
        _put_five(w, STAGES + 45 * LANES, i, at[3])
        _put_five(w, STAGES + 60 * LANES, i, at[4])
        _put_five(w, STAGES + 75 * LANES, i, at[5])
        _put_five(w, STAGES + 90 * LANES, i, at[6])
        _put_five(w, STAGES + 105 * LANES, i, at[7])
        _put_five(w, STAGES + 120 * LANES, i, at[8])
        _put_five(w, STAGES + 135 * LANES, i, at[9])
        _put_five(w, STAGES + 150 * LANES, i, at[10])


@pasted
def _step_column(w, c, change, unit):
    for i in range(LANES):
        n, v = _nodes(w, c, i), _drives(w, change, unit, i)
        places = (
            (n[0], _get_five(w, STAGES, i), v[0]),
            (n[1], _get_five(w, STAGES + 15 * LANES, i), v[1]),
            (n[2], _get_five(w, STAGES + 30 * LANES, i), v[2]),
            (n[3], _get_five(w, STAGES + 45 * LANES, i), v[3]),
            (n[4], _get_five(w, STAGES + 60 * LANES, i), v[4]),
            (n[5], _get_five(w, STAGES + 75 * LANES, i), v[5]),
            (n[6], _get_five(w, STAGES + 90 * LANES, i), v[6]),
            (n[7], _get_five(w, STAGES + 105 * LANES, i), v[7]),
            (n[8], _get_five(w, STAGES + 120 * LANES, i), v[8]),
            (n[9], _get_five(w, STAGES + 135 * LANES, i), v[9]),
            (n[10], _get_five(w, STAGES + 150 * LANES, i), v[10]),
        )
        t, _ = column_step(places, _get_five(w, COLUMN, i))
        _put_five(w, COLUMN, i, t)


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
            q = _turn_at(rest, (STEP_ROWS + 4 * n) * LANES, i)
            _put(w, DRIVE + 3 * n * LANES, i, _turned(q, bend))


@inline
def _jump(w, columns, rest, jump):
    """Loads at the tip end of a step: (lever x force (3, 3), moment, following force, moment)."""
    for i in range(LANES):
        q, share = _turn_at(rest, STEP_ROWS * LANES, i), w[LOAD + i]
        a = _turned(q, (share, 0.0, 0.0))
        b = _turned(q, (0.0, share, 0.0))
        c = _turned(q, (0.0, 0.0, share))
        l1 = _along(jump[0], jump[3], jump[6], a, b, c)
        l2 = _along(jump[1], jump[4], jump[7], a, b, c)
        l3 = _along(jump[2], jump[5], jump[8], a, b, c)
        g, h, f, m, y = _get_five(w, STATE, i)
        k = cross(g, h)
        m = _sum(m, _dead_moment(jump, share, l1, l2, l3, g, h, k))
        m = _sum(m, _along(jump[15], jump[16], jump[17], a, b, c))
        f = _sum(f, _along(jump[12], jump[13], jump[14], a, b, c))
        _put_five(w, STATE, i, (g, h, f, m, y))
        for n in range(columns.shape[0]):
            dg, dh, df, dm, dy = _get_five(columns[n], 0, i)
            dk = _sum(cross(dg, h), cross(g, dh))
            dm = _sum(dm, _dead_moment(jump, share, l1, l2, l3, dg, dh, dk))
            _put_five(columns[n], 0, i, (dg, dh, df, dm, dy))


@inline
def _along(x, y, z, a, b, c):
    return _sum(_times(x, a), _sum(_times(y, b), _times(z, c)))


@inline
def _dead_moment(jump, share, l1, l2, l3, g, h, k):
    m = _sum(cross(l1, g), _sum(cross(l2, h), cross(l3, k)))
    return _sum(m, _times(share, _along(jump[9], jump[10], jump[11], g, h, k)))


@inline
def _begin(w, columns):
    for i in range(LANES):
        g, h, zero = _get(w, TRIAL, i), _get(w, TRIAL + 3 * LANES, i), (0.0, 0.0, 0.0)
        _put_five(w, STATE, i, (g, h, zero, zero, zero))
        for n in range(columns.shape[0]):
            _put_five(columns[n], 0, i, (zero, zero, zero, zero, zero))
        e = (1.0, 0.0, 0.0)
        _put_five(columns[0], 0, i, (cross(e, g), cross(e, h), zero, zero, zero))
        e = (0.0, 1.0, 0.0)
        _put_five(columns[1], 0, i, (cross(e, g), cross(e, h), zero, zero, zero))
        e = (0.0, 0.0, 1.0)
        _put_five(columns[2], 0, i, (cross(e, g), cross(e, h), zero, zero, zero))
        w[MARGIN + i] = 1.0
        _put_rotations(w, columns, i)


@inline
def _rotation(s, t):
    """The rotation that a tangent makes of the frame, in the directions of the world."""
    g, h, dg, dh = s[0], s[1], t[0], t[1]
    k = cross(g, h)
    return dot(dh, k), -dot(dg, k), dot(dg, h)


@inline
def _put_rotations(w, columns, i):
    s = _get_five(w, STATE, i)
    for n in range(3):
        _put(w, PLANE + 3 * n * LANES, i, _rotation(s, _get_five(columns[n], 0, i)))


@inline
def _adjugate_rows(a, b, c):
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
        _get(w, PLANE, i),
        _get(w, PLANE + 3 * LANES, i),
        _get(w, PLANE + 6 * LANES, i),
    )
    _put_rotations(w, columns, i)
    x, y, z = (
        _get(w, PLANE, i),
        _get(w, PLANE + 3 * LANES, i),
        _get(w, PLANE + 6 * LANES, i),
    )
    p1, p2, p3 = _adjugate_rows(a, b, c)
    q1, q2, q3 = _adjugate_rows(x, y, z)
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
        _copy(w, COLUMN, columns[n], 0, 15 * LANES)
        _step_column(w, c, dz, unit)
        _copy(columns[n], 0, w, COLUMN, 15 * LANES)


@pasted
def _walk(w, columns, lanes, rest, tables, jumps, bundles, unit_at, trace):
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
        _copy(w, REST, r, 0, STEP_ROWS * LANES)
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
        s, q = _get_five(w, STATE, i), _turn_at(rest, turn, i)
        for row in range(3):
            trace[i, row] = s[0][row]
            trace[i, 3 + row] = s[1][row]
            trace[i, 6 + row] = s[3][row]
            trace[i, 9 + row] = s[4][row]
            trace[i, 16 + row] = s[2][row]
        for row in range(4):
            trace[i, 12 + row] = q[row]


@inline
def _solved(w, i, r):
    """x with P x = r for the 3 x 3 matrix of rotations at the base."""
    a, b, c = (
        _get(w, PLANE, i),
        _get(w, PLANE + 3 * LANES, i),
        _get(w, PLANE + 6 * LANES, i),
    )
    p1, p2, p3 = _adjugate_rows(a, b, c)
    determinant = dot(p1, a)
    determinant = math.copysign(max(abs(determinant), 1e-12), determinant)
    return _times(1.0 / determinant, (dot(p1, r), dot(p2, r), dot(p3, r)))


@inline
def _missing(w, i):
    """The rotation that the base lacks, in the directions of the world."""
    g, h = _get(w, STATE, i), _get(w, STATE + 3 * LANES, i)
    t, u = _get(w, TARGET, i), _get(w, TARGET + 3 * LANES, i)
    k, v = cross(g, h), cross(t, u)
    twice = _sum(cross(g, t), _sum(cross(h, u), cross(k, v)))
    sine = 0.5 * math.sqrt(dot(twice, twice))
    cosine = 0.5 * (dot(g, t) + dot(h, u) + dot(k, v) - 1.0)
    scale = 0.5 * (math.atan2(sine, cosine) / sine if sine > 1e-9 else 1.0)
    return _times(scale, (dot(twice, g), dot(twice, h), dot(twice, k)))


@inline
def _orthonormal(g, h):
    g = _times(1.0 / math.sqrt(dot(g, g)), g)
    s = dot(g, h)
    h = (h[0] - s * g[0], h[1] - s * g[1], h[2] - s * g[2])
    return g, _times(1.0 / math.sqrt(dot(h, h)), h)


@inline
def _move(w, i, x):
    """Turn the frame of the tip by the rotation x."""
    angle = math.sqrt(dot(x, x))
    a = _times(math.tan(0.5 * min(angle, 3.0)) / angle if angle > 1e-9 else 0.5, x)
    f = 2.0 / (1.0 + dot(a, a))
    g, h = _get(w, TRIAL, i), _get(w, TRIAL + 3 * LANES, i)
    c, d = cross(a, g), cross(a, h)
    g = _sum(g, _times(f, _sum(c, cross(a, c))))
    h = _sum(h, _times(f, _sum(d, cross(a, d))))
    g, h = _orthonormal(g, h)
    _put(w, TRIAL, i, g)
    _put(w, TRIAL + 3 * LANES, i, h)


@inline
def _predict(w, i, widest):
    w[LOAD + i] = min(1.0, w[HELD_LOAD + i] + w[INCREMENT + i])
    ratio = 0.0
    if w[HELD_LOAD + i] > w[PAST_LOAD + i]:
        ratio = (w[LOAD + i] - w[HELD_LOAD + i]) / (w[HELD_LOAD + i] - w[PAST_LOAD + i])
    g, p = _get(w, HELD, i), _get(w, PAST, i)
    h, q = _get(w, HELD + 3 * LANES, i), _get(w, PAST + 3 * LANES, i)
    g = _sum(_times(1.0 + ratio, g), _times(-ratio, p))
    h = _sum(_times(1.0 + ratio, h), _times(-ratio, q))
    g, h = _orthonormal(g, h)
    _put(w, TRIAL, i, g)
    _put(w, TRIAL + 3 * LANES, i, h)
    w[LAST + i] = widest
    w[TURNS + i] = 0.0


@inline
def _advance(w, i, small, widest):
    """Take a Newton step, go on to the next load, or go back to a smaller one."""
    x = _get(w, STEP, i)
    size = math.sqrt(dot(x, x))
    trusted = size < small or (size < w[LAST + i] and w[TURNS + i] < _MOST_TURNS)
    if not trusted:
        w[INCREMENT + i] *= 0.5
        if w[INCREMENT + i] < _SMALLEST_INCREMENT:
            w[DONE + i] = _GIVEN_UP
            return
        _predict(w, i, widest)
        return
    w[LAST + i] = _CONTRACTION * size
    w[TURNS + i] += 1.0
    _move(w, i, x)
    if size >= small:
        return
    if w[LOAD + i] >= 1.0:
        w[DONE + i] = _FOUND
        return
    w[PAST_LOAD + i] = w[HELD_LOAD + i]
    w[HELD_LOAD + i] = w[LOAD + i]
    for row in range(6):
        w[PAST + row * LANES + i] = w[HELD + row * LANES + i]
        w[HELD + row * LANES + i] = w[TRIAL + row * LANES + i]
    if w[TURNS + i] <= 3.0:
        w[INCREMENT + i] *= 2.0
    _predict(w, i, widest)


@inline
def _set_out(w, work, axes, guesses, first, count, increment, widest):
    for i in range(LANES):
        q = _turn_at(work, TURN, i)
        g = _turned(q, (axes[0, 0], axes[0, 1], axes[0, 2]))
        h = _turned(q, (axes[1, 0], axes[1, 1], axes[1, 2]))
        _put(w, TARGET, i, g)
        _put(w, TARGET + 3 * LANES, i, h)
        for row in range(6):
            w[HELD + row * LANES + i] = w[TARGET + row * LANES + i]
            w[PAST + row * LANES + i] = w[TARGET + row * LANES + i]
        w[HELD_LOAD + i] = 0.0
        w[PAST_LOAD + i] = 0.0
        w[INCREMENT + i] = increment
        w[DONE + i] = 0.0
        _predict(w, i, widest)
        if guesses.shape[0] > 0:
            n = first + min(i, count - 1)
            g = _turned(q, (guesses[n, 0], guesses[n, 1], guesses[n, 2]))
            h = _turned(q, (guesses[n, 3], guesses[n, 4], guesses[n, 5]))
            g, h = _orthonormal(g, h)
            _put(w, TRIAL, i, g)
            _put(w, TRIAL + 3 * LANES, i, h)


@kernel
def solve(gamma, axes, jumps, guesses, tables, limits, most, found, slopes, compliance, trace):
    """Equilibria of n rods and what the answers ask for.

    Args:
        gamma: Activations (n, bundle).
        axes: Two orthonormal directions of the world in the base frame (2, 3).
        jumps: Loads at the tip end of every step, (step, 18).
        guesses: G, H at the tip as the base of the unloaded arm sees them (n, 6), or (0, 6).
        tables: (pieces, lengths, scalars, bends).
        limits: First share of the load to try; longest first Newton step [rad] that is trusted;
            step at which an equilibrium counts as found.
        most: Walks allowed.
        found: Filled with the tip, G, H as in `guesses`, the margin of stability, the state (0 not
            found, 1 found, 2 given up), walks, (n, 12).
        slopes: Filled with (v, ω) of the tip per activation, (n, 6, bundle); or (0, 6, bundle).
        compliance: Filled with the change of the tip per force there, (n, 3, 3); or (0, 3, 3).
        trace: Filled with the sections between steps, tip first, (n, step + 1, 16); or (0, 1, 16).
    """
    increment, widest, small = limits
    lanes = np.zeros((tables[0].shape[2] - 1, LANES))
    work, w = np.zeros(REST_WORK), np.zeros(SIZE)
    rest = np.zeros((tables[1].shape[0], (STEP_ROWS + TURN_ROWS) * LANES))
    bundles = gamma.shape[1] if slopes.shape[0] > 0 else 0
    units = 3 if compliance.shape[0] > 0 else 0
    rotations = np.zeros((3, 15 * LANES))
    columns = np.zeros((3 + bundles + units, 15 * LANES))
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        load(lanes, gamma, first, count)
        _repeat_last(lanes, count)
        rest_frames(work, lanes, tables[0], tables[1], rest)
        _set_out(w, work, axes, guesses, first, count, increment, widest)
        walks, waiting = 0, LANES
        while True:
            last = waiting == 0 or walks >= most
            current = columns if last else rotations
            _walk(w, current, lanes, rest, tables, jumps, bundles, 3 + bundles, trace[first:])
            _steps(w)
            if last:
                break
            walks, waiting = walks + 1, _advance_all(w, small, widest)
        _respond(w, columns, axes, first, count, slopes, compliance)
        _store(w, work, columns, first, count, walks, found)


@inline
def _repeat_last(lanes, count):
    """Lanes to spare repeat the last activation."""
    for j in range(lanes.shape[0]):
        for i in range(count, LANES):
            lanes[j, i] = lanes[j, count - 1]


@inline
def _steps(w):
    for i in range(LANES):
        _put(w, STEP, i, _solved(w, i, _missing(w, i)))


@inline
def _advance_all(w, small, widest):
    """One Newton step for all lanes; how many are still at work."""
    waiting = 0
    for i in range(LANES):
        if w[DONE + i] == 0.0:
            _advance(w, i, small, widest)
        waiting += w[DONE + i] == 0.0
    return waiting


@inline
def _at_base(column, w, i, x, columns):
    """The change of the tip and the rotation of its frame, base held, per unit of a column."""
    y = _get(column, 12 * LANES, i)
    for n in range(3):
        y = _sum(y, _times(x[n], _get(columns[n], 12 * LANES, i)))
    return y


@inline
def _in_base(axes, g, h, k, v):
    """A vector in the base frame from its parts along the directions of the world."""
    a, b = (axes[0, 0], axes[0, 1], axes[0, 2]), (axes[1, 0], axes[1, 1], axes[1, 2])
    return _along(dot(v, g), dot(v, h), dot(v, k), a, b, cross(a, b))


@inline
def _respond(w, columns, axes, first, count, slopes, compliance):
    for i in range(count):
        g, h = _get(w, STATE, i), _get(w, STATE + 3 * LANES, i)
        k = cross(g, h)
        state = _get_five(w, STATE, i)
        tip = _in_base(axes, g, h, k, _get(w, STATE + 12 * LANES, i))
        tg, th = _get(w, TRIAL, i), _get(w, TRIAL + 3 * LANES, i)
        tk = cross(tg, th)
        for n in range(3, columns.shape[0]):
            r = _rotation(state, _get_five(columns[n], 0, i))
            x = _solved(w, i, _times(-1.0, r))
            v = _in_base(axes, g, h, k, _at_base(columns[n], w, i, x, columns))
            if n < 3 + slopes.shape[2] and slopes.shape[0] > 0:
                omega = _times(-1.0, _in_base(axes, tg, th, tk, x))
                v = _sum(v, cross(tip, omega))
                for row in range(3):
                    slopes[first + i, row, n - 3] = v[row]
                    slopes[first + i, 3 + row, n - 3] = omega[row]
            else:
                u = n - (columns.shape[0] - 3)
                for row in range(3):
                    compliance[first + i, row, u] = v[row]


@inline
def _store(w, work, columns, first, count, walks, found):
    for i in range(count):
        q, x = _back(_turn_at(work, TURN, i)), _get(w, STEP, i)
        y = _get(w, STATE + 12 * LANES, i)
        for n in range(3):
            y = _sum(y, _times(x[n], _get(columns[n], 12 * LANES, i)))
        r, g = _turned(q, y), _turned(q, _get(w, TRIAL, i))
        h = _turned(q, _get(w, TRIAL + 3 * LANES, i))
        for axis in range(3):
            found[first + i, axis] = r[axis]
            found[first + i, 3 + axis] = g[axis]
            found[first + i, 6 + axis] = h[axis]
        found[first + i, 9] = w[MARGIN + i]
        found[first + i, 10] = w[DONE + i]
        found[first + i, 11] = walks
