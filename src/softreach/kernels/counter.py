"""Uniform numbers from a counter: number i is a function of the seed and i, on every device.

SplitMix64 [Steele2014]: the state after i steps is the seed plus i times an odd constant, so that
no number needs the one before it. 53 of its 64 bits make a number in [0, 1).
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import inline, kernel

_STEP = np.uint64(0x9E3779B97F4A7C15)
_FIRST = np.uint64(0xBF58476D1CE4E5B9)
_SECOND = np.uint64(0x94D049BB133111EB)
_27, _30, _31, _11 = np.uint64(27), np.uint64(30), np.uint64(31), np.uint64(11)
_UNIT = 2.0**-53


@inline
def uniform(seed, i):
    """Number i [-] of a seed, both uint64."""
    z = seed + (i + np.uint64(1)) * _STEP
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return np.float64((z ^ (z >> _31)) >> _11) * _UNIT


@kernel
def fill(seed, numbers, out):
    """Put the points of the unit cube with these numbers into place, shape (n, dim)."""
    n, dim = out.shape
    for i in range(n):
        for j in range(dim):
            out[i, j] = uniform(seed, numbers[i] * np.uint64(dim) + np.uint64(j))
