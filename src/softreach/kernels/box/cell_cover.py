"""Cells of the activation box that may come near a target."""

from __future__ import annotations

import math

from softreach.kernels.compiler import kernel
from softreach.kernels.vector import dot, minus, row, times

__all__ = ["near_cells"]


@kernel
def near_cells(tips, slopes, radii, errors, target, distance, out):
    """Write the numbers of the cells that may come within `distance` of a target into `out`.

    Args:
        tips: At the centers, shape (n, 3).
        slopes: Jacobians times half widths, shape (n, 3, m).
        radii: Sums of the lengths of their columns, shape (n,).
        errors: Largest distance of a tip from its linearization, shape (n,).
        target: Shape (3,).
        distance: Cells farther than this are left out.
        out: Room for all, shape (n,).

    Returns:
        Number of them.
    """
    count = 0
    p = target[0], target[1], target[2]
    for c in range(tips.shape[0]):
        away = minus(p, row(tips, c))
        apart = math.sqrt(dot(away, away))
        room = apart - errors[c] - distance
        if room > radii[c]:
            continue
        n = times(1.0 / max(apart, 1e-300), away)
        for j in range(slopes.shape[2]):
            room -= abs(n[0] * slopes[c, 0, j] + n[1] * slopes[c, 1, j] + n[2] * slopes[c, 2, j])
        if room <= 0.0:
            out[count] = c
            count += 1
    return count
