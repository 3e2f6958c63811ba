"""The explicit Runge-Kutta method of order eight by Cooper and Verner, a maker of step functions.

[CooperVerner1972]: eleven stages, all on the five Lobatto nodes of a step, so that whatever depends
on the place alone is tabulated at four new places a step.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline

__all__ = ["NODES", "at_stages", "step_function", "sums"]

_S = math.sqrt(21)
NODES = (0.0, (7 - _S) / 14, 0.5, (7 + _S) / 14, 1.0)
"""Lobatto nodes of the unit step."""


_STAGES = tuple(
    (*row, 0.0, 0.0, 0.0, 0.0)[:6]
    for row in (
        (1 / 2, 0.0),
        (1 / 4, 1 / 4),
        (1 / 7, (-7 - 3 * _S) / 98, (21 + 5 * _S) / 49),
        ((11 + _S) / 84, (18 + 4 * _S) / 63, (21 - _S) / 252),
        ((5 + _S) / 48, (9 + _S) / 36, (-231 + 14 * _S) / 360, (63 - 7 * _S) / 80),
        (
            *((10 - _S) / 42, (-432 + 92 * _S) / 315, (633 - 145 * _S) / 90),
            *((-504 + 115 * _S) / 70, (63 - 13 * _S) / 35),
        ),
        (1 / 14, (14 - 3 * _S) / 126, (13 - 3 * _S) / 63, 1 / 9),
        (1 / 32, (91 - 21 * _S) / 576, 11 / 72, (-385 - 75 * _S) / 1152, (63 + 13 * _S) / 128),
        (
            *(1 / 14, 1 / 9, (-733 - 147 * _S) / 2205, (515 + 111 * _S) / 504),
            *((-51 - 11 * _S) / 56, (132 + 28 * _S) / 245),
        ),
        (
            *((-42 + 7 * _S) / 18, (-18 + 28 * _S) / 45, (-273 - 53 * _S) / 72),
            *((301 + 53 * _S) / 72, (28 - 28 * _S) / 45, (49 - 7 * _S) / 18),
        ),
        (1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20),
    )
)
"""Coefficients of the slopes that each stage beside the first, and the far end, add up."""


@inline
def at_stages(nodes):
    """The nodes of the eleven stages from the five of a step."""
    n0, n1, n2, n3, n4 = nodes
    return n0, n2, n2, n3, n3, n2, n1, n1, n2, n3, n4


@inline
def _value(x, c, a, b, e, f, g, h):
    return x + c[0] * a + c[1] * b + c[2] * e + c[3] * f + c[4] * g + c[5] * h


@inline
def _sum(x, c, a, b, e, f, g, h):
    """x + Σ ci ki of tuples of three; a coefficient that is the literal 0 costs nothing."""
    return (
        _value(x[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        _value(x[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
        _value(x[2], c, a[2], b[2], e[2], f[2], g[2], h[2]),
    )


@inline
def _last(x, c, a, b, e, f, g, h):
    return (_sum(x[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),)


def sums(count):
    """A function x + Σ ci ki of states of so many vectors."""
    if count == 1:
        return _last
    rest = sums(count - 1)

    @inline
    def plus(x, c, a, b, e, f, g, h):
        first = _sum(x[0], c, a[0], b[0], e[0], f[0], g[0], h[0])
        return (first, *rest(x[1:], c, a[1:], b[1:], e[1:], f[1:], g[1:], h[1:]))

    return plus


def step_function(rates, plus):
    """A function that takes a state from the near end of a step to the far end.

    The step takes the eleven nodes of its stages (`at_stages`) and returns the states of all stages
    beside the last.

    Args:
        rates: Change of a state over the step, by a node and the state there.
        plus: A state plus Σ ci ki, of six coefficients and six slopes.
    """

    @inline
    def step(nodes, s):
        k1 = rates(nodes[0], s)
        s2 = plus(s, _STAGES[0], k1, k1, k1, k1, k1, k1)
        k2 = rates(nodes[1], s2)
        s3 = plus(s, _STAGES[1], k1, k2, k1, k1, k1, k1)
        k3 = rates(nodes[2], s3)
        s4 = plus(s, _STAGES[2], k1, k2, k3, k1, k1, k1)
        k4 = rates(nodes[3], s4)
        s5 = plus(s, _STAGES[3], k1, k3, k4, k1, k1, k1)
        k5 = rates(nodes[4], s5)
        s6 = plus(s, _STAGES[4], k1, k3, k4, k5, k1, k1)
        k6 = rates(nodes[5], s6)
        s7 = plus(s, _STAGES[5], k1, k3, k4, k5, k6, k1)
        k7 = rates(nodes[6], s7)
        s8 = plus(s, _STAGES[6], k1, k5, k6, k7, k1, k1)
        k8 = rates(nodes[7], s8)
        s9 = plus(s, _STAGES[7], k1, k5, k6, k7, k8, k1)
        k9 = rates(nodes[8], s9)
        s10 = plus(s, _STAGES[8], k1, k5, k6, k7, k8, k9)
        k10 = rates(nodes[9], s10)
        s11 = plus(s, _STAGES[9], k5, k6, k7, k8, k9, k10)
        k11 = rates(nodes[10], s11)
        end = plus(s, _STAGES[10], k1, k8, k9, k10, k11, k1)
        return end, (s, s2, s3, s4, s5, s6, s7, s8, s9, s10, s11)

    return step
