"""Twists of tip frames by activations, of many rods: the exact derivative, in the walk of `tips`.

With g = exp(Ω1) ... exp(ΩK), the spatial twist dg g⁻¹ of the part of the rod beyond a step obeys
ξ <- dexp(dΩ) + Ad(exp Ω) ξ = ξ + dexp(dΩ + [Ω, ξ]): one column per bundle, theory (29).
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.rod.magnus import add, bracket, dexp, exponent, exponent_derivative
from softreach.kernels.rod.tips import (
    BEND_ROWS,
    LANES,
    TIP,
    TOGETHER,
    clear_tips,
    load,
    node_values,
    nodes_at,
    room,
    walk,
)


@inline
def _change(rest_length, weights, a):
    """Change of A = (ηu, ζ e3) dZ per unit of one activation, from its column of the table.

    Product rule on ω = ηu, with u = ω/η, theory (28).
    """
    ratio = weights[0] / rest_length
    return (
        ratio * a[0] + rest_length * weights[1],
        ratio * a[1] + rest_length * weights[2],
        ratio * a[2] + rest_length * weights[3],
        0.0,
        0.0,
        weights[4],
    )


@inline
def weights_at(column):
    """Changes of η dZ, u and ζ dZ at the nodes of a step, base first, in a column of its table."""
    t = column
    lengths = (t[12], t[13], t[14]) if len(t) > BEND_ROWS else (t[0], t[4], t[8])
    return (
        (t[0], t[1], t[2], t[3], lengths[0]),
        (t[4], t[5], t[6], t[7], lengths[1]),
        (t[8], t[9], t[10], t[11], lengths[2]),
    )


@inline
def step_column(nodes, rest_lengths, weights, omega, xi):
    """ξ <- ξ + dexp(dΩ + [Ω, ξ]): theory (29)."""
    base, middle, tip = nodes
    d_omega = exponent_derivative(
        base,
        middle,
        tip,
        _change(rest_lengths[0], weights[0], base),
        _change(rest_lengths[1], weights[1], middle),
        _change(rest_lengths[2], weights[2], tip),
    )
    return add(xi, dexp(omega, add(d_omega, bracket(omega, xi))))


@inline
def _walk_column(work, column, table, k, j, groups):
    """Carry one column of the Jacobian across step k, in groups of lanes of which one is in use."""
    weights = weights_at(table[k, :, j])
    for group in range(groups):
        for lane in range(TOGETHER):
            i = group * TOGETHER + lane
            nodes = nodes_at(work, i)
            lengths = work[i], work[4 * LANES + i], work[8 * LANES + i]
            xi = (
                column[i],
                column[LANES + i],
                column[2 * LANES + i],
                column[3 * LANES + i],
                column[4 * LANES + i],
                column[5 * LANES + i],
            )
            omega = exponent(nodes[0], nodes[1], nodes[2])
            xi = step_column(nodes, lengths, weights, omega, xi)
            for row in range(6):
                column[row * LANES + i] = xi[row]


def jacobians(table, gamma, tips, out):
    """Tips (n, 3) and spatial Jacobians (n, 6, bundle), linear rows first, of n activations."""
    columns = np.empty((gamma.shape[1], 6 * LANES))
    _jacobians(table, gamma, *room(table), columns, tips, out)


@kernel
def _jacobians(table, gamma, work, lanes, columns, tips, out):
    bundles = gamma.shape[1]
    for first in range(0, gamma.shape[0], LANES):
        count = min(LANES, gamma.shape[0] - first)
        groups = -(-count // TOGETHER)
        load(lanes, gamma, first, count)
        clear_tips(work)
        for j in range(bundles):
            for i in range(6 * LANES):
                columns[j, i] = 0.0
        for k in range(table.shape[0] - 1, -1, -1):
            node_values(work, lanes, table, k)
            for j in range(bundles):
                _walk_column(work, columns[j], table, k, j, groups)
            walk(work)
        _store(work, columns, first, count, tips, out)


@inline
def _store(work, columns, first, count, tips, out):
    """Columns hold (ω, v); the Jacobian has its linear rows first."""
    for i in range(count):
        for axis in range(3):
            tips[first + i, axis] = work[TIP + axis * LANES + i]
        for j in range(out.shape[2]):
            for row in range(6):
                out[first + i, row, j] = columns[j, (row + 3) % 6 * LANES + i]
