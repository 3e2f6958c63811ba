"""Steps toward targets in space that no variable takes beyond its bounds (Levenberg, Marquardt).

A step d minimizes |r + J d|² + Σ μj dj² between bounds, for a residual r in space. However many
variables there are, its dual has three: y = r + J d, with dj = -Jj·y / μj cut off at the bounds,
solves a convex piecewise quadratic problem, by Newton's method with 3 x 3 matrices.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import cofactors, dot, minus, times

__all__ = ["bounded_steps"]

_ITERATIONS = 40
_HALVINGS = 12
_STEEP = 0.5  # of the slope where a step begins: one that ends on as steep a rise is halved
_FIRST, _RATIO = 1e-2, 0.1  # damping that Newton's method begins with, and how it falls
_PRECISE = 1e-9  # of the residual


@kernel
def bounded_steps(gamma, residual, slopes, damping, scales, low, high, trial, left):
    """Where each step ends, and the length of the residual that the linear map leaves.

    Args:
        gamma: Activations within the bounds, shape (n, m).
        residual: Tips minus targets, shape (n, 3).
        slopes: Derivatives of the tips, shape (n, 3, m).
        damping: Of the mean square of the columns of J, shape (n,).
        scales: Widths of the bounds, 1 where they are equal, shape (m,).
        low: Lower bounds, shape (m,).
        high: Upper bounds, shape (m,).
        trial: Result, shape (n, m).
        left: Result, |r + J d|, shape (n,).
    """
    m = gamma.shape[1]
    step, column = np.empty(m), np.empty((m, 3))
    lower, upper = np.empty(m), np.empty(m)
    for n in range(gamma.shape[0]):
        total = 0.0
        for j in range(m):
            for k in range(3):
                column[j, k] = slopes[n, k, j] * scales[j]
                total += column[j, k] ** 2
            lower[j] = min((low[j] - gamma[n, j]) / scales[j], 0.0)
            upper[j] = max((high[j] - gamma[n, j]) / scales[j], 0.0)
        mu = damping[n] * total / 3.0 + 1e-300
        r = (residual[n, 0], residual[n, 1], residual[n, 2])
        _least_squares(r, column, lower, upper, mu, _FIRST * total / 3.0, step)
        a, b, c = r
        for j in range(m):
            a += column[j, 0] * step[j]
            b += column[j, 1] * step[j]
            c += column[j, 2] * step[j]
            at = gamma[n, j] + scales[j] * step[j]
            trial[n, j] = min(max(at, low[j]), high[j])
        left[n] = math.sqrt(a * a + b * b + c * c)


@inline
def _least_squares(r, column, lower, upper, mu, most, step):
    """Write the step that minimizes |r + J d|² + μ |d|² between bounds, from larger μ down."""
    y, now = r, max(mu, most)
    enough = _PRECISE * math.sqrt(dot(r, r))
    while True:
        gradient, hessian = _dual(r, y, column, lower, upper, now, step)
        for _ in range(_ITERATIONS):
            if math.sqrt(dot(gradient, gradient)) <= enough:
                break
            direction = _solved(hessian, gradient)
            before, fall, t = y, dot(direction, gradient), 1.0
            for _ in range(_HALVINGS):
                y = minus(before, times(t, direction))
                gradient, hessian = _dual(r, y, column, lower, upper, now, step)
                if dot(direction, gradient) >= -_STEEP * fall:
                    break
                t *= 0.5
        if now <= mu:
            break
        now = max(mu, _RATIO * now)


@inline
def _dual(r, y, column, lower, upper, mu, step):
    """Gradient and Hessian of the dual function at y; the step that belongs to y."""
    g0, g1, g2 = y[0] - r[0], y[1] - r[1], y[2] - r[2]
    h00, h01, h02, h11, h12, h22 = 1.0, 0.0, 0.0, 1.0, 0.0, 1.0
    for j in range(column.shape[0]):
        c0, c1, c2 = column[j, 0], column[j, 1], column[j, 2]
        pull = -(c0 * y[0] + c1 * y[1] + c2 * y[2])
        d = pull / mu
        if d <= lower[j]:
            d = lower[j]
        elif d >= upper[j]:
            d = upper[j]
        else:
            h00 += c0 * c0 / mu
            h01 += c0 * c1 / mu
            h02 += c0 * c2 / mu
            h11 += c1 * c1 / mu
            h12 += c1 * c2 / mu
            h22 += c2 * c2 / mu
        step[j] = d
        g0 -= c0 * d
        g1 -= c1 * d
        g2 -= c2 * d
    return (g0, g1, g2), ((h00, h01, h02), (h01, h11, h12), (h02, h12, h22))


@inline
def _solved(a, b):
    """a⁻¹ b for a symmetric positive definite matrix."""
    c = cofactors(a)
    det = dot(a[0], c[0])
    return dot(c[0], b) / det, dot(c[1], b) / det, dot(c[2], b) / det
