"""Tips of many free rods on a GPU, one sample a thread, from the parts of the CPU's kernels.

Only the loops are written here: `exponent`, `act` and the derivative of a step are those of the
CPU. Sizes that a thread keeps in registers are constants, so that there is a kernel for each.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numba import cuda, float64

from softreach.kernels.cells import PARTS, cell_of, rank_of, sector_of
from softreach.kernels.compiler import cuda_kernel, inline
from softreach.kernels.counter import uniform
from softreach.kernels.rod.jacobian import step_column, weights_at
from softreach.kernels.rod.magnus import exponent
from softreach.kernels.rod.tips import BEND_ROWS, node_twist
from softreach.kernels.rod.twist import act
from softreach.kernels.vector import combination, cross, minus, plus

THREADS = 128
"""Threads of a block."""


@inline
def _value(table, k, row, gamma, bundles):
    total = table[k, row, bundles]
    for j in range(bundles):
        total += table[k, row, j] * gamma[j]
    return total


@inline
def _node(table, k, node, gamma, bundles):
    """A = (ηu, ζ e3) dZ at one node of step k, and η dZ."""
    rest_length = _value(table, k, 4 * node, gamma, bundles)
    length = rest_length
    if table.shape[1] > BEND_ROWS:
        length = _value(table, k, BEND_ROWS + node, gamma, bundles)
    u1 = _value(table, k, 4 * node + 1, gamma, bundles)
    u2 = _value(table, k, 4 * node + 2, gamma, bundles)
    u3 = _value(table, k, 4 * node + 3, gamma, bundles)
    return node_twist(rest_length, u1, u2, u3, length), rest_length


@inline
def _nodes(table, k, gamma, bundles):
    """A at the three nodes of step k, base first, and η dZ there."""
    base, at_base = _node(table, k, 0, gamma, bundles)
    middle, at_middle = _node(table, k, 1, gamma, bundles)
    tip, at_tip = _node(table, k, 2, gamma, bundles)
    return (base, middle, tip), (at_base, at_middle, at_tip)


@inline
def _walk(table, k, gamma, bundles, point):
    """Carry a point across step k, toward the base."""
    nodes, _ = _nodes(table, k, gamma, bundles)
    return act(exponent(nodes[0], nodes[1], nodes[2]), point)


@lru_cache
def tips(bundles: int) -> Any:
    """Kernel (table, γ (n, bundle), point in the frame of the tip, tips (n, 3))."""

    @cuda_kernel
    def tips(table, gamma, start, out):
        i = cuda.grid(1)
        if i >= gamma.shape[0]:
            return
        g = cuda.local.array(bundles, float64)
        for j in range(bundles):
            g[j] = gamma[i, j]
        point = start[0], start[1], start[2]
        for k in range(table.shape[0] - 1, -1, -1):
            point = _walk(table, k, g, bundles, point)
        out[i, 0], out[i, 1], out[i, 2] = point

    return tips


@lru_cache
def moves(bundles: int) -> Any:
    """Kernel (table, γ, point, tips (n, 3), moves).

    Moves are twists (v, ω) of the tip's frame, shape (n, 6, bundle), or the derivatives v + ω × r
    of tips, shape (n, 3, bundle): theory (29) and (31).
    """

    @cuda_kernel
    def moves(table, gamma, start, out, moved):
        i = cuda.grid(1)
        if i >= gamma.shape[0]:
            return
        g = cuda.local.array(bundles, float64)
        columns = cuda.local.array((bundles, 6), float64)
        for j in range(bundles):
            g[j] = gamma[i, j]
            for row in range(6):
                columns[j, row] = 0.0
        point = start[0], start[1], start[2]
        for k in range(table.shape[0] - 1, -1, -1):
            nodes, lengths = _nodes(table, k, g, bundles)
            omega = exponent(nodes[0], nodes[1], nodes[2])
            for j in range(bundles):
                c = columns[j]
                xi = c[0], c[1], c[2], c[3], c[4], c[5]
                xi = step_column(nodes, lengths, weights_at(table[k, :, j]), omega, xi)
                c[0], c[1], c[2], c[3], c[4], c[5] = xi
            point = act(omega, point)
        out[i, 0], out[i, 1], out[i, 2] = point
        for j in range(bundles):
            w = columns[j, 0], columns[j, 1], columns[j, 2]
            v = columns[j, 3], columns[j, 4], columns[j, 5]
            if moved.shape[1] == 3:
                v = plus(v, cross(w, point))
            moved[i, 0, j], moved[i, 1, j], moved[i, 2, j] = v
            if moved.shape[1] == 6:
                moved[i, 3, j], moved[i, 4, j], moved[i, 5, j] = w

    return moves


@lru_cache
def cells(dim: int) -> Any:
    """Kernel that draws samples from a counter and does with them what `kernels.cells.tally` does.

    Its table is in coordinates of the unit cube; `pose` has the rows of the base's rotation and its
    place [m]; `first` is the number of the first of `count` samples.
    """

    @cuda_kernel
    def cells(table, start, pose, seed, first, count, weights, grid, shape, counts, sums, ranks):
        i = cuda.grid(1)
        if i >= count:
            return
        x = cuda.local.array(dim, float64)
        square = 0.0
        for j in range(dim):
            x[j] = uniform(seed, (first + np.uint64(i)) * np.uint64(dim) + np.uint64(j))
            square += weights[j] * x[j] * x[j]
        point = start[0], start[1], start[2]
        for k in range(table.shape[0] - 1, -1, -1):
            point = _walk(table, k, x, dim, point)
        point = plus(combination(point, pose), (pose[3, 0], pose[3, 1], pose[3, 2]))
        v = minus(point, (grid[4], grid[5], grid[6]))
        cuda.atomic.max(ranks, sector_of(v), rank_of(v, grid[7], i))
        cell = cell_of(point, (grid[0], grid[1], grid[2]), grid[3], shape)
        if cell < 0:
            return
        cuda.atomic.add(counts, cell, 1)
        for j in range(dim):
            cuda.atomic.add(sums, (cell, j), np.int64(x[j] * PARTS))
        cuda.atomic.add(sums, (cell, dim), np.int64(square * PARTS))

    return cells
