"""One step of a rod under any loads, and of its tangents: `loaded_step` with a whole frame.

State: two orthonormal directions G, H of the world as the section sees them (the third is G × H), a
force F that follows the tip, the moment M, and the tip y, five tuples of three. With

    n = n1 G + n2 H + n3 G × H + F

the equations are those of `loaded_step`, with n for w G, and dH = ω × H, dF = ω × F.

A tangent has the same parts. Beside initial values it is driven by a unit force at the tip along
one of the three directions, or by a change of activation: that changes ℓ by δℓ, and turns the
unloaded arm by `turn` over the step as the frames of the walk see it.
"""

from __future__ import annotations

from softreach.kernels.compiler import inline
from softreach.kernels.explicit_rk8 import step_function, sum3
from softreach.kernels.vector import cross, dot

__all__ = ["column_step", "state_step"]


@inline
def _mix(a, x, b, y):
    return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]


@inline
def _plus3(x, y):
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


@inline
def _span(c, g, h, k):
    return (
        c[0] * g[0] + c[1] * h[0] + c[2] * k[0],
        c[0] * g[1] + c[1] * h[1] + c[2] * k[1],
        c[0] * g[2] + c[1] * h[2] + c[2] * k[2],
    )


@inline
def _internal(node, s):
    """Force, twist and stretch of a section, and how the step turns the frame."""
    length, d, bending, twisting, axial, load = node
    g, h, f, m, _ = s
    n = _plus3(_span(load, g, h, cross(g, h)), f)
    twist, stretch = twisting * dot(d, m), 1.0 + axial * dot(d, n)
    return n, twist, stretch, _mix(length * bending, m, length * twist, d)


@inline
def _rates(node, s):
    """Changes over the step; node = (ℓ, d, 1/K1, 1/K3 - 1/K1, 1/K0, (n1, n2, n3))."""
    length, d = node[0], node[1]
    g, h, f, m, y = s
    n, twist, stretch, turn = _internal(node, s)
    push = _mix(length * twist, m, length * stretch, n)
    along = _times(length * stretch, d)
    return (
        cross(turn, g),
        cross(turn, h),
        cross(turn, f),
        cross(d, push),
        _plus3(cross(turn, y), along),
    )


@inline
def _tangent_rates(place, t):
    """Product rule on `_rates`; place = (node, state, (δℓ, turn, unit force))."""
    node, s, (d_length, d_turn, unit) = place
    length, d, bending, twisting, axial, load = node
    (g, h, _, m, y), (dg, dh, df, dm, dy) = s, t
    n, twist, stretch, turn = _internal(node, s)
    k, dk = cross(g, h), _plus3(cross(dg, h), cross(g, dh))
    dn = _plus3(_plus3(_span(load, dg, dh, dk), df), _span(unit, g, h, k))
    d_beta = length * twisting * dot(d, dm) + d_length * twist
    d_zeta = length * axial * dot(d, dn) + d_length * stretch
    turned = _plus3(_mix(length * bending, dm, d_beta, d), _mix(d_length * bending, m, 1.0, d_turn))
    pushed = _plus3(_mix(d_beta, m, length * twist, dm), _mix(d_zeta, n, length * stretch, dn))
    return (
        _plus3(cross(turn, dg), cross(turned, g)),
        _plus3(cross(turn, dh), cross(turned, h)),
        _plus3(cross(turn, df), cross(turned, s[2])),
        _plus3(cross(d, pushed), cross(d_turn, m)),
        _plus3(_plus3(cross(turn, dy), cross(turned, y)), _times(d_zeta, d)),
    )


@inline
def _times(a, x):
    return a * x[0], a * x[1], a * x[2]


@inline
def _plus(s, c, a, b, e, f, g, h):
    return (
        sum3(s[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        sum3(s[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
        sum3(s[2], c, a[2], b[2], e[2], f[2], g[2], h[2]),
        sum3(s[3], c, a[3], b[3], e[3], f[3], g[3], h[3]),
        sum3(s[4], c, a[4], b[4], e[4], f[4], g[4], h[4]),
    )


state_step = step_function(_rates, _plus)
"""Step of a state."""
column_step = step_function(_tangent_rates, _plus)
"""Step of a tangent, given the states at the stages."""
