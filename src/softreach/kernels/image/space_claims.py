"""Nearest of many points to each center of a lattice, among those in the cubes around."""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import kernel

__all__ = ["claim_corners"]


@kernel
def claim_corners(points, number, steps, closest, owner):
    """Let each point claim the corners of its cube that none before it is as close to.

    Args:
        points: In cells from the first center, within the lattice, shape (n, 3).
        number: Number to write where a point is closest, shape (n,).
        steps: From a center to the next along each axis in the flat arrays, shape (3,).
        closest: Distance in cells below which a claim counts, lowered to the closest, flat.
        owner: Filled with the number of the closest, flat.
    """
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        i, j, k = np.int64(x), np.int64(y), np.int64(z)
        for corner in range(8):
            a, b, c = i + (corner >> 2), j + (corner >> 1 & 1), k + (corner & 1)
            away = math.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)
            cell = a * steps[0] + b * steps[1] + c * steps[2]
            if away < closest[cell]:
                closest[cell], owner[cell] = away, number[n]
