"""Bounds of what is left of tips beyond their quadratic parts, for many boxes at a time."""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import kernel

__all__ = ["cubic_errors"]


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
