"""One step of the loaded rod, from its tip end to its base end, in the frames of the unloaded arm.

There the world and the moment M turn with the load alone, theory (64), (66). With d the tangent of
the unloaded arm, λ = η dZ, ℓ = ζ̂ dZ and n the force beyond,

    dG = ω × G,  dH = ω × H,  dM = d × (β M + ζ n),  dy = ω × y + ζ d,
    ω = λ M/K1 + β d,  β = λ (1/K3 - 1/K1) (d·M),  ζ = ℓ + λ (d·n)/K0,

G, H two orthonormal directions of the world, y the tip, all as the section sees them. Where all
forces are along G it is n = w G, and nothing depends on H; else n = n1 G + n2 H + n3 G × H. A force
that follows the tip is fixed in that world too, as any frame on the rod is during one walk.

A tangent turns the world of a section by θ, so that δG = θ × G. It is (θ, δM, δy) with

    dθ = ω × θ + δω,  δn = θ × n + u1 G + u2 H + u3 G × H,

driven by its values at the tip, by a change of force u, or by a change of activation: that changes
λ by δλ and ℓ by δℓ, and turns the unloaded arm by δω̂ over the step, as the frames of the walk see
it.
"""

from __future__ import annotations

from softreach.kernels.compiler import inline
from softreach.kernels.loaded.explicit_rk8 import step_function, sums
from softreach.kernels.vector import combination, cross, dot, plus, times

__all__ = ["column_step", "direction_tip", "direction_walk", "frame_tip", "frame_walk"]

_NO_DRIVE = (0.0, 0.0, (0.0, 0.0, 0.0))


@inline
def _mix(a, x, b, y):
    return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]


@inline
def _yield(node, n, m):
    """β, ζ and ω; node = (λ, ℓ, d, 1/K1, 1/K3 - 1/K1, 1/K0, ...)."""
    rest_length, length, d, bending, twisting, axial, _ = node
    beta = rest_length * twisting * dot(d, m)
    zeta = length + rest_length * axial * dot(d, n)
    return beta, zeta, _mix(rest_length * bending, m, beta, d)


@inline
def _moment_rate(node, n, m, beta, zeta):
    return cross(node[2], _mix(beta, m, zeta, n))


@inline
def _tangent_rate(node, n, m, yields, theta, dm, dn, drive):
    """Product rule, theory (68), (73): dθ, dδM, and δω and δζ; drive = (δλ, δℓ, δω̂)."""
    rest_length, _, d, bending, twisting, axial, _ = node
    (beta, zeta, turn), (d_rest_length, d_length, d_turn) = yields, drive
    d_beta = rest_length * twisting * dot(d, dm) + d_rest_length * twisting * dot(d, m)
    d_zeta = rest_length * axial * dot(d, dn) + d_rest_length * axial * dot(d, n) + d_length
    turned = plus(
        _mix(rest_length * bending, dm, d_beta, d), _mix(d_rest_length * bending, m, 1.0, d_turn)
    )
    pushed = plus(_mix(d_beta, m, beta, dm), _mix(d_zeta, n, zeta, dn))
    return (
        plus(cross(turn, theta), turned),
        plus(cross(d, pushed), cross(d_turn, m)),
        turned,
        d_zeta,
    )


# Forces along one direction: the last of a node is w.


@inline
def _direction_rates(node, s):
    """Of (G, M, θ1, δM1, θ2, δM2); a turn about G itself changes nothing."""
    n, m = times(node[6], s[0]), s[1]
    yields = _yield(node, n, m)
    beta, zeta, turn = yields
    a = _tangent_rate(node, n, m, yields, s[2], s[3], cross(s[2], n), _NO_DRIVE)
    b = _tangent_rate(node, n, m, yields, s[4], s[5], cross(s[4], n), _NO_DRIVE)
    return cross(turn, s[0]), _moment_rate(node, n, m, beta, zeta), a[0], a[1], b[0], b[1]


@inline
def _direction_tip_rates(node, s):
    """Of (G, M, y)."""
    n, m = times(node[6], s[0]), s[1]
    beta, zeta, turn = _yield(node, n, m)
    dy = plus(cross(turn, s[2]), times(zeta, node[2]))
    return cross(turn, s[0]), _moment_rate(node, n, m, beta, zeta), dy


# Any loads: the last of a node is (n1, n2, n3), with the changes u of three tangents behind it.


@inline
def _frame_rates(node, s):
    """Of (G, H, M, θ1, δM1, θ2, δM2, θ3, δM3)."""
    axes, m = (s[0], s[1], cross(s[0], s[1])), s[2]
    load, u1, u2, u3 = node[6]
    n = combination(load, axes)
    yields = _yield(node, n, m)
    beta, zeta, turn = yields
    d1 = plus(cross(s[3], n), combination(u1, axes))
    d2 = plus(cross(s[5], n), combination(u2, axes))
    d3 = plus(cross(s[7], n), combination(u3, axes))
    a = _tangent_rate(node, n, m, yields, s[3], s[4], d1, _NO_DRIVE)
    b = _tangent_rate(node, n, m, yields, s[5], s[6], d2, _NO_DRIVE)
    c = _tangent_rate(node, n, m, yields, s[7], s[8], d3, _NO_DRIVE)
    dm = _moment_rate(node, n, m, beta, zeta)
    return cross(turn, s[0]), cross(turn, s[1]), dm, a[0], a[1], b[0], b[1], c[0], c[1]


@inline
def _frame_tip_rates(node, s):
    """Of (G, H, M, y)."""
    n, m = combination(node[6], (s[0], s[1], cross(s[0], s[1]))), s[2]
    beta, zeta, turn = _yield(node, n, m)
    dy = plus(cross(turn, s[3]), times(zeta, node[2]))
    return cross(turn, s[0]), cross(turn, s[1]), _moment_rate(node, n, m, beta, zeta), dy


@inline
def _column_rates(place, t):
    """Of (θ, δM, δy); place = (node, (G, H, M, y), (δλ, δℓ, δω̂, u))."""
    node, (g, h, m, y), (d_rest_length, d_length, d_turn, unit) = place
    axes = g, h, cross(g, h)
    n = combination(node[6], axes)
    dn = plus(cross(t[0], n), combination(unit, axes))
    yields, drive = _yield(node, n, m), (d_rest_length, d_length, d_turn)
    theta, dm, turned, d_zeta = _tangent_rate(node, n, m, yields, t[0], t[1], dn, drive)
    dy = plus(plus(cross(yields[2], t[2]), cross(turned, y)), times(d_zeta, node[2]))
    return theta, dm, dy


direction_walk = step_function(_direction_rates, sums(6))
"""Step of (G, M) and two tangents of it."""
direction_tip = step_function(_direction_tip_rates, sums(3))
"""Step of (G, M, y)."""
frame_walk = step_function(_frame_rates, sums(9))
"""Step of (G, H, M) and three tangents of it."""
frame_tip = step_function(_frame_tip_rates, sums(4))
"""Step of (G, H, M, y)."""
column_step = step_function(_column_rates, sums(3))
"""Step of one tangent, given the states at the stages."""
