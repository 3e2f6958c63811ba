"""Newton steps toward the minimum of a function in a box, for many functions at a time.

Variables on a bound that the gradient pushes outward stay there; the others take a Newton step,
damped until the Hessian is positive definite, and stop at their bounds (Bertsekas 1982).
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel

__all__ = ["box_steps"]

_LEAST_DAMPING = 1e-4  # of the largest diagonal entry
_DAMPINGS = 24


@kernel
def box_steps(gamma, gradient, hessian, damping, low, high, trial):
    """Write the end of each step (n, m) into `trial`; `damping` (n,) grows where it has to."""
    m = gamma.shape[1]
    factor, step = np.empty((m, m)), np.empty(m)
    free = np.empty(m, np.bool_)
    for n in range(gamma.shape[0]):
        largest = 0.0
        for i in range(m):
            down, up = gamma[n, i] <= low[i], gamma[n, i] >= high[i]
            slope = gradient[n, i]
            free[i] = not ((down and slope >= 0) or (up and slope <= 0) or low[i] == high[i])
            largest = max(largest, abs(hessian[n, i, i]))
        for _ in range(_DAMPINGS):
            if _factored(hessian, n, damping[n] * largest, free, factor):
                break
            damping[n] = max(10.0 * damping[n], _LEAST_DAMPING)
        _solve(factor, gradient, n, free, step)
        for i in range(m):
            trial[n, i] = min(max(gamma[n, i] + step[i], low[i]), high[i])


@inline
def _factored(hessian, n, shift, free, factor):
    """Cholesky of the free rows and columns plus a shift; whether it is positive definite."""
    m = factor.shape[0]
    for i in range(m):
        for j in range(i + 1):
            total = 0.5 * (hessian[n, i, j] + hessian[n, j, i]) if free[i] and free[j] else 0.0
            if i == j:
                total += shift if free[i] else 1.0
            scale = abs(total)
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total <= 1e-13 * scale:
                return False
            else:
                factor[i, i] = math.sqrt(total)
    return True


@inline
def _solve(factor, gradient, n, free, step):
    m = factor.shape[0]
    for i in range(m):
        total = -gradient[n, i] if free[i] else 0.0
        for k in range(i):
            total -= factor[i, k] * step[k]
        step[i] = total / factor[i, i]
    for i in range(m - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, m):
            total -= factor[k, i] * step[k]
        step[i] = total / factor[i, i]
