"""Where arms come nearest to themselves.

Two pieces can only where the arm turns by 1.77 rad between them: less keeps the chord of an arc
above 2/π of its length.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline
from softreach.kernels.room.cubics import at, turning, width
from softreach.kernels.vector import difference, dot, minus, plus, spot, times

_FARTHEST = 1e150  # as kernels know no infinity
_BACK, _TURN = 2.0 / math.pi, 1.76  # chord over arc of half a circle; twice its arc cosine
_MOST_PARTS = 64  # chords of a step
_MOST_MOVES = 40  # of two places toward each other
_FARTHEST_MOVE, _SMALL = 0.25, 1e-9  # over the gap, and the last one
_SMALLEST = 1e-3  # curvature of the gap in a move, times it


@inline
def folded(arms, steps, middles, curvature, i, sag, best):
    """The least gap between parts of an arm below `best` and half their width, and both places."""
    place, other, count, most, wide = -1.0, -1.0, len(curvature), 0.0, 0.0
    for k in range(count):
        curvature[k] = steps.bends[k] / (steps.lengths[k] * steps.lengths[k])
        most, wide = max(most, curvature[k]), max(wide, 2.0 * _widest(arms, i, k))
        for axis in range(3):
            middles[k, axis] = 0.5 * (arms.points[i, k, axis] + arms.points[i, k + 1, axis])
    if _is_open(most, steps.passed[count], wide):
        return best, place, other
    for k in range(count):
        turn, sharp = curvature[k] * steps.lengths[k], curvature[k]
        for m in range(k + 1, count):
            turn, sharp = turn + curvature[m] * steps.lengths[m], max(sharp, curvature[m])
            wide = _widest(arms, i, k) + _widest(arms, i, m)
            arc = steps.passed[m + 1] - steps.passed[k]
            if turn < _TURN or _is_open(sharp, arc, wide):
                continue
            reach = min(wide + min(best, 0.5 * wide), _BACK * arc)
            ball = max(reach + 0.5 * (steps.lengths[k] + steps.lengths[m]), 0.0)
            apart = difference(middles, k, m)
            if dot(apart, apart) >= ball * ball:
                continue
            p, q = spot(arms.points, i, k), spot(arms.points, i, k + 1)
            near = _chords(p, q, spot(arms.points, i, m), spot(arms.points, i, m + 1))[2]
            if near - (steps.bends[k] + steps.bends[m]) / 8.0 >= reach:
                continue
            gap, s, t = _nearest_chords(arms, steps, i, sag, k, m, reach)
            if gap - 2.0 * sag >= min(best, 0.5 * wide):
                continue
            gap, s, t = _refined(arms, steps, i, k, s, m, t)
            if gap < min(best, 0.5 * wide):
                best, place, other = gap, s, t
    return best, place, other


@inline
def _widest(arms, i, k):
    return max(arms.radius[i, k], arms.radius[i, k + 1])


@inline
def _is_open(curvature, arc, wide):
    """Whether a bend is too weak for ends apart by 1.5 widths and 2/π of the arc at most.

    By Schur's theorem they are at least as far apart as on a circle of that curvature, 2/κ
    sin(κs/2): then κs >= π, and 2π - 2 asin(3/4 κw), whose arc sine is 1.145 times it at most, or
    π/2 times. Constants are a little smaller, as curvatures are those of cubics.
    """
    sharp = curvature * wide
    return curvature * arc < max(3.1, 6.2 - (1.72 if sharp < 1.02 else 2.36) * sharp)


@inline
def _nearest_chords(arms, steps, i, sag, k, m, reach):
    """The least gap between chords of two steps, and the shares of these at which it is."""
    best, place, other = _FARTHEST, 0.0, 0.0
    some, many = _parts(steps.bends[k], sag), _parts(steps.bends[m], sag)
    first, last, q = spot(arms.points, i, m), spot(arms.points, i, m + 1), spot(arms.points, i, k)
    for a in range(some):
        p, q = q, at(arms, steps, i, k, (a + 1) / some)
        if _chords(p, q, first, last)[2] - sag - steps.bends[m] / 8.0 >= reach:
            continue
        y = first
        for b in range(many):
            x, y = y, at(arms, steps, i, m, (b + 1) / many)
            s, t, apart = _chords(p, q, x, y)
            s, t = (a + s) / some, (b + t) / many
            if not _is_back(steps, apart, k, s, m, t):
                # Both are nearest here; the parts that are farther apart along the arm may count.
                s, t, away = a / some, (b + 1) / many, minus(p, y)
                apart = math.sqrt(dot(away, away))
                if not _is_back(steps, apart, k, s, m, t):
                    continue
            apart -= width(arms, i, k, s) + width(arms, i, m, t)
            if apart < best:
                best, place, other = apart, s, t
    return best, place, other


@inline
def _is_back(steps, apart, k, s, m, t):
    """Whether an arm turns back between two places; not so where rounding alone parts them."""
    arc = steps.passed[m] - steps.passed[k] + t * steps.lengths[m] - s * steps.lengths[k]
    return apart + _SMALL * steps.lengths[k] < _BACK * arc


@inline
def _parts(bend, sag):
    """Number of chords from which the cubic of a step bulges by no more than the sag."""
    return min(max(math.ceil(math.sqrt(bend / (8.0 * sag))), 1), _MOST_PARTS)


@inline
def _chords(p, q, r, x):
    """Shares of chords from p to q and from r to x at which these come nearest, and how near."""
    u, v, w = minus(q, p), minus(x, r), minus(p, r)
    uu, vv, uv, uw, vw = dot(u, u), dot(v, v), dot(u, v), dot(u, w), dot(v, w)
    size, s = uu * vv - uv * uv, 0.0
    if size > 1e-12 * uu * vv:
        s = min(max((uv * vw - uw * vv) / size, 0.0), 1.0)
    t = (uv * s + vw) / max(vv, 1e-300)
    if t < 0.0 or t > 1.0:
        t = min(max(t, 0.0), 1.0)
        s = min(max((uv * t - uw) / max(uu, 1e-300), 0.0), 1.0)
    apart = plus(w, minus(times(s, u), times(t, v)))
    return s, t, math.sqrt(dot(apart, apart))


@inline
def _refined(arms, steps, i, k, s, m, t):
    """The least gap between two parts of an arm close to shares s, t of steps k, m, and places.

    By Newton's method along the arc, of which each step must shorten the gap.
    """
    best, along, across = _FARTHEST, 0.0, 0.0
    for _ in range(_MOST_MOVES):
        (a, u), (b, v) = _moved(steps.lengths, k, s, along), _moved(steps.lengths, m, t, across)
        apart = minus(at(arms, steps, i, a, u), at(arms, steps, i, b, v))
        size = math.sqrt(dot(apart, apart))
        gap = size - width(arms, i, a, u) - width(arms, i, b, v)
        if gap >= best or (best < _FARTHEST and not _is_back(steps, size, a, u, b, v)):
            along, across = 0.5 * along, 0.5 * across
        else:
            best, k, s, m, t = gap, a, u, b, v
            along, across = _toward(arms, steps, i, k, s, m, t, times(1.0 / size, apart), size)
        if abs(along) + abs(across) < _SMALL * size:
            break
    return best, k + s, m + t


@inline
def _moved(lengths, k, t, arc):
    """Step and share at an arc from a share of step k, at the most in the step next to it."""
    t += arc / lengths[k]
    if t > 1.0 and k + 1 < len(lengths):
        return k + 1, min((t - 1.0) * lengths[k] / lengths[k + 1], 1.0)
    if t < 0.0 and k > 0:
        return k - 1, max(1.0 + t * lengths[k] / lengths[k - 1], 0.0)
    return k, min(max(t, 0.0), 1.0)


@inline
def _toward(arms, steps, i, k, s, m, t, n, size):
    """Newton's step to the least gap between two places, in arc; none beyond ends of the arm."""
    (u, du), (v, dv) = turning(arms, steps, i, k, s), turning(arms, steps, i, m, t)
    f = dot(n, u) - (arms.radius[i, k + 1] - arms.radius[i, k]) / steps.lengths[k]
    g = -dot(n, v) - (arms.radius[i, m + 1] - arms.radius[i, m]) / steps.lengths[m]
    a = dot(n, du) + (dot(u, u) - dot(n, u) ** 2) / size
    b = (dot(n, u) * dot(n, v) - dot(u, v)) / size
    c = -dot(n, dv) + (dot(v, v) - dot(n, v) ** 2) / size
    if k + s <= 0.0 and f > 0.0:
        f, b = 0.0, 0.0
    if m + t >= len(steps.lengths) and g < 0.0:
        g, b = 0.0, 0.0
    least = 0.5 * (a + c) - math.sqrt(0.25 * (a - c) ** 2 + b * b)
    more = max(_SMALLEST / size - least, 0.0)
    a, c = a + more, c + more
    along, across, scale = b * g - c * f, b * f - a * g, a * c - b * b
    scale = 1.0 / max(scale, (abs(along) + abs(across)) / (_FARTHEST_MOVE * size))
    return scale * along, scale * across
