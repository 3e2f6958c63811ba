"""Walk of whole frames from tip to base, with tangents: rods under any loads."""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, pasted
from softreach.kernels.lanes import LANES, copy, get, get_four, put, put_four, turn_at
from softreach.kernels.loaded.direction_walk import tangents
from softreach.kernels.loaded.frame_step import (
    AXIAL,
    COLUMN_ROWS,
    FOLLOWING,
    PLANE,
    REST,
    STATE,
    step_columns,
    step_state,
)
from softreach.kernels.loaded.load_continuation import LOAD, MARGIN, TRIAL
from softreach.kernels.loaded.unloaded_frames import STEP_ROWS
from softreach.kernels.quaternion import turned
from softreach.kernels.vector import combination, cross, dot, plus, times

__all__ = ["TRACE", "adjugate_rows", "rotation", "walk"]

TRACE = 19
"""Numbers kept of a section: G, H, M, y, the turn of the unloaded arm as a quaternion, and the
force that follows the tip, along G, H, K."""


@inline
def _span(jump, at, axes):
    return combination((jump[at], jump[at + 1], jump[at + 2]), axes)


@inline
def _turned_by(theta, g, h, k):
    return cross(theta, g), cross(theta, h), cross(theta, k)


@inline
def _dead_moment(jump, share, levers, axes):
    """Of a lever and of what does not turn with the arm, theory (67)."""
    l1, l2, l3 = levers
    g, h, k = axes
    m = plus(cross(l1, g), plus(cross(l2, h), cross(l3, k)))
    return plus(m, times(share, _span(jump, 9, axes)))


@inline
def _jump(w, columns, count, unloaded, jump):
    """Loads at the tip end of a step, theory (67): lever x force (3, 3), moment, following two."""
    for i in range(LANES):
        q, share = turn_at(unloaded, STEP_ROWS * LANES, i), w[LOAD + i]
        body = (
            turned(q, (share, 0.0, 0.0)),
            turned(q, (0.0, share, 0.0)),
            turned(q, (0.0, 0.0, share)),
        )
        levers = (
            combination((jump[0], jump[3], jump[6]), body),
            combination((jump[1], jump[4], jump[7]), body),
            combination((jump[2], jump[5], jump[8]), body),
        )
        g, h, m, _ = get_four(w, STATE, i)
        k = cross(g, h)
        m = plus(m, _dead_moment(jump, share, levers, (g, h, k)))
        put(w, STATE + 6 * LANES, i, plus(m, _span(jump, 15, body)))
        f = _span(jump, 12, body)
        along = dot(f, g), dot(f, h), dot(f, k)
        put(w, FOLLOWING, i, plus(get(w, FOLLOWING, i), along))
        for n in range(count):
            theta, dm, dy, unit = get_four(columns[n], 0, i)
            axes = _turned_by(theta, g, h, k)
            dm = plus(dm, _dead_moment(jump, share, levers, axes))
            unit = plus(unit, (dot(f, axes[0]), dot(f, axes[1]), dot(f, axes[2])))
            put_four(columns[n], 0, i, (theta, dm, dy, unit))


@inline
def _begin(w, columns, count, unit_at):
    """The state at the tip, and its tangents, theory (68)."""
    for i in range(LANES):
        zero = (0.0, 0.0, 0.0)
        put(w, STATE, i, get(w, TRIAL, i))
        put(w, STATE + 3 * LANES, i, get(w, TRIAL + 3 * LANES, i))
        put(w, STATE + 6 * LANES, i, zero)
        put(w, STATE + 9 * LANES, i, zero)
        put(w, FOLLOWING, i, zero)
    for n in range(count):
        columns[n, : COLUMN_ROWS * LANES] = 0.0
        if n >= unit_at:
            row = 9 + n - unit_at
            columns[n, row * LANES : (row + 1) * LANES] = 1.0
    if count > 0:
        for i in range(LANES):
            w[MARGIN + i] = 1.0
            axes = _turned_about(w, i)
            for n in range(3):
                put(columns[n], 0, i, axes[n])
            _put_rotations(w, columns, i)


@inline
def _turned_about(w, i):
    """Axes of the rotations of the tip: any three, but G first where all loads are along it."""
    g = get(w, TRIAL, i)
    if w[AXIAL] > 0.0:
        t1, t2 = tangents(g)
        return g, t1, t2
    return (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


@inline
def _straighten(w, columns):
    """Make the tangents of rotations those of turns about x, y, z, if they are of others."""
    if w[AXIAL] == 0.0:
        return
    for i in range(LANES):
        g, s, t = _turned_about(w, i)
        for at in (0, 3 * LANES, 6 * LANES):
            values = get(columns[0], at, i), get(columns[1], at, i), get(columns[2], at, i)
            for n in range(3):
                put(columns[n], at, i, combination((g[n], s[n], t[n]), values))
        _put_rotations(w, columns, i)


@inline
def rotation(w, theta, i):
    """The rotation θ of the section along the directions of the world: φ of theory (68)."""
    g, h = get(w, STATE, i), get(w, STATE + 3 * LANES, i)
    return dot(theta, g), dot(theta, h), dot(theta, cross(g, h))


@inline
def _put_rotations(w, columns, i):
    for n in range(3):
        put(w, PLANE + 3 * n * LANES, i, rotation(w, get(columns[n], 0, i), i))


@inline
def adjugate_rows(a, b, c):
    """Rows of det(A) A⁻¹ for a matrix of columns a, b, c."""
    return cross(b, c), cross(c, a), cross(a, b)


@inline
def _length(a, b, c):
    return math.sqrt(dot(a, a) + dot(b, b) + dot(c, c))


@inline
def _watch(w, columns, i):
    """Note whether the rotations lost their independence during the step, theory (77), (78).

    With P and Q the matrices before and after, Q P⁻¹ is near the identity for a short step. A
    conjugate point within gives it a negative eigenvalue, hence a negative trace, sum of principal
    minors or determinant.
    """
    a, b, c = get(w, PLANE, i), get(w, PLANE + 3 * LANES, i), get(w, PLANE + 6 * LANES, i)
    _put_rotations(w, columns, i)
    x, y, z = get(w, PLANE, i), get(w, PLANE + 3 * LANES, i), get(w, PLANE + 6 * LANES, i)
    p1, p2, p3 = adjugate_rows(a, b, c)
    q1, q2, q3 = adjugate_rows(x, y, z)
    before, after = _length(p1, p2, p3), _length(q1, q2, q3)
    trace = (dot(p1, x) + dot(p2, y) + dot(p3, z)) / (before * _length(x, y, z))
    minors = (dot(q1, a) + dot(q2, b) + dot(q3, c)) / (after * _length(a, b, c))
    determinant = 3.0 * dot(q1, x) / (after * _length(x, y, z))
    w[MARGIN + i] = min(w[MARGIN + i], min(determinant, min(trace, minors)))


@pasted
def walk(w, columns, count, lanes, unloaded, tables, bundles, trace):
    """From tip to base, with the first `count` tangents.

    Args:
        w: Workspace.
        columns: Tangents: three of rotations, `bundles` of activations, three of unit forces.
        count: Number of them.
        lanes: Activations.
        unloaded: The unloaded arm (step, rows).
        tables: (pieces, lengths, scalars, bends, jumps).
        bundles: Columns of activations.
        trace: Filled with the sections between steps; or empty.
    """
    _, lengths, scalars, bends, jumps = tables
    _begin(w, columns, count, 3 + bundles)
    for k in range(lengths.shape[0]):
        if jumps[k].any():
            _jump(w, columns, count, unloaded[k], jumps[k])
        copy(w, REST, unloaded[k], 0, STEP_ROWS * LANES)
        if k == 0 and trace.shape[0] > 0:
            _keep(w, unloaded[k], STEP_ROWS * LANES, trace[:, 0])
        step_state(w, scalars[k])
        step_columns(
            w, columns, count, lanes, unloaded[k], scalars[k], lengths[k], bends[k], bundles
        )
        if count > 0:
            for i in range(LANES):
                _watch(w, columns, i)
        if trace.shape[0] > 0:
            _keep(w, unloaded[k], (STEP_ROWS + 16) * LANES, trace[:, k + 1])
    if count > 0:
        _straighten(w, columns)


@inline
def _keep(w, unloaded, turn, trace):
    """Put the sections that the lanes are at into their places."""
    for i in range(min(LANES, trace.shape[0])):
        q, f = turn_at(unloaded, turn, i), get(w, FOLLOWING, i)
        for row in range(12):
            trace[i, row] = w[STATE + row * LANES + i]
        for row in range(4):
            trace[i, 12 + row] = q[row]
        for row in range(3):
            trace[i, 16 + row] = f[row]
