"""Lower bounds of changes that meet three linear equations nearly, for many boxes at a time.

min ½ |x - c|² for low <= x <= high and |A x - b| <= e is no less, for any y of three numbers, than
min ½ |x - c|² + y·(A x - b) - e |y| over the box alone, and as much for the best y. The norm lies
below the parabola through it at any |y|, so that steps of `box_projection` with the softness e/|y|
never lead down.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.box.box_projection import climbs, dual, moved, newton, softened
from softreach.kernels.compiler import inline, kernel

__all__ = ["change_bounds"]

_MOST_ITERATIONS = 20
_CONVERGED = 1e-14  # of the bound that is wanted
_SHORTEST = 1e-9  # part of a step below which a search ends


@kernel
def change_bounds(center, slope, wanted, error, low, high, enough, out):
    """Write a lower bound of |x - c| for each box into `out`, shape (n,).

    Args:
        center: c, shape (n, m).
        slope: A, shape (n, 3, m).
        wanted: b, shape (n, 3).
        error: e > 0, shape (n,).
        low: Lower bounds, shape (n, m).
        high: Upper bounds, shape (n, m).
        enough: Bounds at which a search ends, shape (n,).
        out: Result, shape (n,).
    """
    x, side = np.empty_like(center), np.zeros(center.shape[1], np.int8)
    softness = np.empty(center.shape[0])
    problems = center, slope, wanted, softness, low, high
    for n in range(center.shape[0]):
        goal, most = 0.5 * enough[n] ** 2, 0.0
        softness[n] = error[n] / _usual_size(center, slope, low, high, n)
        y = 0.0, 0.0, 0.0
        for _ in range(_MOST_ITERATIONS):
            best, miss, gram, _ = dual(problems, n, y, x, side)
            size = math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
            most = max(most, best + 0.5 * softness[n] * size * size - error[n] * size)
            if most >= goal or _meets(center, x, n, miss, softness, y, error, goal):
                break
            # The softness changes, and with it what depends on it.
            now = error[n] / size if size > 0.0 else softness[n]
            less = softness[n] - now
            softness[n] = now
            best += 0.5 * less * size * size
            miss = moved(miss, less, y)
            step, ascent, _ = newton(softened(gram, -less), miss)
            if not ascent > _CONVERGED * goal:
                break
            size = climbs(problems, n, y, step, best, ascent, 1.0, _SHORTEST)
            if size == 0.0:
                break
            y = moved(y, size, step)
        out[n] = math.sqrt(2.0 * most)


@inline
def _usual_size(center, slope, low, high, n):
    """|y| if all of A had a part in the change to the middle of the box."""
    square, change = 0.0, 0.0
    for j in range(center.shape[1]):
        change += (0.5 * (low[n, j] + high[n, j]) - center[n, j]) ** 2
        for i in range(3):
            square += slope[n, i, j] ** 2
    return math.sqrt((change + 1e-30) / (square + 1e-30))


@inline
def _meets(center, x, n, miss, softness, y, error, goal):
    """True if x meets the equations by too small a change: then no bound is large enough."""
    square, change = 0.0, 0.0
    for i in range(3):
        square += (miss[i] + softness[n] * y[i]) ** 2
    for j in range(center.shape[1]):
        change += (x[n, j] - center[n, j]) ** 2
    return square <= error[n] ** 2 and 0.5 * change < goal
