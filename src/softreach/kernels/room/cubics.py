"""Arms as cubics between the edges of their steps.

Each leads through two centers, with tangents as long as the arc, and its radius is linear.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from softreach.kernels.compiler import inline
from softreach.kernels.vector import plus, spot, times
from softreach.support.arrays import Array

ARC_SERIES = 1.0, 1 / 6, 3 / 40, 5 / 112, 35 / 1152, 63 / 2816
"""Of asin(√s)/√s: the arc of a circle over its chord, of which tangents differ by 2√s."""


class Arms(NamedTuple):
    """Arms at the edges of their steps."""

    points: Array  # Centers [m], shape (n, edge, 3)
    tangents: Array  # d3, shape (n, edge, 3)
    radius: Array  # Outer radius [m], shape (n, edge)
    tool: Array  # Point that a line leads to from the tip [m], shape (n, 3), or (0, 3)


class Steps(NamedTuple):
    """What is known of the steps of one arm, shape (step,) each."""

    lengths: Array  # Arcs [m]
    bends: Array  # Largest second derivatives by the share of the arc [m]
    speeds: Array  # Largest first derivatives [m]
    passed: Array  # Arcs from the base to edges [m], shape (step + 1,)


@inline
def measure(arms, i, steps):
    """Put what is known of the steps of arm i into place.

    The arc is that of a circle with chord and tangents of a step.
    """
    steps.passed[0] = 0.0
    for k in range(len(steps.lengths)):
        chord, square = 0.0, 0.0
        for axis in range(3):
            chord += (arms.points[i, k + 1, axis] - arms.points[i, k, axis]) ** 2
            square += (arms.tangents[i, k + 1, axis] - arms.tangents[i, k, axis]) ** 2
        s, series = 0.25 * square, 0.0
        for n in range(5, -1, -1):
            series = ARC_SERIES[n] + s * series
        length, speed, first, second = math.sqrt(chord) * series, 0.0, 0.0, 0.0
        for axis in range(3):
            apart = arms.points[i, k + 1, axis] - arms.points[i, k, axis]
            u, v = length * arms.tangents[i, k, axis], length * arms.tangents[i, k + 1, axis]
            speed += (3.0 * apart - u - v) ** 2
            first += (6.0 * apart - 4.0 * u - 2.0 * v) ** 2
            second += (6.0 * apart - 2.0 * u - 4.0 * v) ** 2
        steps.lengths[k], steps.bends[k] = length, math.sqrt(max(first, second))
        steps.speeds[k] = max(length, math.sqrt(speed))
        steps.passed[k + 1] = steps.passed[k] + length


@inline
def weights(length, t):
    """Those of both centers and of both tangents at a share t of the arc of a step."""
    return (
        (1.0 + 2.0 * t) * (1.0 - t) ** 2,
        t * t * (3.0 - 2.0 * t),
        length * t * (1.0 - t) ** 2,
        length * t * t * (t - 1.0),
    )


@inline
def _sum(arms, i, k, w):
    p, q = spot(arms.points, i, k), spot(arms.points, i, k + 1)
    u, v = spot(arms.tangents, i, k), spot(arms.tangents, i, k + 1)
    return plus(plus(times(w[0], p), times(w[1], q)), plus(times(w[2], u), times(w[3], v)))


@inline
def at(arms, steps, i, k, t):
    """The point of the cubic of step k at a share t of its arc."""
    return _sum(arms, i, k, weights(steps.lengths[k], t))


@inline
def turning(arms, steps, i, k, t):
    """First and second derivatives of that point by the arc."""
    length = steps.lengths[k]
    e = 6.0 * t * (1.0 - t) / length
    first = -e, e, (1.0 - t) * (1.0 - 3.0 * t), t * (3.0 * t - 2.0)
    e = (6.0 - 12.0 * t) / (length * length)
    second = -e, e, (6.0 * t - 4.0) / length, (6.0 * t - 2.0) / length
    return _sum(arms, i, k, first), _sum(arms, i, k, second)


@inline
def width(arms, i, k, t):
    """Radius there."""
    return arms.radius[i, k] + t * (arms.radius[i, k + 1] - arms.radius[i, k])
