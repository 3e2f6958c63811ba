"""Nearest points of a box at which three linear equations hold, for many boxes at a time.

min ½ |x - c|² + |A x - b|²/(2 s) for low <= x <= high has the dual unknown y of three numbers only,
however many variables there are: x = clip(c - Aᵀy) with A x - b = s y. The dual function is
concave and piecewise quadratic; Newton's method with a line search maximizes it, from where the
maximum would be without bounds, and ends with a step inside one piece. Where hardly a variable is
between its bounds, Newton's step is as long as 1/s: it begins at 0, and the search along it is
exact.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import dot, minus, row, times

_MOST_ITERATIONS = 60
_CONVERGED = 1e-13  # of the largest terms
_SHORTEST_NEWTON = 0.2  # part of a step below which its best part is looked for
_MOST_BRACKETS = 100
_SURE = 1e-8  # pivot of a Gram matrix, part of its trace, from which Newton's step is exact
_FLAT = 0.1  # part of the slope at the start of a step at which its end is good enough


@kernel
def project(center, slope, wanted, softness, low, high, out, multiplier):
    """Write x into `out` (n, m) and y into `multiplier` (n, 3), 0 before where nothing is known.

    Of centers c (n, m), slopes A (n, 3, m), wanted b (n, 3), softness s > 0 (n,), bounds (n, m).
    """
    problems = center, slope, wanted, softness, low, high
    side = np.zeros(center.shape[1], np.int8)
    for n in range(center.shape[0]):
        y = multiplier[n, 0], multiplier[n, 1], multiplier[n, 2]
        guessed, sure, near = y[0] == 0.0 and y[1] == 0.0 and y[2] == 0.0, False, True
        if guessed:
            y, sure = _unbounded(problems, n)
            side[:] = 0
        best, error, gram, changed = dual(problems, n, y, out, side)
        within = sure and not changed  # all bounds
        for _ in range(0 if within else _MOST_ITERATIONS):
            step, ascent, sure = newton(gram, error)
            rises = ascent > _CONVERGED * (max(best, 0.0) + 1e-30)
            if not rises and not near:
                break
            # Newton's last step from afar ends far below the tolerance, where it may begin.
            near = near and rises
            before, y = y, moved(y, 1.0, step)
            value, slope_there, gram_there, changed = dual(problems, n, y, out, side)
            if rises and value < best + 0.1 * ascent:
                size = climbs(problems, n, before, step, best, ascent, 0.5, _SHORTEST_NEWTON)
                if size == 0.0 and guessed:
                    y, guessed = (0.0, 0.0, 0.0), False
                else:
                    if size == 0.0:
                        size = _top(problems, n, before, step, error, ascent)
                    y = moved(before, size, step)
                value, slope_there, gram_there, _ = dual(problems, n, y, out, side)
                if y[0] == before[0] and y[1] == before[1] and y[2] == before[2]:
                    break
            elif sure and not changed:
                break  # where the maximum of this piece of the dual function is
            best, error, gram = value, slope_there, gram_there
        multiplier[n, 0], multiplier[n, 1], multiplier[n, 2] = y


@inline
def _unbounded(problems, n):
    """Where the dual function would be largest without bounds, and whether that is sure."""
    center, slope, wanted, softness, _, _ = problems
    e0, e1, e2, s = -wanted[n, 0], -wanted[n, 1], -wanted[n, 2], softness[n]
    g00, g10, g11, g20, g21, g22 = s, 0.0, s, 0.0, 0.0, s
    for j in range(center.shape[1]):
        a, b, c, x = slope[n, 0, j], slope[n, 1, j], slope[n, 2, j], center[n, j]
        e0 += a * x
        e1 += b * x
        e2 += c * x
        g00 += a * a
        g10 += a * b
        g11 += b * b
        g20 += a * c
        g21 += b * c
        g22 += c * c
    step, _, sure = newton((g00, g10, g11, g20, g21, g22), (e0, e1, e2))
    return step, sure


@inline
def moved(y, size, step):
    """y + size · step."""
    return y[0] + size * step[0], y[1] + size * step[1], y[2] + size * step[2]


@inline
def climbs(problems, n, y, step, best, ascent, size, shortest):
    """The part of a step, from `size` down, by which the dual function grows as it should.

    0 if that is `shortest` at most.
    """
    while size > shortest:
        value = _value(problems, n, moved(y, size, step))
        if value >= best + 0.1 * size * ascent:
            return size
        size *= 0.5
    return 0.0


@inline
def _top(problems, n, y, step, error, ascent):
    """The part of a step at whose end the dual function is largest.

    Along it the slope of the dual function falls piecewise linearly: Newton's method from either
    side of its zero, kept between the two.
    """
    center, slope, _, softness, low, high = problems
    square = step[0] * step[0] + step[1] * step[1] + step[2] * step[2]
    constant = error[0] * step[0] + error[1] * step[1] + error[2] * step[2]
    for j in range(center.shape[1]):
        along = _along(slope, n, j, step)
        x = min(max(center[n, j] - _along(slope, n, j, y), low[n, j]), high[n, j])
        constant -= along * x
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
    return size


@inline
def _along(slope, n, j, y):
    return slope[n, 0, j] * y[0] + slope[n, 1, j] * y[1] + slope[n, 2, j] * y[2]


@inline
def _value(problems, n, y):
    """The dual function."""
    center, slope, wanted, softness, low, high = problems
    value = _quadratic(wanted, softness, n, y)
    for j in range(center.shape[1]):
        along = _along(slope, n, j, y)
        x = min(max(center[n, j] - along, low[n, j]), high[n, j])
        change = x - center[n, j]
        value += 0.5 * change * change + along * x
    return value


@inline
def _quadratic(wanted, softness, n, y):
    """What all pieces of the dual function share."""
    square = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
    return -(
        y[0] * wanted[n, 0] + y[1] * wanted[n, 1] + y[2] * wanted[n, 2] + 0.5 * softness[n] * square
    )


@inline
def dual(problems, n, y, out, side):
    """The dual function, its gradient and the lower half of minus its Hessian at y; x is written.

    And whether a variable is at another side of the box than `side` says, which is written, too: -1
    at the lower one, 1 at the upper one, 0 between them.
    """
    center, slope, wanted, softness, low, high = problems
    value, changed, s = _quadratic(wanted, softness, n, y), False, softness[n]
    e0, e1, e2 = -wanted[n, 0] - s * y[0], -wanted[n, 1] - s * y[1], -wanted[n, 2] - s * y[2]
    g00, g10, g11, g20, g21, g22 = s, 0.0, s, 0.0, 0.0, s
    for j in range(center.shape[1]):
        a, b, c = slope[n, 0, j], slope[n, 1, j], slope[n, 2, j]
        along = a * y[0] + b * y[1] + c * y[2]
        unbounded = center[n, j] - along
        x = min(max(unbounded, low[n, j]), high[n, j])
        out[n, j] = x
        change = x - center[n, j]
        value += 0.5 * change * change + along * x
        e0 += a * x
        e1 += b * x
        e2 += c * x
        at = (unbounded > high[n, j]) - (unbounded < low[n, j])
        changed |= at != side[j]
        side[j] = at
        # A branch would be taken at random. At rest on a bound too a variable may leave it.
        free = 1.0 if at == 0 else 0.0
        u, v, w = free * a, free * b, free * c
        g00 += u * a
        g10 += u * b
        g11 += v * b
        g20 += u * c
        g21 += v * c
        g22 += w * c
    return value, (e0, e1, e2), (g00, g10, g11, g20, g21, g22), changed


@inline
def newton(gram, error):
    """The step, by Cholesky without roots, and the slope of the dual function along it."""
    g00, g10, g11, g20, g21, g22 = gram
    size = g00 + g11 + g22
    least = 1e-15 * size
    i0 = 1.0 / g00
    l10, l20 = g10 * i0, g20 * i0
    d1 = max(g11 - l10 * g10, least)
    i1 = 1.0 / d1
    rest = g21 - l20 * g10
    l21 = rest * i1
    d2 = max(g22 - l20 * g20 - l21 * rest, least)
    i2 = 1.0 / d2
    z0 = error[0]
    z1 = error[1] - l10 * z0
    z2 = error[2] - l20 * z0 - l21 * z1
    ascent = z0 * z0 * i0 + z1 * z1 * i1 + z2 * z2 * i2
    z2 *= i2
    z1 = z1 * i1 - l21 * z2
    return (z0 * i0 - l10 * z1 - l20 * z2, z1, z2), ascent, min(g00, d1, d2) > _SURE * size


@kernel
def near_cells(tips, slopes, radii, errors, target, distance, out):
    """Number of the cells that may come within a distance of a target (3,), listed in `out` (n,).

    Cells have tips (n, 3) at their centers, slopes (n, 3, m) times half widths, radii (n,), the
    sums of the lengths of their columns, and errors (n,) of the linearization.
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
