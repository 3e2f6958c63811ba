"""The arm before its loads: its tangents at the nodes of every step, seen from its own tip.

They are d and P of theory (63). A load turns an arm by less than its activations bend it, so that
an integrator of the load alone, in the frames of the unloaded arm, needs a fifth of the steps
(`design/loaded_rod.md`). What it needs of those frames is d3 at the five Lobatto nodes of a step
and the activated lengths.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, pasted
from softreach.kernels.loaded.explicit_rk8 import NODES
from softreach.kernels.rod.tips import LANES, TIP, node_values, nodes_at
from softreach.kernels.vector import cross

__all__ = ["NODE_ROWS", "STEP_ROWS", "TURN", "TURN_ROWS", "WORK", "pack_lengths", "rest_frames"]

_FIRST, _SECOND = math.sqrt(15) / 3, 10 / 3

# A step is a row of a table: η dZ, d1, d2, d3, ζ̂ dZ of each of its nodes, tip first, LANES numbers
# each.
NODE_ROWS = 5
STEP_ROWS = NODE_ROWS * len(NODES)
# Where asked for, the turn so far at each node follows, as quaternions.
TURN_ROWS = 4 * len(NODES)
# The workspace: node values of a piece between nodes, then the turn so far as a quaternion.
TURN = TIP
WORK = TURN + 4 * LANES


def pack_lengths(measure, stretch, growth):
    """Tables (step, 2 node, bundle + 1) of η dZ, then ζ̂ dZ, at the nodes of steps.

    The last column is at rest.

    Args:
        measure: Length of the step as each node sees it [m], shape (step, node).
        stretch: z [-], shape (step, node, bundle).
        growth: Its part in η [-], shape (step, node, bundle).
    """
    measure, both = np.tile(measure, 2), np.concatenate([growth, stretch], axis=1)
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
            at = NODE_ROWS * node * LANES
            _fill_lengths(steps[k, at:], lanes, lengths[k, node])
            _fill_lengths(steps[k, at + 4 * LANES :], lanes, lengths[k, 5 + node])
        _fill_tangents(steps[k], work)
        if steps.shape[1] > STEP_ROWS * LANES:
            _keep_turn(steps[k, STEP_ROWS * LANES :], work)
        for piece in range(4):
            node_values(work, lanes, pieces, 4 * k + piece)
            _turn(work)
            _fill_tangents(steps[k, NODE_ROWS * (piece + 1) * LANES :], work)
            if steps.shape[1] > STEP_ROWS * LANES:
                _keep_turn(steps[k, (STEP_ROWS + 4 * (piece + 1)) * LANES :], work)


@inline
def _keep_turn(values, work):
    for i in range(4 * LANES):
        values[i] = work[TURN + i]


@inline
def _fill_lengths(values, lanes, weights):
    constant = weights[-1]
    for i in range(LANES):
        values[i] = constant
    for j in range(0, lanes.shape[0], 4):
        a, b, c, d = weights[j], weights[j + 1], weights[j + 2], weights[j + 3]
        g0, g1, g2, g3 = lanes[j], lanes[j + 1], lanes[j + 2], lanes[j + 3]
        for i in range(LANES):
            values[i] += (a * g0[i] + b * g1[i]) + (c * g2[i] + d * g3[i])


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
        base, middle, tip = nodes_at(work, i)
        h = _half_exponent(base[:3], middle[:3], tip[:3])
        t = h[0] * h[0] + h[1] * h[1] + h[2] * h[2]
        c, s = _cosine(t), -_sine(t)
        x, y, z = s * h[0], s * h[1], s * h[2]
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


@inline
def _half_exponent(base, middle, tip):
    """Half the sixth-order Magnus exponent in so(3): `magnus.exponent` without its translations."""
    s0 = _FIRST * (base[0] - tip[0])
    s1 = _FIRST * (base[1] - tip[1])
    s2 = _FIRST * (base[2] - tip[2])
    r0 = _SECOND * (base[0] + tip[0] - 2.0 * middle[0])
    r1 = _SECOND * (base[1] + tip[1] - 2.0 * middle[1])
    r2 = _SECOND * (base[2] + tip[2] - 2.0 * middle[2])
    m0, m1, m2 = middle
    c = cross(middle, (s0, s1, s2))
    e = cross(middle, (2.0 * r0 + c[0], 2.0 * r1 + c[1], 2.0 * r2 + c[2]))
    last = cross(
        (c[0] - 20.0 * m0 - r0, c[1] - 20.0 * m1 - r1, c[2] - 20.0 * m2 - r2),
        (s0 - e[0] / 60, s1 - e[1] / 60, s2 - e[2] / 60),
    )
    return (
        0.5 * m0 + r0 / 24 + last[0] / 480,
        0.5 * m1 + r1 / 24 + last[1] / 480,
        0.5 * m2 + r2 / 24 + last[2] / 480,
    )
