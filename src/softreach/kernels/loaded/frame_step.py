"""One step of all lanes of a walk of whole frames, and of their tangents.

A workspace is one array of rows of LANES numbers, so that the compiler can prove them disjoint.
"""

from __future__ import annotations

from softreach.kernels.compiler import inline, pasted
from softreach.kernels.lanes import LANES, copy, get, get_four, put, put_four, turn_at
from softreach.kernels.loaded.column_step import column_step, state_step
from softreach.kernels.loaded.explicit_rk8 import at_stages
from softreach.kernels.loaded.load_continuation import HEAD, LOAD
from softreach.kernels.loaded.unloaded_frames import NODE_ROWS, STEP_ROWS
from softreach.kernels.quaternion import turned
from softreach.kernels.vector import plus, times

__all__ = [
    "AXIAL",
    "COLUMN_ROWS",
    "FOLLOWING",
    "PLANE",
    "REST",
    "SIZE",
    "STATE",
    "TARGET",
    "step_columns",
    "step_state",
]

# Rows of the workspace, after those of the continuation.
STATE = HEAD  # G, H, M, y
FOLLOWING = HEAD + 12 * LANES  # the force that follows the tip, along G, H, K
TARGET = HEAD + 15 * LANES  # G, H that the base must see
PLANE = HEAD + 21 * LANES  # rotations by the first three columns, along G, H, K
DRIVE = HEAD + 30 * LANES  # turn of the unloaded arm per unit of an activation at five nodes
BEND = HEAD + 45 * LANES  # Uγ at five nodes
COLUMN = HEAD + 60 * LANES  # the tangent in hand
REST = HEAD + 72 * LANES  # the unloaded arm at the nodes of a step
STAGES = REST + STEP_ROWS * LANES  # states at the stages of a step
AXIAL = (
    STAGES + 132 * LANES
)  # one number: whether no load turns with the world about its first axis
SIZE = AXIAL + 1
COLUMN_ROWS = 12
"""Rows of a tangent: θ, δM, δy, and the change of force u."""


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
    at, share = REST + NODE_ROWS * n * LANES, w[LOAD + i]
    bending, twisting, axial, force = c[n]
    load = plus(times(share, force), get(w, FOLLOWING, i))
    d = get(w, at + LANES, i)
    return w[at + i], w[at + 4 * LANES + i], d, bending, twisting, axial, load


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


@pasted
def step_state(w, scalars):
    """Step the states, and keep those at the stages."""
    c = _all_constants(scalars)
    for i in range(LANES):
        s, at = state_step(_nodes(w, c, i), get_four(w, STATE, i))
        put_four(w, STATE, i, s)
        put_four(w, STAGES, i, at[0])
        put_four(w, STAGES + 12 * LANES, i, at[1])
        put_four(w, STAGES + 24 * LANES, i, at[2])
        put_four(w, STAGES + 36 * LANES, i, at[3])
        put_four(w, STAGES + 48 * LANES, i, at[4])
        put_four(w, STAGES + 60 * LANES, i, at[5])
        put_four(w, STAGES + 72 * LANES, i, at[6])
        put_four(w, STAGES + 84 * LANES, i, at[7])
        put_four(w, STAGES + 96 * LANES, i, at[8])
        put_four(w, STAGES + 108 * LANES, i, at[9])
        put_four(w, STAGES + 120 * LANES, i, at[10])


@pasted
def _step_column(w, c, change):
    for i in range(LANES):
        n, v = _nodes(w, c, i), _drives(w, change, i)
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


@pasted
def step_columns(w, columns, count, lanes, unloaded, scalars, lengths, bends, bundles):
    """Step the first `count` tangents: three of rotations, `bundles` of activations, the others.

    Under axial loads the first rotation is about G itself, and stays so: its tangent is G.
    """
    c = _all_constants(scalars)
    if bundles > 0:
        _bend(w, lanes, bends)
    first = 1 if w[AXIAL] > 0.0 else 0
    for n in range(first, count):
        j, none = n - 3, (0.0, 0.0, 0.0, 0.0, 0.0)
        change = (none, none)
        if 0 <= j < bundles:
            change = (
                (lengths[0, j], lengths[1, j], lengths[2, j], lengths[3, j], lengths[4, j]),
                (lengths[5, j], lengths[6, j], lengths[7, j], lengths[8, j], lengths[9, j]),
            )
            _drive(w, unloaded, bends, lengths[:, j], j)
        elif n == first or j == bundles:
            w[DRIVE : DRIVE + 15 * LANES] = 0.0
        copy(w, COLUMN, columns[n], 0, COLUMN_ROWS * LANES)
        _step_column(w, c, change)
        copy(columns[n], 0, w, COLUMN, COLUMN_ROWS * LANES)
    if 0 < first < count:
        copy(columns[0], 0, w, STATE, 3 * LANES)
