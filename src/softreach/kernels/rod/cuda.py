"""Tips of many free rods on a GPU, one sample a thread, from the parts of the CPU's kernels.

Only the loops are written here: `exponent`, `act` and the derivative of a step are those of the
CPU. Sizes that a thread keeps in registers are constants, so that there is a kernel for each.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numba.cuda
import numpy as np
from numba import float64

from softreach.kernels.compiler import cuda_kernel, inline
from softreach.kernels.counting import PARTS, cell_of, rank_of, sector_of, uniform
from softreach.kernels.rod.jacobian import step_column, weights_at
from softreach.kernels.rod.magnus import act, exponent
from softreach.kernels.rod.tips import BEND_ROWS, node_twist
from softreach.kernels.vector import combination, cross, minus, plus

cuda: Any = numba.cuda  # without types
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


@lru_cache
def walk(bundles: int, derivatives: bool) -> Any:
    """Kernel (table, γ (n, bundle), point in the frame of the tip, tips (n, 3), moves).

    Moves, where derivatives are wanted, are twists (v, ω) of the tip's frame, shape (n, 6, bundle),
    or derivatives v + ω × r of the tips, shape (n, 3, bundle): theory (29) and (31).
    """

    @cuda_kernel
    def walk(table, gamma, start, tips, moves):
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
            point = act(omega, point)
            if derivatives:
                for j in range(bundles):
                    c = columns[j]
                    xi = c[0], c[1], c[2], c[3], c[4], c[5]
                    xi = step_column(nodes, lengths, weights_at(table[k, :, j]), omega, xi)
                    c[0], c[1], c[2], c[3], c[4], c[5] = xi
        tips[i, 0], tips[i, 1], tips[i, 2] = point
        if derivatives:
            for j in range(bundles):
                w = columns[j, 0], columns[j, 1], columns[j, 2]
                v = columns[j, 3], columns[j, 4], columns[j, 5]
                if moves.shape[1] == 3:
                    v = plus(v, cross(w, point))
                else:
                    moves[i, 3, j], moves[i, 4, j], moves[i, 5, j] = w
                moves[i, 0, j], moves[i, 1, j], moves[i, 2, j] = v

    return walk


@lru_cache
def cells(dim: int) -> Any:
    """Kernel that draws samples by their numbers and counts them as `kernels.counting.tally`.

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
            nodes, _ = _nodes(table, k, x, dim)
            point = act(exponent(nodes[0], nodes[1], nodes[2]), point)
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
