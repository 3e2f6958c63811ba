"""Directions between the nodes of an even grid over a box, cubic where they are smooth."""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel

UNEVEN = 1e3
"""Roughness of cells beside one that is cut."""


@kernel
def interpolate(values, rough, points, sizes, out, rough_there):
    """Interpolate by Lagrange's polynomials, in smooth cells cubic in each axis, linear in others.

    Args:
        values: Directions at the nodes (node, 3 direction), the last axis of the grid varying
            fastest.
        rough: Roughness of the cells (cell,).
        points: Places in cells from the first node (n, 3); outside the nearest cell is continued.
        sizes: Nodes of every axis, 1 or at least 4 (3,).
        out: Filled with unit vectors, (n, 3 direction).
        rough_there: Filled with the roughness of the cell of each place (n,).
    """
    weights, first, count = np.zeros((3, 4)), np.zeros(3, np.int64), np.zeros(3, np.int64)
    for n in range(points.shape[0]):
        cell = 0
        for axis in range(3):
            first[axis] = min(max(int(np.floor(points[n, axis])), 0), max(sizes[axis] - 2, 0))
            cell = cell * max(sizes[axis] - 1, 1) + first[axis]
        rough_there[n] = rough[cell]
        for axis in range(3):
            count[axis] = min(sizes[axis], 4 if rough[cell] < UNEVEN else 2)
            if count[axis] == 4:
                first[axis] = min(max(first[axis] - 1, 0), sizes[axis] - 4)
            _weigh(weights[axis], points[n, axis] - first[axis], count[axis])
        for c in range(0, out.shape[1], 3):
            x = y = z = 0.0
            for i in range(count[0]):
                for j in range(count[1]):
                    row = ((first[0] + i) * sizes[1] + first[1] + j) * sizes[2] + first[2]
                    of_row = weights[0, i] * weights[1, j]
                    for k in range(count[2]):
                        weight = of_row * weights[2, k]
                        x += weight * values[row + k, c]
                        y += weight * values[row + k, c + 1]
                        z += weight * values[row + k, c + 2]
            size = max(math.sqrt(x * x + y * y + z * z), 1e-300)
            out[n, c], out[n, c + 1], out[n, c + 2] = x / size, y / size, z / size


@inline
def _weigh(weights, x, count):
    if count == 4:
        weights[0] = (x - 1.0) * (x - 2.0) * (3.0 - x) / 6.0
        weights[1] = x * (x - 2.0) * (x - 3.0) / 2.0
        weights[2] = x * (x - 1.0) * (3.0 - x) / 2.0
        weights[3] = x * (x - 1.0) * (x - 2.0) / 6.0
    else:
        weights[0], weights[1] = (1.0, 0.0) if count == 1 else (1.0 - x, x)
