"""Tips of many rods: the product of exponentials, applied to a point from the tip to the base.

r(L) = exp(Ω1) exp(Ω2) ... exp(ΩK) 0 needs no rotation matrices when read from the right: each step
moves one point. Samples lie innermost, LANES at a time, so that every loop over them vectorizes.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.rod.magnus import act, exponent

LANES = 128
"""Samples side by side: whole blocks only, so a sample's result never depends on its neighbors."""

# A workspace is a flat array of rows of LANES numbers: η dZ, u1, u2, u3 of three nodes, their ζ dZ,
# then 3 coordinates of the point. Rows at constant distances in one array are what the compiler can
# prove disjoint.
BEND_ROWS = 12
NODE_ROWS = BEND_ROWS + 3
TIP = NODE_ROWS * LANES
TOGETHER = 16  # lanes of derivatives: the last searches of many ask for a few rods at a time
WORK = TIP + 3 * LANES
_GROUP = 4  # bundles added at once


def pack(measure, stretch, rest_length_factor, curvature):
    """Node tables as one array (step, row, bundle + 1): rows η dZ, u1, u2, u3 of each node.

    Three rows ζ dZ follow where ζ is not η. The last column is the value at rest; bundles are
    padded with zeros to a multiple of four, and at least four.

    Args:
        measure: Length of the step as each node sees it [m], shape (step, 3).
        stretch: z [-], shape (step, 3, bundle).
        rest_length_factor: Its part in η [-], shape (step, 3, bundle).
        curvature: U [1/m], shape (step, 3, 3, bundle).
    """
    steps, _, bundles = stretch.shape
    table = np.zeros((steps, NODE_ROWS, -(-max(bundles, 1) // _GROUP) * _GROUP + 1))
    bends = table[:, :BEND_ROWS].reshape(steps, 3, 4, table.shape[-1])
    for rows, values in ((bends[:, :, 0], rest_length_factor), (table[:, BEND_ROWS:], stretch)):
        rows[..., :bundles] = measure[..., None] * values
        rows[..., -1] = measure
    bends[:, :, 1:, :bundles] = curvature
    return table if (rest_length_factor != stretch).any() else table[:, :BEND_ROWS].copy()


@inline
def load(lanes, gamma, first, count):
    """Lay the activations of `count` samples side by side, one row for each bundle."""
    for j in range(gamma.shape[1]):
        for i in range(count):
            lanes[j, i] = gamma[first + i, j]


@inline
def node_values(work, lanes, table, k):
    """η dZ, u = Uγ and ζ dZ at the nodes of step k, for every lane."""
    for row in range(table.shape[1]):
        values = work[row * LANES : (row + 1) * LANES]
        _first_group(values, lanes[0], lanes[1], lanes[2], lanes[3], table[k, row])
        for j in range(_GROUP, lanes.shape[0], _GROUP):
            weights = table[k, row, j:]
            _next_group(values, lanes[j], lanes[j + 1], lanes[j + 2], lanes[j + 3], weights)
    if table.shape[1] == BEND_ROWS:
        for node in range(3):
            for i in range(LANES):
                work[(BEND_ROWS + node) * LANES + i] = work[4 * node * LANES + i]


@inline
def _first_group(values, g0, g1, g2, g3, weights):
    a, b, c, d, constant = weights[0], weights[1], weights[2], weights[3], weights[-1]
    for i in range(LANES):
        values[i] = (constant + a * g0[i] + b * g1[i]) + (c * g2[i] + d * g3[i])


@inline
def _next_group(values, g0, g1, g2, g3, weights):
    a, b, c, d = weights[0], weights[1], weights[2], weights[3]
    for i in range(LANES):
        values[i] += (a * g0[i] + b * g1[i]) + (c * g2[i] + d * g3[i])


@inline
def nodes_at(work, i):
    """A = (ηu, ζ e3) dZ of lane i at the three nodes, base first."""
    at_base, at_middle, at_tip = work[12 * LANES + i], work[13 * LANES + i], work[14 * LANES + i]
    return (
        _lane(work, i, at_base),
        _lane(work, 4 * LANES + i, at_middle),
        _lane(work, 8 * LANES + i, at_tip),
    )


@inline
def _lane(work, i, length):
    return node_twist(work[i], work[LANES + i], work[2 * LANES + i], work[3 * LANES + i], length)


@inline
def node_twist(rest_length, u1, u2, u3, length):
    """A = (ηu, ζ e3) dZ of η dZ, u and ζ dZ."""
    return rest_length * u1, rest_length * u2, rest_length * u3, 0.0, 0.0, length


@inline
def clear_tips(work):
    """Put the point of every lane at the origin."""
    for i in range(TIP, WORK):
        work[i] = 0.0


@inline
def walk(work):
    """Carry the point of every lane across one step, toward the base."""
    for i in range(LANES):
        base, middle, tip = nodes_at(work, i)
        point = work[TIP + i], work[TIP + LANES + i], work[TIP + 2 * LANES + i]
        x, y, z = act(exponent(base, middle, tip), point)
        work[TIP + i] = x
        work[TIP + LANES + i] = y
        work[TIP + 2 * LANES + i] = z


def room(table):
    """Scratch of one call: a workspace and the lanes of activations.

    Made here, as a kernel that makes its own takes longer to compile.
    """
    return np.zeros(WORK), np.zeros((table.shape[2] - 1, LANES))


def tips(table, gamma, out):
    """Tip positions: (n, bundle) activations into (n, 3) `out`, in the units of `table`."""
    _tips(table, gamma, *room(table), out)


@kernel
def _tips(table, gamma, work, lanes, out):
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        load(lanes, gamma, first, count)
        clear_tips(work)
        for k in range(table.shape[0] - 1, -1, -1):
            node_values(work, lanes, table, k)
            walk(work)
        for i in range(count):
            for axis in range(3):
                out[first + i, axis] = work[TIP + axis * LANES + i]
