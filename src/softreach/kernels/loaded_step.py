"""One step of the loaded rod, from its tip end to its base end, in the frames of the unloaded arm.

There gravity G and the moment M turn with the load alone. With d the tangent of the unloaded arm,
ℓ = ζ̂ dZ and n = w G,

    dG = ω × G,  dM = d × (β M + ζ w G),  dy = ω × y + ζ d,
    ω = ℓ M/K1 + β d,  β = ℓ (1/K3 - 1/K1) (d·M),  ζ = ℓ (1 + w (d·G)/K0),

y the tip seen from the section. The integrator is the explicit one of order eight by Cooper and
Verner, eleven stages on the five Lobatto nodes of a step. A state (G, M) is a tuple of six, and so
is each of its tangents.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline
from softreach.kernels.vector import cross, dot

__all__ = ["tangent_step", "tip_step"]

_S = math.sqrt(21)


@inline
def _rate(node, x):
    """Change of (G, M) over the step at one node; node = (ℓ, d, 1/K1, 1/K3 - 1/K1, 1/K0, w)."""
    length, d, bending, twisting, axial, w = node
    g, m = x[:3], x[3:]
    beta = length * twisting * dot(d, m)
    zeta = length * w * (1.0 + axial * w * dot(d, g))
    a = length * bending
    turn = cross((a * m[0] + beta * d[0], a * m[1] + beta * d[1], a * m[2] + beta * d[2]), g)
    push = (beta * m[0] + zeta * g[0], beta * m[1] + zeta * g[1], beta * m[2] + zeta * g[2])
    return turn + cross(d, push)


@inline
def _tip_rate(node, x, y):
    """Change of the tip y as the section sees it."""
    length, d, bending, twisting, axial, w = node
    g, m = x[:3], x[3:]
    a, beta = length * bending, length * twisting * dot(d, m)
    zeta = length * (1.0 + axial * w * dot(d, g))
    turn = cross((a * m[0] + beta * d[0], a * m[1] + beta * d[1], a * m[2] + beta * d[2]), y)
    return turn[0] + zeta * d[0], turn[1] + zeta * d[1], turn[2] + zeta * d[2]


@inline
def _tangent_rate(node, x, t):
    """Product rule on `_rate`."""
    length, d, bending, twisting, axial, w = node
    g, m, dg, dm = x[:3], x[3:], t[:3], t[3:]
    a, beta = length * bending, length * twisting * dot(d, m)
    zeta = length * w * (1.0 + axial * w * dot(d, g))
    d_beta, d_zeta = length * twisting * dot(d, dm), length * axial * w * w * dot(d, dg)
    turn = cross((a * m[0] + beta * d[0], a * m[1] + beta * d[1], a * m[2] + beta * d[2]), dg)
    more = cross(
        (a * dm[0] + d_beta * d[0], a * dm[1] + d_beta * d[1], a * dm[2] + d_beta * d[2]), g
    )
    push = (
        beta * dm[0] + d_beta * m[0] + zeta * dg[0] + d_zeta * g[0],
        beta * dm[1] + d_beta * m[1] + zeta * dg[1] + d_zeta * g[1],
        beta * dm[2] + d_beta * m[2] + zeta * dg[2] + d_zeta * g[2],
    )
    return (turn[0] + more[0], turn[1] + more[1], turn[2] + more[2]) + cross(d, push)


@inline
def _sum(x, c, a, b, e, f, g, h):
    """x + Σ ci ki of one member; a coefficient that is the literal 0 costs nothing."""
    return (
        _value(x[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        _value(x[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
        _value(x[2], c, a[2], b[2], e[2], f[2], g[2], h[2]),
        _value(x[3], c, a[3], b[3], e[3], f[3], g[3], h[3]),
        _value(x[4], c, a[4], b[4], e[4], f[4], g[4], h[4]),
        _value(x[5], c, a[5], b[5], e[5], f[5], g[5], h[5]),
    )


@inline
def _sum3(x, c, a, b, e, f, g, h):
    return (
        _value(x[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        _value(x[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
        _value(x[2], c, a[2], b[2], e[2], f[2], g[2], h[2]),
    )


@inline
def _value(x, c, a, b, e, f, g, h):
    return x + c[0] * a + c[1] * b + c[2] * e + c[3] * f + c[4] * g + c[5] * h


def _method(rates, plus):
    """The integrator for states of one kind: their slopes, and their sums with six slopes."""

    @inline
    def step(nodes, s):
        n0, n1, n2, n3, n4 = nodes
        k1 = rates(n0, s)
        k2 = rates(n2, plus(s, (1 / 2, 0.0, 0.0, 0.0, 0.0, 0.0), k1, k1, k1, k1, k1, k1))
        k3 = rates(n2, plus(s, (1 / 4, 1 / 4, 0.0, 0.0, 0.0, 0.0), k1, k2, k1, k1, k1, k1))
        c = (1 / 7, (-7 - 3 * _S) / 98, (21 + 5 * _S) / 49, 0.0, 0.0, 0.0)
        k4 = rates(n3, plus(s, c, k1, k2, k3, k1, k1, k1))
        c = ((11 + _S) / 84, (18 + 4 * _S) / 63, (21 - _S) / 252, 0.0, 0.0, 0.0)
        k5 = rates(n3, plus(s, c, k1, k3, k4, k1, k1, k1))
        c = ((5 + _S) / 48, (9 + _S) / 36, (-231 + 14 * _S) / 360, (63 - 7 * _S) / 80, 0.0, 0.0)
        k6 = rates(n2, plus(s, c, k1, k3, k4, k5, k1, k1))
        c = (
            (10 - _S) / 42,
            (-432 + 92 * _S) / 315,
            (633 - 145 * _S) / 90,
            (-504 + 115 * _S) / 70,
            (63 - 13 * _S) / 35,
            0.0,
        )
        k7 = rates(n1, plus(s, c, k1, k3, k4, k5, k6, k1))
        c = (1 / 14, (14 - 3 * _S) / 126, (13 - 3 * _S) / 63, 1 / 9, 0.0, 0.0)
        k8 = rates(n1, plus(s, c, k1, k5, k6, k7, k1, k1))
        c = (1 / 32, (91 - 21 * _S) / 576, 11 / 72, (-385 - 75 * _S) / 1152, (63 + 13 * _S) / 128, 0.0)
        k9 = rates(n2, plus(s, c, k1, k5, k6, k7, k8, k1))
        c = (
            1 / 14,
            1 / 9,
            (-733 - 147 * _S) / 2205,
            (515 + 111 * _S) / 504,
            (-51 - 11 * _S) / 56,
            (132 + 28 * _S) / 245,
        )
        k10 = rates(n3, plus(s, c, k1, k5, k6, k7, k8, k9))
        c = (
            (-42 + 7 * _S) / 18,
            (-18 + 28 * _S) / 45,
            (-273 - 53 * _S) / 72,
            (301 + 53 * _S) / 72,
            (28 - 28 * _S) / 45,
            (49 - 7 * _S) / 18,
        )
        k11 = rates(n4, plus(s, c, k5, k6, k7, k8, k9, k10))
        c = (1 / 20, 49 / 180, 16 / 45, 49 / 180, 1 / 20, 0.0)
        return plus(s, c, k1, k8, k9, k10, k11, k1)

    return step


@inline
def _tip_rates(node, s):
    return _rate(node, s[0]), _tip_rate(node, s[0], s[1])


@inline
def _tip_plus(s, c, a, b, e, f, g, h):
    return (
        _sum(s[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        _sum3(s[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
    )


@inline
def _tangent_rates(node, s):
    return _rate(node, s[0]), _tangent_rate(node, s[0], s[1]), _tangent_rate(node, s[0], s[2])


@inline
def _tangent_plus(s, c, a, b, e, f, g, h):
    return (
        _sum(s[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        _sum(s[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
        _sum(s[2], c, a[2], b[2], e[2], f[2], g[2], h[2]),
    )


tip_step = _method(_tip_rates, _tip_plus)
"""Step of ((G, M), y)."""
tangent_step = _method(_tangent_rates, _tangent_plus)
"""Step of (G, M) and two tangents of it."""
