"""Nearest points of a box at which three linear equations hold, for many boxes at a time.

min ½ |x - c|² + |A x - b|²/(2 s) for low <= x <= high has the dual unknown y of three numbers only,
however many variables there are: x = clip(c - Aᵀy) with A x - b = s y. The dual function is
concave and piecewise quadratic; Newton's method with a line search maximizes it. Where hardly a
variable is between its bounds, Newton's step is as long as 1/s: the search along it is exact.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel

__all__ = ["climbs", "dual", "newton", "project"]

_MOST_ITERATIONS = 60
_CONVERGED = 1e-13  # of the largest terms
_SHORTEST_NEWTON = 0.2  # part of a step below which its best part is looked for
_MOST_BRACKETS = 100
_FLAT = 0.1  # part of the slope at the start of a step at which its end is good enough


@kernel
def project(center, slope, wanted, softness, low, high, out, multiplier):  # noqa: C901
    """Write x into `out` (n, m) and y into `multiplier` (n, 3).

    Args:
        center: c, shape (n, m).
        slope: A, shape (n, 3, m).
        wanted: b, shape (n, 3).
        softness: s > 0, shape (n,).
        low: Lower bounds, shape (n, m).
        high: Upper bounds, shape (n, m).
        out: x, shape (n, m).
        multiplier: y to begin with, 0 where nothing is known, and then y, shape (n, 3).
    """
    y, error, step, trial = np.zeros(3), np.zeros(3), np.zeros(3), np.zeros(3)
    gram = np.zeros((3, 3))
    for n in range(center.shape[0]):
        known = False
        for i in range(3):
            y[i] = multiplier[n, i]
            known = known or y[i] != 0.0
        best = dual(center, slope, wanted, softness, low, high, n, y, out, error, gram)
        for _ in range(_MOST_ITERATIONS):
            ascent = newton(gram, error, step)
            ends = center, slope, wanted, softness, low, high, n, y, step, trial
            if not ascent > _CONVERGED * (abs(best) + 1e-30):
                if not known:
                    break
                # Newton's last step from afar ends far below the tolerance.
                known = False
                for i in range(3):
                    trial[i] = y[i] + step[i]
            elif not climbs(ends, best, ascent, _SHORTEST_NEWTON):
                # As arguments: arrays in a tuple that is unpacked elsewhere too are counted.
                moves = _tops(center, slope, softness, low, high, n, y, step, trial, error, ascent)
                if not moves:
                    break
            y[:] = trial
            best = dual(center, slope, wanted, softness, low, high, n, y, out, error, gram)
        for i in range(3):
            multiplier[n, i] = y[i]


@inline
def climbs(ends, best, ascent, shortest):
    """Shorten a step until the dual function grows as it should; whether it does in time."""
    center, slope, wanted, softness, low, high, n, y, step, trial = ends
    size = 1.0
    while size > shortest:
        for i in range(3):
            trial[i] = y[i] + size * step[i]
        value = _value(center, slope, wanted, softness, low, high, n, trial)
        if value >= best + 0.1 * size * ascent:
            return True
        size *= 0.5
    return False


@inline
def _tops(center, slope, softness, low, high, n, y, step, trial, error, ascent):
    """Write the best end on the way of a step; False if that is where it begins.

    Along it the slope of the dual function falls piecewise linearly: Newton's method from either
    side of its zero, kept between the two.
    """
    square = step[0] * step[0] + step[1] * step[1] + step[2] * step[2]
    constant = error[0] * step[0] + error[1] * step[1] + error[2] * step[2]
    for j in range(center.shape[1]):
        along = _along(slope, n, j, step)
        constant -= along * _clipped(center, slope, low, high, n, j, y)
    first, last, size, before = 0.0, 1.0, 0.5, 1e300
    for _ in range(_MOST_BRACKETS):
        rise, fall = constant - size * softness[n] * square, softness[n] * square
        for j in range(center.shape[1]):
            along = _along(slope, n, j, step)
            unbounded = center[n, j] - _along(slope, n, j, y) - size * along
            x = min(max(unbounded, low[n, j]), high[n, j])
            rise += along * x
            fall += along * along * (x == unbounded)
        if 0.0 <= rise <= _FLAT * ascent:
            break
        first, last = (size, last) if rise > 0.0 else (first, size)
        ahead = size + rise / fall
        # Halves where Newton's steps do not, by orders of magnitude while the zero is so far.
        slow = abs(rise) > 0.5 * before
        before = abs(rise)
        if not first < ahead < last or slow:
            ahead = math.sqrt(first * last) if first > 0.0 else 1e-3 * last
        if abs(ahead - size) <= 1e-15 * size:
            break
        size = ahead
    moved = False
    for i in range(3):
        trial[i] = y[i] + size * step[i]
        moved = moved or trial[i] != y[i]
    return moved


@inline
def _along(slope, n, j, y):
    return slope[n, 0, j] * y[0] + slope[n, 1, j] * y[1] + slope[n, 2, j] * y[2]


@inline
def _clipped(center, slope, low, high, n, j, y):
    x = center[n, j] - slope[n, 0, j] * y[0] - slope[n, 1, j] * y[1] - slope[n, 2, j] * y[2]
    return min(max(x, low[n, j]), high[n, j])


@inline
def _value(center, slope, wanted, softness, low, high, n, y):
    """The dual function."""
    value = 0.0
    for i in range(3):
        value -= y[i] * wanted[n, i] + 0.5 * softness[n] * y[i] * y[i]
    for j in range(center.shape[1]):
        x = _clipped(center, slope, low, high, n, j, y)
        change = x - center[n, j]
        along = slope[n, 0, j] * y[0] + slope[n, 1, j] * y[1] + slope[n, 2, j] * y[2]
        value += 0.5 * change * change + along * x
    return value


@inline
def dual(center, slope, wanted, softness, low, high, n, y, out, error, gram):
    """The dual function with its gradient, minus its Hessian, and x."""
    value = 0.0
    for i in range(3):
        value -= y[i] * wanted[n, i] + 0.5 * softness[n] * y[i] * y[i]
        error[i] = -wanted[n, i] - softness[n] * y[i]
        for k in range(3):
            gram[i, k] = softness[n] if i == k else 0.0
    for j in range(center.shape[1]):
        a, b, c = slope[n, 0, j], slope[n, 1, j], slope[n, 2, j]
        unbounded = center[n, j] - a * y[0] - b * y[1] - c * y[2]
        x = min(max(unbounded, low[n, j]), high[n, j])
        out[n, j] = x
        change = x - center[n, j]
        value += 0.5 * change * change + (a * y[0] + b * y[1] + c * y[2]) * x
        error[0] += a * x
        error[1] += b * x
        error[2] += c * x
        if low[n, j] <= unbounded <= high[n, j]:  # at rest on a bound a variable may leave it
            gram[0, 0] += a * a
            gram[1, 0] += a * b
            gram[1, 1] += b * b
            gram[2, 0] += a * c
            gram[2, 1] += b * c
            gram[2, 2] += c * c
    return value


@inline
def newton(gram, error, step):
    """Solve for the step by Cholesky; return its slope of ascent."""
    l00 = math.sqrt(gram[0, 0])
    l10, l20 = gram[1, 0] / l00, gram[2, 0] / l00
    least = 1e-15 * (gram[0, 0] + gram[1, 1] + gram[2, 2])
    l11 = math.sqrt(max(gram[1, 1] - l10 * l10, least))
    l21 = (gram[2, 1] - l20 * l10) / l11
    l22 = math.sqrt(max(gram[2, 2] - l20 * l20 - l21 * l21, least))
    z0 = error[0] / l00
    z1 = (error[1] - l10 * z0) / l11
    z2 = (error[2] - l20 * z0 - l21 * z1) / l22
    step[2] = z2 / l22
    step[1] = (z1 - l21 * step[2]) / l11
    step[0] = (z0 - l10 * step[1] - l20 * step[2]) / l00
    return z0 * z0 + z1 * z1 + z2 * z2
