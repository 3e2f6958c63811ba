"""Bounds of what cells of the activation box reach: strains, and how near to a target they come."""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import dot, minus, row, times

__all__ = ["near_cells", "relative_strains"]


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


_TOGETHER = 64  # cells, so that the loop over them is innermost and short


@kernel
def relative_strains(centers, offset, stretch, curvature, longest, bending):
    """Write the largest relative extension and squared bending along the arm for each cell.

    Args:
        centers: Activations, shape (n, m).
        offset: Extension of a cell around zero, at every station, shape (station,).
        stretch: Its change with each activation, shape (station, m).
        curvature: Of each activation, shape (station, 3, m).
        longest: Result, largest offset + Σ stretch γ, shape (n,).
        bending: Result, largest |Σ curvature γ|², shape (n,).
    """
    count, bundles = centers.shape
    gamma = np.zeros((bundles, _TOGETHER))
    extension, square, part = np.empty(_TOGETHER), np.empty(_TOGETHER), np.empty(_TOGETHER)
    for first in range(0, count, _TOGETHER):
        size = min(_TOGETHER, count - first)
        for i in range(size):
            gamma[:, i] = centers[first + i]
            longest[first + i] = bending[first + i] = 0.0
        for s in range(len(offset)):
            extension[:] = offset[s]
            _add_products(stretch[s], gamma, extension)
            square[:] = 0.0
            for k in range(3):
                part[:] = 0.0
                _add_products(curvature[s, k], gamma, part)
                square += part * part
            for i in range(size):
                longest[first + i] = max(longest[first + i], extension[i])
                bending[first + i] = max(bending[first + i], square[i])


@inline
def _add_products(factors, gamma, out):
    for j in range(len(factors)):
        for i in range(_TOGETHER):
            out[i] += factors[j] * gamma[j, i]
