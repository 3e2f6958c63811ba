"""Largest strains in many cells at a time, for bounds of what tips leave beyond linear parts."""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, kernel

__all__ = ["relative_strains"]

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
