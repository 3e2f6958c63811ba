"""Bounds of what tips leave beyond linear and quadratic parts, in many cells at a time."""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel

__all__ = ["cubic_errors", "relative_strains"]

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
    """Add Σ factor γ of every cell."""
    for j in range(len(factors)):
        for i in range(_TOGETHER):
            out[i] += factors[j] * gamma[j, i]


@kernel
def cubic_errors(half, cell, longest, turned, forms, out):
    """Write l (c3 a³ + c1 a b) + a² s·h + b z·h for each box into `out`.

    There a is t times the root of the largest Σ Gjk dj dk for |dj| <= hj, which it is at a corner,
    and b is Σ Bjk hj hk.

    Args:
        half: h, shape (n, m).
        cell: Number of the cell in which each box lies, shape (n,).
        longest: l of each cell, shape (cell,).
        turned: t of each cell, shape (cell,).
        forms: G and B, shape (m, m); z and s, shape (m,); c3 and c1.
        out: Result, shape (n,).
    """
    turns, stretched_turns, stretches, turned_stretches, thrice, once = forms
    n, m = half.shape
    products = np.empty((m, m))
    for i in range(n):
        b, plain, weighted = 0.0, 0.0, 0.0
        for j in range(m):
            plain += stretches[j] * half[i, j]
            weighted += turned_stretches[j] * half[i, j]
            for k in range(m):
                product = half[i, j] * half[i, k]
                products[j, k] = turns[j, k] * product
                b += stretched_turns[j, k] * product
        most = 0.0
        for corner in range(1 << max(m - 1, 0)):
            square = 0.0
            for j in range(m):
                of_row = 0.5 * products[j, j]
                for k in range(j):
                    same = (corner >> j & 1) == (corner >> k & 1)
                    of_row += products[j, k] if same else -products[j, k]
                square += of_row
            most = max(most, 2.0 * square)
        a = turned[cell[i]] * math.sqrt(most)
        out[i] = longest[cell[i]] * a * (thrice * a * a + once * b) + a * a * weighted + b * plain
