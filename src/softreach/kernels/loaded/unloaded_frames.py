"""The arm before its loads: its tangents at the nodes of every step, seen from its own tip.

They are d and P of theory (63). A load turns an arm by less than its activations bend it, so that
an integrator of the load alone, in the frames of the unloaded arm, needs a fifth of the steps
(`design/loaded_rod.md`). What it needs of those frames is d3 at the five Lobatto nodes of a step
and the activated lengths.

Rods lie side by side, component after component, in rows of LANES numbers.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, pasted
from softreach.kernels.loaded.rod_step import NODES
from softreach.kernels.rod.magnus import exponent
from softreach.kernels.rod.tips import load
from softreach.kernels.vector import dot, times

LANES = 32
"""Rods side by side: whole blocks only, so that a rod's result never depends on its neighbors.

A block of rods under loads is searched until the last of them is found, and what one step of it
needs should stay in the nearest cache: fewer than the tips of free rods take.
"""


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
def get_four(w, at, i):
    """Four vectors of one lane."""
    return (
        get(w, at, i),
        get(w, at + 3 * LANES, i),
        get(w, at + 6 * LANES, i),
        get(w, at + 9 * LANES, i),
    )


@inline
def put_four(w, at, i, s):
    """Write four vectors of one lane."""
    put(w, at, i, s[0])
    put(w, at + 3 * LANES, i, s[1])
    put(w, at + 6 * LANES, i, s[2])
    put(w, at + 9 * LANES, i, s[3])


@inline
def turn_at(w, at, i):
    """A quaternion in four rows of one lane."""
    return w[at + i], w[at + LANES + i], w[at + 2 * LANES + i], w[at + 3 * LANES + i]


@inline
def copy(into, at, values, start, count):
    """A loop: an assignment of slices would compile messages for shapes that do not fit."""
    for i in range(count):
        into[at + i] = values[start + i]


@inline
def load_all(lanes, gamma, first, count):
    """Lay activations side by side; lanes to spare repeat the last one."""
    load(lanes, gamma, first, count)
    for j in range(lanes.shape[0]):
        for i in range(count, LANES):
            lanes[j, i] = lanes[j, count - 1]


# A step is a row of a table: η dZ, d1, d2, d3, ζ̂ dZ of each of its nodes, tip first, LANES numbers
# each.
NODE_ROWS = 5
STEP_ROWS = NODE_ROWS * len(NODES)
# Where asked for, the turn so far at each node follows, as quaternions.
TURN_ROWS = 4 * len(NODES)
# The workspace: η dZ, u1, u2, u3 of the Gauss nodes of a piece between nodes, base first, then the
# turn so far as a quaternion.
TURN = 12 * LANES
WORK = TURN + 4 * LANES


def pack_lengths(measure, stretch, rest_length_factor):
    """Tables (step, 2 node, bundle + 1) of η dZ, then ζ̂ dZ, at the nodes of steps.

    The last column is at rest.

    Args:
        measure: Length of the step as each node sees it [m], shape (step, node).
        stretch: z [-], shape (step, node, bundle).
        rest_length_factor: Its part in η [-], shape (step, node, bundle).
    """
    measure, both = np.tile(measure, 2), np.concatenate([rest_length_factor, stretch], axis=1)
    bundles = both.shape[2]
    table = np.zeros((*measure.shape, -(-max(bundles, 1) // 4) * 4 + 1))
    table[..., :bundles] = measure[..., None] * both
    table[..., -1] = measure
    return table


@pasted
def rest_frames(work, lanes, pieces, lengths, steps):
    """Fill `steps` (step, rows), tip first, and leave the turn from tip to base in `work`."""
    for i in range(LANES):
        work[TURN + i] = 1.0
        work[TURN + LANES + i] = 0.0
        work[TURN + 2 * LANES + i] = 0.0
        work[TURN + 3 * LANES + i] = 0.0
    for k in range(steps.shape[0]):
        for node in range(5):
            at = steps[k, NODE_ROWS * node * LANES :]
            _fill_lengths(at, lanes, lengths[k, node], lengths[k, 5 + node])
        _fill_tangents(steps[k], work)
        if steps.shape[1] > STEP_ROWS * LANES:
            _keep_turn(steps[k, STEP_ROWS * LANES :], work)
        for piece in range(4):
            for node in range(3):
                at = work[4 * node * LANES :]
                _fill_bends(at, lanes, pieces[4 * k + piece, 4 * node :])
            _turn(work)
            _fill_tangents(steps[k, NODE_ROWS * (piece + 1) * LANES :], work)
            if steps.shape[1] > STEP_ROWS * LANES:
                _keep_turn(steps[k, (STEP_ROWS + 4 * (piece + 1)) * LANES :], work)


@inline
def _keep_turn(values, work):
    for i in range(4 * LANES):
        values[i] = work[TURN + i]


@inline
def _four(weights, j):
    return weights[j], weights[j + 1], weights[j + 2], weights[j + 3]


@inline
def _activations(lanes, j, i):
    return lanes[j, i], lanes[j + 1, i], lanes[j + 2, i], lanes[j + 3, i]


@inline
def _of_four(weights, g):
    return (weights[0] * g[0] + weights[1] * g[1]) + (weights[2] * g[2] + weights[3] * g[3])


@inline
def _fill_lengths(values, lanes, rest_length, length):
    """η dZ and ζ̂ dZ of one node, into the first row and the fifth."""
    a, b, p, q = rest_length[-1], length[-1], _four(rest_length, 0), _four(length, 0)
    for i in range(LANES):
        g = _activations(lanes, 0, i)
        values[i], values[4 * LANES + i] = a + _of_four(p, g), b + _of_four(q, g)
    for j in range(4, lanes.shape[0], 4):
        p, q = _four(rest_length, j), _four(length, j)
        for i in range(LANES):
            g = _activations(lanes, j, i)
            values[i] += _of_four(p, g)
            values[4 * LANES + i] += _of_four(q, g)


@inline
def _fill_bends(values, lanes, table):
    """η dZ, u1, u2, u3 of one Gauss node."""
    p, q, r, s = _four(table[0], 0), _four(table[1], 0), _four(table[2], 0), _four(table[3], 0)
    a, b, c, d = table[0, -1], table[1, -1], table[2, -1], table[3, -1]
    for i in range(LANES):
        g = _activations(lanes, 0, i)
        values[i] = a + _of_four(p, g)
        values[LANES + i] = b + _of_four(q, g)
        values[2 * LANES + i] = c + _of_four(r, g)
        values[3 * LANES + i] = d + _of_four(s, g)
    for j in range(4, lanes.shape[0], 4):
        p, q, r, s = _four(table[0], j), _four(table[1], j), _four(table[2], j), _four(table[3], j)
        for i in range(LANES):
            g = _activations(lanes, j, i)
            values[i] += _of_four(p, g)
            values[LANES + i] += _of_four(q, g)
            values[2 * LANES + i] += _of_four(r, g)
            values[3 * LANES + i] += _of_four(s, g)


@inline
def _bend(work, at, i):
    """η u dZ at one Gauss node, as a twist that moves nothing."""
    rest_length = work[at + i]
    return (
        rest_length * work[at + LANES + i],
        rest_length * work[at + 2 * LANES + i],
        rest_length * work[at + 3 * LANES + i],
        *(0.0, 0.0, 0.0),
    )


@inline
def _fill_tangents(values, work):
    for i in range(LANES):
        w, x = work[TURN + i], work[TURN + LANES + i]
        y, z = work[TURN + 2 * LANES + i], work[TURN + 3 * LANES + i]
        values[LANES + i] = 2.0 * (x * z + w * y)
        values[2 * LANES + i] = 2.0 * (y * z - w * x)
        values[3 * LANES + i] = 1.0 - 2.0 * (x * x + y * y)


@inline
def _turn(work):
    """Multiply the turn of every lane by that of one piece, q exp(-Ω/2)."""
    for i in range(LANES):
        base, middle, tip = _bend(work, 0, i), _bend(work, 4 * LANES, i), _bend(work, 8 * LANES, i)
        omega = exponent(base, middle, tip)
        h = 0.5 * omega[0], 0.5 * omega[1], 0.5 * omega[2]
        t = dot(h, h)
        c, (x, y, z) = _cosine(t), times(-_sine(t), h)
        q0, q1 = work[TURN + i], work[TURN + LANES + i]
        q2, q3 = work[TURN + 2 * LANES + i], work[TURN + 3 * LANES + i]
        work[TURN + i] = q0 * c - q1 * x - q2 * y - q3 * z
        work[TURN + LANES + i] = q0 * x + q1 * c + q2 * z - q3 * y
        work[TURN + 2 * LANES + i] = q0 * y - q1 * z + q2 * c + q3 * x
        work[TURN + 3 * LANES + i] = q0 * z + q1 * y - q2 * x + q3 * c


@inline
def _cosine(t):
    """cos √t to 1e-13 for t < 0.5."""
    return 1.0 - t * (1 / 2 - t * (1 / 24 - t * (1 / 720 - t * (1 / 40320 - t / 3628800))))


@inline
def _sine(t):
    """sin √t / √t to 1e-14 for t < 0.5."""
    return 1.0 - t * (1 / 6 - t * (1 / 120 - t * (1 / 5040 - t * (1 / 362880 - t / 39916800))))
