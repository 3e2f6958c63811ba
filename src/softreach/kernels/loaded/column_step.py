"""One step of a rod under any loads, and of its tangents: `kernels.loaded.step` with a whole frame.

State: two orthonormal directions G, H of the world as the section sees them (the third is
K = G × H), the moment M, and the tip y, four tuples of three. With

    n = n1 G + n2 H + n3 K

the equations are those of `kernels.loaded.step`, with n for w G, and dH = ω × H, theory (66). A
force that follows the tip is fixed in that world too, as any frame on the rod is during one walk:
it adds to n1, n2, n3.

A tangent turns the whole frame of a section by θ, so that δG = θ × G. It is (θ, δM, δy) with

    dθ = ω × θ + δω,  δn = θ × n + u1 G + u2 H + u3 K,

driven by its values at the tip, by a change of force u, or by a change of activation: that changes
λ by δλ and ℓ by δℓ, and turns the unloaded arm by `turn` over the step as the frames of the walk
see it.
"""

from __future__ import annotations

from softreach.kernels.compiler import inline
from softreach.kernels.loaded.explicit_rk8 import step_function, sum3
from softreach.kernels.vector import combination, cross, dot, plus, times

__all__ = ["column_step", "state_step"]


@inline
def _mix(a, x, b, y):
    return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]


@inline
def _internal(node, s):
    """Force, twist and stretch by loads of a section, and how the step turns the frame."""
    growth, _, d, bending, twisting, axial, load = node
    g, h, m, _ = s
    n = combination(load, (g, h, cross(g, h)))
    twist, stretch = twisting * dot(d, m), axial * dot(d, n)
    return n, twist, stretch, _mix(growth * bending, m, growth * twist, d)


@inline
def _rates(node, s):
    """Changes over the step; node = (λ, ℓ, d, 1/K1, 1/K3 - 1/K1, 1/K0, (n1, n2, n3))."""
    growth, d = node[0], node[2]
    g, h, m, y = s
    n, twist, stretch, turn = _internal(node, s)
    length = node[1] + growth * stretch
    push = _mix(growth * twist, m, length, n)
    return cross(turn, g), cross(turn, h), cross(d, push), plus(cross(turn, y), times(length, d))


@inline
def _tangent_rates(place, t):
    """Product rule on `_rates`, theory (73); place = (node, state, (δλ, δℓ, turn, u))."""
    node, s, (d_growth, d_length, d_turn, unit) = place
    growth, length, d, bending, twisting, axial, _ = node
    (g, h, m, y), (theta, dm, dy) = s, t
    n, twist, stretch, turn = _internal(node, s)
    dn = plus(cross(theta, n), combination(unit, (g, h, cross(g, h))))
    d_beta = growth * twisting * dot(d, dm) + d_growth * twist
    d_zeta = growth * axial * dot(d, dn) + d_growth * stretch + d_length
    zeta = length + growth * stretch
    turned = plus(_mix(growth * bending, dm, d_beta, d), _mix(d_growth * bending, m, 1.0, d_turn))
    pushed = plus(_mix(d_beta, m, growth * twist, dm), _mix(d_zeta, n, zeta, dn))
    return (
        plus(cross(turn, theta), turned),
        plus(cross(d, pushed), cross(d_turn, m)),
        plus(plus(cross(turn, dy), cross(turned, y)), times(d_zeta, d)),
    )


@inline
def _plus(s, c, a, b, e, f, g, h):
    return (
        sum3(s[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        sum3(s[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
        sum3(s[2], c, a[2], b[2], e[2], f[2], g[2], h[2]),
        sum3(s[3], c, a[3], b[3], e[3], f[3], g[3], h[3]),
    )


@inline
def _plus_tangent(s, c, a, b, e, f, g, h):
    return (
        sum3(s[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        sum3(s[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
        sum3(s[2], c, a[2], b[2], e[2], f[2], g[2], h[2]),
    )


state_step = step_function(_rates, _plus)
"""Step of a state."""
column_step = step_function(_tangent_rates, _plus_tangent)
"""Step of a tangent, given the states at the stages."""
