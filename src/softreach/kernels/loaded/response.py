"""How loaded rods in equilibrium respond, and what they look like, theory (73) to (75).

One walk from tip to base, with the tangents of turns of the world and more for every activation and
for three unit forces at the tip. At each node the turns clear the others, so that these bring no
turn of the world into the next segment, however long the arm; behind the base they are the answer.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, kernel, pasted
from softreach.kernels.loaded.rod_step import at_stages
from softreach.kernels.loaded.section import (
    FLAT,
    FORCE,
    MOMENT,
    ROUND,
    SHARE,
    THETA,
    F,
    G,
    M,
    Y,
    along,
    begin_tangents,
    begin_tip,
    inverse_rows,
    missing_turn,
    orthonormal,
    push,
    put_world,
    world,
)
from softreach.kernels.loaded.section import SIZE as SECTION
from softreach.kernels.loaded.shooting import node_world
from softreach.kernels.loaded.unloaded_frames import (
    LANES,
    NODE_ROWS,
    STEP_ROWS,
    TURN,
    TURN_ROWS,
    copy,
    get,
    get_four,
    load_all,
    put,
    put_four,
    rest_frames,
    turn_at,
)
from softreach.kernels.loaded.unloaded_frames import WORK as REST_WORK
from softreach.kernels.vector import back, combination, cross, plus, times, turned

TRACE = 19
"""Numbers kept of a section: G, H, M, y, the turn of the unloaded arm as a quaternion, and the
force that follows the tip, along G, H, K."""

# Rows of the workspace, after those of the section.
DRIVE = SECTION  # turn of the unloaded arm per unit of an activation at five nodes
BEND = DRIVE + 15 * LANES  # Uγ at five nodes
COLUMN = BEND + 15 * LANES  # the tangent in hand
REST = COLUMN + 12 * LANES  # the unloaded arm at the nodes of a step, its turns behind it
STAGES = REST + (STEP_ROWS + TURN_ROWS) * LANES  # states at the stages of a step
SIZE = STAGES + 132 * LANES
# Rows of a tangent: θ, δM, δy, the change of force u, and the turn of the tip along G, H, K.
_COLUMN_ROWS = 15
_NONE = (0.0, 0.0, 0.0, 0.0, 0.0)


@inline
def _drives(w, change, i):
    (a, b, c, d, e), (p, q, r, s, t) = change
    unit = get(w, COLUMN + 9 * LANES, i)
    return at_stages(
        (
            (a, p, get(w, DRIVE, i), unit),
            (b, q, get(w, DRIVE + 3 * LANES, i), unit),
            (c, r, get(w, DRIVE + 6 * LANES, i), unit),
            (d, s, get(w, DRIVE + 9 * LANES, i), unit),
            (e, t, get(w, DRIVE + 12 * LANES, i), unit),
        )
    )


def _step_state_with(kind):
    frame_nodes, frame_tip = kind.frame_nodes, kind.steps.frame_tip

    @pasted
    def step(w, c):
        """Step the states, and keep those at the stages."""
        for i in range(LANES):
            s, at = frame_tip(frame_nodes(w, w, REST, c, i), get_four(w, G, i))
            put_four(w, G, i, s)
            for n in range(11):
                put_four(w, STAGES + 12 * n * LANES, i, at[n])

    return step


def _step_column_with(kind):
    frame_nodes, column_step = kind.frame_nodes, kind.steps.column

    @pasted
    def step(w, c, change):
        for i in range(LANES):
            n, v = frame_nodes(w, w, REST, c, i), _drives(w, change, i)
            places = (
                (n[0], get_four(w, STAGES, i), v[0]),
                (n[1], get_four(w, STAGES + 12 * LANES, i), v[1]),
                (n[2], get_four(w, STAGES + 24 * LANES, i), v[2]),
                (n[3], get_four(w, STAGES + 36 * LANES, i), v[3]),
                (n[4], get_four(w, STAGES + 48 * LANES, i), v[4]),
                (n[5], get_four(w, STAGES + 60 * LANES, i), v[5]),
                (n[6], get_four(w, STAGES + 72 * LANES, i), v[6]),
                (n[7], get_four(w, STAGES + 84 * LANES, i), v[7]),
                (n[8], get_four(w, STAGES + 96 * LANES, i), v[8]),
                (n[9], get_four(w, STAGES + 108 * LANES, i), v[9]),
                (n[10], get_four(w, STAGES + 120 * LANES, i), v[10]),
            )
            theta, dm, dy, _ = get_four(w, COLUMN, i)
            (theta, dm, dy), _ = column_step(places, (theta, dm, dy))
            put(w, COLUMN, i, theta)
            put(w, COLUMN + 3 * LANES, i, dm)
            put(w, COLUMN + 6 * LANES, i, dy)

    return step


@inline
def _bend(w, lanes, bends):
    """Put Uγ at the nodes of a step into BEND; U at the nodes is (node, 3, bundle)."""
    w[BEND : BEND + 15 * LANES] = 0.0
    for n in range(5):
        at = BEND + 3 * n * LANES
        for b in range(bends.shape[2]):
            u = bends[n, 0, b], bends[n, 1, b], bends[n, 2, b]
            for i in range(LANES):
                put(w, at, i, plus(get(w, at, i), times(lanes[b, i], u)))


@inline
def _drive(w, unloaded, bends, change, j):
    """Turn of the unloaded arm over a step by an activation: δω̂ of theory (73) at its five nodes.

    Args:
        w: Workspace.
        unloaded: Unloaded arm at the nodes.
        bends: U at the nodes (node, 3, bundle).
        change: dη dZ at the nodes (node,).
        j: Bundle.
    """
    for n in range(5):
        c, u = change[n], (bends[n, 0, j], bends[n, 1, j], bends[n, 2, j])
        for i in range(LANES):
            length, (x, y, z) = unloaded[NODE_ROWS * n * LANES + i], get(w, BEND + 3 * n * LANES, i)
            bend = c * x + length * u[0], c * y + length * u[1], c * z + length * u[2]
            q = turn_at(unloaded, (STEP_ROWS + 4 * n) * LANES, i)
            put(w, DRIVE + 3 * n * LANES, i, turned(q, bend))


def _step_columns_with(kind):
    step_column = _step_column_with(kind)

    @pasted
    def step(w, columns, first, bundles, lanes, unloaded, tables):
        """Step the tangents from the first on: of turns, of `bundles` activations, the others."""
        c, lengths, bends = tables
        _bend(w, lanes, bends)
        for n in range(first, columns.shape[0]):
            j, change = n - 3, (_NONE, _NONE)
            if 0 <= j < bundles:
                change = (
                    (lengths[0, j], lengths[1, j], lengths[2, j], lengths[3, j], lengths[4, j]),
                    (lengths[5, j], lengths[6, j], lengths[7, j], lengths[8, j], lengths[9, j]),
                )
                _drive(w, unloaded, bends, lengths[:, j], j)
            elif n == first or j == bundles:
                w[DRIVE : DRIVE + 15 * LANES] = 0.0
            copy(w, COLUMN, columns[n], 0, 12 * LANES)
            step_column(w, c, change)
            copy(columns[n], 0, w, COLUMN, 12 * LANES)

    return step


@inline
def _begin(w, columns, units, tip, seen, i):
    """The tip, theory (67), with turns of the world about its axes, and unit forces along them."""
    w[SHARE + i] = 1.0
    put_world(w, G, i, seen[0], seen[1])
    begin_tip(w, tip, i)
    begin_tangents(w, tip, i)
    for n in range(3):
        put(columns[n], 0, i, get(w, THETA + 3 * n * LANES, i))
        put(columns[n], 3 * LANES, i, get(w, MOMENT + 3 * n * LANES, i))
        put(columns[n], 9 * LANES, i, get(w, FORCE + 3 * n * LANES, i))
        columns[n, (12 + n) * LANES + i] = 1.0
        if units > 0:
            columns[columns.shape[0] - 3 + n, (9 + n) * LANES + i] = 1.0


@inline
def _push(w, columns, moment, i):
    """A dead moment at the tip end of a step, theory (67)."""
    m = push(w, moment, i)
    for n in range(columns.shape[0]):
        dm = get(columns[n], 3 * LANES, i)
        put(columns[n], 3 * LANES, i, plus(dm, cross(get(columns[n], 0, i), m)))


@inline
def _combine(columns, at, i, s):
    values = get(columns[0], at, i), get(columns[1], at, i), get(columns[2], at, i)
    return combination(s, values)


@inline
def _clear(columns, axes, i):
    """Make the turns unit turns along the axes, theory (70), and take them out of the others."""
    rows = inverse_rows(
        (
            along(axes, get(columns[0], 0, i)),
            along(axes, get(columns[1], 0, i)),
            along(axes, get(columns[2], 0, i)),
        )
    )
    for at in (3 * LANES, 6 * LANES, 9 * LANES, 12 * LANES):
        for n in range(3, columns.shape[0]):
            turn = along(rows, along(axes, get(columns[n], 0, i)))
            value = plus(get(columns[n], at, i), _combine(columns, at, i, times(-1.0, turn)))
            put(columns[n], at, i, value)
        (a, b, c), (p, q, r), (x, y, z) = rows
        first = _combine(columns, at, i, (a, p, x))
        second = _combine(columns, at, i, (b, q, y))
        third = _combine(columns, at, i, (c, r, z))
        put(columns[0], at, i, first)
        put(columns[1], at, i, second)
        put(columns[2], at, i, third)
    for n in range(3, columns.shape[0]):
        put(columns[n], 0, i, (0.0, 0.0, 0.0))


@inline
def _arrive(w, columns, frames, q, row, node, count, wanted, i):
    """Turn the world of a section to what the node sees, and what lies beyond with it."""
    now, size = world(w, G, i), frames.shape[1] // count
    if size == 3:
        put(columns[0], 0, i, now[0])
    if wanted:
        _clear(columns, now, i)
    if node < count:
        g, h = node_world(q, frames, row, node, size)
        if size == 3:
            h = now[1]
        axes = orthonormal(g, h)
        missing = missing_turn(now, axes)
        put(w, M, i, plus(get(w, M, i), _combine(columns, 3 * LANES, i, missing)))
        put(w, Y, i, plus(get(w, Y, i), _combine(columns, 6 * LANES, i, missing)))
        put(w, F, i, plus(get(w, F, i), _combine(columns, 9 * LANES, i, missing)))
        put_world(w, G, i, axes[0], axes[1])
        for n in range(3):
            put(columns[n], 0, i, axes[n])


def _response_with(kind):  # noqa: C901
    """The walk of `respond` for one kind of sections."""
    step_state, step_columns = _step_state_with(kind), _step_columns_with(kind)
    kept = (STEP_ROWS + kind.keeps_turns * TURN_ROWS) * LANES

    @pasted
    def walk(gamma, tip, frames, tables, slopes, compliance, trace):
        _, lengths, scalars, bends, moments, firsts = tables
        count = firsts.shape[0] - 1
        size = frames.shape[1] // count
        lanes = np.zeros((tables[0].shape[2] - 1, LANES))
        work, w = np.zeros(REST_WORK), np.zeros(SIZE)
        unloaded = np.zeros((lengths.shape[0], (STEP_ROWS + TURN_ROWS) * LANES))
        bundles = gamma.shape[1] if slopes.shape[0] > 0 else 0
        units = 3 if compliance.shape[0] > 0 else 0
        columns = np.zeros((3 + bundles + units, _COLUMN_ROWS * LANES))
        turns = 0 if size > 3 else 1  # tangents of turns that are no turns of G about itself
        wanted = bundles + units > 0 or count > 1
        for first in range(0, gamma.shape[0], LANES):
            here = min(LANES, gamma.shape[0] - first)
            load_all(lanes, gamma, first, here)
            rest_frames(work, lanes, tables[0], lengths, unloaded)
            columns[:] = 0.0
            for i in range(LANES):
                row = first + min(i, here - 1)
                seen = node_world(turn_at(work, TURN, i), frames, row, 0, size)
                _begin(w, columns, units, tip, seen, i)
            for s in range(count):
                for k in range(firsts[s], firsts[s + 1]):
                    if moments[k].any():
                        for i in range(LANES):
                            _push(w, columns, moments[k], i)
                    if k == 0 and trace.shape[0] > 0:
                        _keep(w, unloaded[k], STEP_ROWS * LANES, trace[first:, 0])
                    copy(w, REST, unloaded[k], 0, kept)
                    step_state(w, scalars[k])
                    if wanted:
                        step = scalars[k], lengths[k], bends[k]
                        step_columns(w, columns, turns, bundles, lanes, unloaded[k], step)
                    if trace.shape[0] > 0:
                        _keep(w, unloaded[k], (STEP_ROWS + 16) * LANES, trace[first:, k + 1])
                for i in range(LANES):
                    row, q = first + min(i, here - 1), turn_at(work, TURN, i)
                    _arrive(w, columns, frames, q, row, s + 1, count, wanted, i)
            for i in range(here):
                _store(w, work, columns, first, i, bundles, slopes, compliance)

    return walk


_respond, _respond_flat = _response_with(ROUND), _response_with(FLAT)


@kernel
def respond(gamma, tip, frames, tables, slopes, compliance, trace):
    """Responses of n rods in equilibrium, whatever is asked for.

    Args:
        gamma: Activations (n, bundle).
        tip: As of `shooting.solve_directions`.
        frames: What the nodes see, tip first, as the base of the unloaded arm does: (n, 3 node) of
            forces along one direction, (n, 6 node) of any.
        tables: (pieces, lengths, scalars, bends, moments, firsts).
        slopes: Filled with (v, ω) of the tip per activation, (n, 6, bundle); or (0, 6, bundle).
        compliance: Zeros, to which the change of the tip per force there is added, (n, 3, 3); or
            (0, 3, 3).
        trace: Filled with the sections between steps, tip first, (n, step + 1, `TRACE`); or
            (0, 1, `TRACE`).
    """
    _respond(gamma, tip, frames, tables, slopes, compliance, trace)


@kernel
def respond_flat(gamma, tip, frames, tables, slopes, compliance, trace):
    """As `respond`, of arms with two bending stiffnesses."""
    _respond_flat(gamma, tip, frames, tables, slopes, compliance, trace)


@inline
def _store(w, work, columns, first, i, bundles, slopes, compliance):
    """Slopes (v, ω), theory (74), and compliances, theory (75)."""
    q, row, (g, h, k) = back(turn_at(work, TURN, i)), first + i, world(w, G, i)
    axes = turned(q, g), turned(q, h), turned(q, k)
    tip = turned(q, get(w, Y, i))
    for n in range(3, columns.shape[0]):
        v = turned(q, get(columns[n], 6 * LANES, i))
        if n < 3 + bundles:
            omega = times(-1.0, combination(get(columns[n], 12 * LANES, i), axes))
            v = plus(v, cross(tip, omega))
            for axis in range(3):
                slopes[row, axis, n - 3] = v[axis]
                slopes[row, 3 + axis, n - 3] = omega[axis]
        else:
            force = axes[n - 3 - bundles]
            for axis in range(3):
                for along_axis in range(3):
                    compliance[row, axis, along_axis] += v[axis] * force[along_axis]


@inline
def _keep(w, unloaded, turn, trace):
    """Put the sections that the lanes are at into their places."""
    for i in range(min(LANES, trace.shape[0])):
        q, f = turn_at(unloaded, turn, i), get(w, F, i)
        for row in range(12):
            trace[i, row] = w[G + row * LANES + i]
        for row in range(4):
            trace[i, 12 + row] = q[row]
        for row in range(3):
            trace[i, 16 + row] = f[row]
