"""Lower bounds of changes in cells whose tips are quadratic but for an error; cells made smaller.

In a cell |dj| <= hj the tip meets a target where A d + ½ H[d, d] + e u = b with |u| <= 1. Squares
and products of d are taken to be independent of each other: for any y of three numbers, half the
square of the change |g + d| is then no less than

L(y) = Σj min φj(dj) - Σj<k |y·Hjk| hj hk - e |y| - y·b,  φj = ½ (gj + dj)² + y·Aj dj + ½ y·Hjj dj²

with the minimum over |dj| <= hj. L is concave. Each of its terms |t| lies below the parabola
through t and -t, and so does min φj where dj is at a bound: Newton's steps with the curvatures of
these parabolas never lead down.

A cell may hold a change less than the goal only where φj exceeds its minimum by no more than
½ goal² - L(y), and only where, for any y of three numbers, dj lies as near to y·b as

e |y| + Σk |δjk - y·Ak| hk + ¼ Σk |y·Hkk| hk² + Σk<l |y·Hkl| hk hl

after a shift by ¼ Σk y·Hkk hk², as dj = y·(A d) + Σk (δjk - y·Ak) dk: y is taken to be what
estimates dj best if all d and products were independent and random.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.box.box_projection import newton
from softreach.kernels.compiler import inline, kernel

__all__ = ["contract"]

_MOST_ROUNDS = 6
_SHRINKS = 0.9  # a round that leaves more of the volume is the last
_MOST_ITERATIONS = 15
_WORTH = 1e-3  # of what lacks: a step that gains less is the last
_STRETCH = 1.5  # of a step: parabolas bend more than what lies above them
_KINK = 0.03  # |t| is a parabola within this part of what it is at most where y is as long
_KINK_OF_ERROR = 0.1
_OUTWARD = 1.0 + 1e-12


@kernel
def contract(  # noqa: C901
    center, half, multiplier, tips, slopes, seconds, error, wanted, near, goal, bound, axis
):
    """Make cells smaller in place, and write a lower bound of |x - near| for each into `bound`.

    Those whose bound is not below the goal hold no change below it that reaches the target.

    Args:
        center: c, shape (n, m).
        half: h, shape (n, m).
        multiplier: y to begin with, and the best one, shape (n, 3).
        tips: At the centers, shape (n, 3).
        slopes: A, shape (n, 3, m).
        seconds: H, symmetric, shape (n, 3, m, m).
        error: e > 0, shape (n,).
        wanted: The target, shape (n, 3).
        near: Shape (n, m).
        goal: Bounds at which a cell is done and which its bound does not exceed, shape (n,).
        bound: Result, shape (n,).
        axis: Result, that whose halving leaves the tip nearest to linear, shape (n,).
    """
    m = center.shape[1]
    pairs = m * (m - 1) // 2
    first, squares, g, d = np.zeros((3, m)), np.zeros((3, m)), np.zeros(m), np.zeros(m)
    products, sizes = np.zeros((3, max(pairs, 1))), np.zeros(max(pairs, 1))
    low, high, shift = np.zeros(m), np.zeros(m), np.zeros(m)
    y, b, gradient = np.zeros(3), np.zeros(3), np.zeros(3)
    gram, trial = np.zeros((3, 3)), np.zeros(3)
    for n in range(center.shape[0]):
        h, e, enough, best = half[n], error[n], 0.5 * goal[n] ** 2, 0.0
        for i in range(3):
            y[i], b[i] = multiplier[n, i], wanted[n, i] - tips[n, i]
            for j in range(m):
                first[i, j], squares[i, j] = slopes[n, i, j], seconds[n, i, j, j]
        for _ in range(_MOST_ROUNDS):
            _scale(seconds, n, h, products, sizes)
            _slabs(first, squares, products, h, b, e, gram, low, high)
            if _is_empty(low, high):
                best = enough
                break
            for j in range(m):
                g[j] = center[n, j] - near[n, j]
            terms = g, first, squares, products, sizes, h, b, e
            best = _highest(terms, enough, y, d, gradient, gram, trial)
            if best >= enough:
                break
            _levels(terms, y, d, enough - best, low, high)
            if _is_empty(low, high):
                best = enough
                break
            left = 1.0
            for j in range(m):
                shift[j], wide = 0.5 * (low[j] + high[j]), 0.5 * (high[j] - low[j])
                left *= wide / h[j] if h[j] > 0.0 else 1.0
                h[j] = wide
                center[n, j] += shift[j]
            for i in range(3):
                for j in range(m):
                    turned = 0.0
                    for k in range(m):
                        turned += seconds[n, i, j, k] * shift[k]
                    b[i] -= (first[i, j] + 0.5 * turned) * shift[j]
                    d[j] = turned
                for j in range(m):
                    first[i, j] += d[j]
            if left > _SHRINKS:
                break
        for i in range(3):
            multiplier[n, i] = y[i]
        bound[n] = min(math.sqrt(2.0 * max(best, 0.0)), goal[n])
        axis[n] = _most_bent(seconds, n, h)


@inline
def _most_bent(seconds, n, h):
    """The axis along which the second derivatives with all others leave most."""
    most, chosen = -1.0, 0
    for j in range(len(h)):
        bent = 0.0
        for k in range(len(h)):
            square = 0.0
            for i in range(3):
                square += seconds[n, i, j, k] ** 2
            bent += math.sqrt(square) * h[k]
        if bent * h[j] > most:
            most, chosen = bent * h[j], j
    return chosen


@inline
def _scale(seconds, n, h, products, sizes):
    """Products of d at their largest, Hjk hj hk, and their lengths."""
    p = 0
    for j in range(len(h)):
        for k in range(j):
            square = 0.0
            for i in range(3):
                products[i, p] = seconds[n, i, j, k] * h[j] * h[k]
                square += products[i, p] ** 2
            sizes[p] = math.sqrt(square) + 1e-300
            p += 1


@inline
def _slabs(first, squares, products, h, b, e, gram, low, high):
    """Write what the tip leaves of every dj."""
    m = len(h)
    for i in range(3):
        for k in range(i + 1):
            gram[i, k] = e * e if i == k else 0.0
            for j in range(m):
                gram[i, k] += first[i, j] * first[k, j] * h[j] ** 2
                gram[i, k] += 0.125 * squares[i, j] * squares[k, j] * h[j] ** 4
            for p in range(m * (m - 1) // 2):
                gram[i, k] += 0.5 * products[i, p] * products[k, p]
    # The inverse by cofactors.
    a00 = gram[1, 1] * gram[2, 2] - gram[2, 1] * gram[2, 1]
    a10 = gram[2, 0] * gram[2, 1] - gram[1, 0] * gram[2, 2]
    a20 = gram[1, 0] * gram[2, 1] - gram[2, 0] * gram[1, 1]
    a11 = gram[0, 0] * gram[2, 2] - gram[2, 0] * gram[2, 0]
    a21 = gram[1, 0] * gram[2, 0] - gram[0, 0] * gram[2, 1]
    a22 = gram[0, 0] * gram[1, 1] - gram[1, 0] * gram[1, 0]
    volume = max(gram[0, 0] * a00 + gram[1, 0] * a10 + gram[2, 0] * a20, 1e-300)
    for j in range(m):
        weight = h[j] ** 2 / volume
        u, v, w = first[0, j] * weight, first[1, j] * weight, first[2, j] * weight
        y0, y1 = a00 * u + a10 * v + a20 * w, a10 * u + a11 * v + a21 * w
        y2 = a20 * u + a21 * v + a22 * w
        middle = y0 * b[0] + y1 * b[1] + y2 * b[2]
        room = e * math.sqrt(y0 * y0 + y1 * y1 + y2 * y2)
        for k in range(m):
            along = y0 * first[0, k] + y1 * first[1, k] + y2 * first[2, k]
            room += h[k] * abs((1.0 if j == k else 0.0) - along)
            bend = y0 * squares[0, k] + y1 * squares[1, k] + y2 * squares[2, k]
            bend *= 0.25 * h[k] ** 2
            middle -= bend
            room += abs(bend)
        for p in range(m * (m - 1) // 2):
            room += abs(y0 * products[0, p] + y1 * products[1, p] + y2 * products[2, p])
        room *= _OUTWARD
        low[j], high[j] = max(-h[j], middle - room), min(h[j], middle + room)


@inline
def _is_empty(low, high):
    empty = False
    for j in range(len(low)):
        empty = empty or low[j] > high[j]
    return empty


@inline
def _levels(terms, y, d, lacks, low, high):
    """Cut from every dj where φj exceeds its minimum, at d, by more than so much."""
    g, first, squares = terms[0], terms[1], terms[2]
    for j in range(len(g)):
        slope = g[j] + y[0] * first[0, j] + y[1] * first[1, j] + y[2] * first[2, j]
        bend = 1.0 + y[0] * squares[0, j] + y[1] * squares[1, j] + y[2] * squares[2, j]
        if bend > 1e-9:
            # From the minimum of the parabola, which lies at d or beyond a bound.
            beyond = slope + bend * d[j]
            wide = math.sqrt(beyond * beyond + 2.0 * bend * lacks) / bend
            middle = -slope / bend
            low[j], high[j] = max(low[j], middle - wide), min(high[j], middle + wide)


@inline
def _highest(terms, enough, y, d, gradient, gram, trial):
    """Maximize L from y on, until it is enough; leave the best y, with d there."""
    g, first, squares, h = terms[0], terms[1], terms[2], terms[5]
    length = _usual_length(g, first)
    best = -1e300
    for _ in range(_MOST_ITERATIONS):
        size = math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
        length = size if size > 0.0 else length
        smooth, value = _dual(terms, y, length, d, gradient, gram)
        if value > best:
            best = value
            trial[:] = y
        lower = gram[0, 0], gram[1, 0], gram[1, 1], gram[2, 0], gram[2, 1], gram[2, 2]
        step, ascent, _ = newton(lower, (gradient[0], gradient[1], gradient[2]))
        if best >= enough or not ascent > _WORTH * (enough - smooth):
            break
        y[0] += _STRETCH * step[0]
        y[1] += _STRETCH * step[1]
        y[2] += _STRETCH * step[2]
    y[:] = trial
    for j in range(len(g)):
        d[j] = _lowest(g, first, squares, h, y, j)[0]
    return best


@inline
def _usual_length(g, first):
    """|y| if all of A had a part in the change."""
    change, size = 0.0, 0.0
    for j in range(len(g)):
        change += g[j] * g[j]
        for i in range(3):
            size += first[i, j] ** 2
    return math.sqrt((change + 1e-30) / (size + 1e-30))


@inline
def _lowest(g, first, squares, h, y, j):
    """dj where φj is least, with φj' at 0 and φj''."""
    slope = g[j] + y[0] * first[0, j] + y[1] * first[1, j] + y[2] * first[2, j]
    bend = 1.0 + y[0] * squares[0, j] + y[1] * squares[1, j] + y[2] * squares[2, j]
    if bend * h[j] > abs(slope):
        return -slope / bend, slope, bend
    return (h[j] if slope < 0.0 else -h[j]), slope, bend


@inline
def _dual(terms, y, length, d, gradient, gram):
    """L with kinks rounded off, which is no larger, and L; gradient, minus Hessian or more, d."""
    g, first, squares, products, sizes, h, b, e = terms
    y0, y1, y2 = y[0], y[1], y[2]
    size = math.sqrt(y0 * y0 + y1 * y1 + y2 * y2)
    kink = max(size, _KINK_OF_ERROR * length)
    bend = e / kink
    smooth = -0.5 * bend * (size * size + kink * kink)
    value = -e * size
    g0, g1, g2 = -b[0] - bend * y0, -b[1] - bend * y1, -b[2] - bend * y2
    a00, a11, a22, a10, a20, a21 = bend, bend, bend, 0.0, 0.0, 0.0
    common = -y0 * b[0] - y1 * b[1] - y2 * b[2]
    for j in range(len(g)):
        x, slope, curved = _lowest(g, first, squares, h, y, j)
        d[j] = x
        common += 0.5 * g[j] * g[j] + (slope + 0.5 * curved * x) * x
        half = 0.5 * x
        u = first[0, j] + squares[0, j] * half
        v = first[1, j] + squares[1, j] * half
        w = first[2, j] + squares[2, j] * half
        g0, g1, g2 = g0 + u * x, g1 + v * x, g2 + w * x
        u, v, w = u + squares[0, j] * half, v + squares[1, j] * half, w + squares[2, j] * half
        # The same where dj is at its bound and between.
        weight = abs(x) / max(abs(slope), 1e-3 * abs(x) + 1e-300)
        a00, a10, a20 = a00 + weight * u * u, a10 + weight * u * v, a20 + weight * u * w
        a11, a21, a22 = a11 + weight * v * v, a21 + weight * v * w, a22 + weight * w * w
    for p in range(len(g) * (len(g) - 1) // 2):
        u, v, w = products[0, p], products[1, p], products[2, p]
        t = y0 * u + y1 * v + y2 * w
        kink = max(abs(t), _KINK * length * sizes[p])
        weight = 1.0 / kink
        smooth -= 0.5 * (weight * t * t + kink)
        value -= abs(t)
        t *= weight
        g0, g1, g2 = g0 - t * u, g1 - t * v, g2 - t * w
        a00, a10, a20 = a00 + weight * u * u, a10 + weight * u * v, a20 + weight * u * w
        a11, a21, a22 = a11 + weight * v * v, a21 + weight * v * w, a22 + weight * w * w
    gradient[0], gradient[1], gradient[2] = g0, g1, g2
    gram[0, 0], gram[1, 0], gram[2, 0] = a00, a10, a20
    gram[1, 1], gram[2, 1], gram[2, 2] = a11, a21, a22
    return smooth + common, value + common
