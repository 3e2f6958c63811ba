"""One step of the loaded rod, from its tip end to its base end, in the frames of the unloaded arm.

There the world and the moment M turn with the load alone, theory (64), (66). With d the tangent of
the unloaded arm, λ = η dZ, ℓ = ζ̂ dZ and n the force beyond,

    dG = ω × G,  dH = ω × H,  dM = d × (β M + ζ n),  dy = ω × y + ζ d,
    ω = λ M/K1 + β d,  β = λ (1/K3 - 1/K1) (d·M),  ζ = ℓ + λ (d·n)/K0,

G, H two orthonormal directions of the world, y the tip, all as the section sees them. Where K2 is
another stiffness than K1, with e the axis of K2 in the unloaded arm, these are added:

    ω: κ e,  dM: κ e × M,  κ = λ (1/K2 - 1/K1) (e·M).

Where all forces are along G it is n = w G, and nothing depends on H; else
n = n1 G + n2 H + n3 G × H. A force that follows the tip is fixed in that world too, as any frame on
the rod is during one walk.

A tangent turns the world of a section by θ, so that δG = θ × G. It is (θ, δM, δy) with

    dθ = ω × θ + δω,  δn = θ × n + u1 G + u2 H + u3 G × H,

driven by its values at the tip, by a change of force u, or by a change of activation: that changes
λ by δλ and ℓ by δℓ, and turns the unloaded arm by δω̂ over the step, as the frames of the walk see
it. Neither d nor e change in these frames.

The steps are explicit Runge-Kutta steps of order eight [CooperVerner1972]: eleven stages, all on
the five Lobatto nodes of a step, so that whatever depends on the place alone is tabulated at four
new places a step.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from softreach.kernels.compiler import inline
from softreach.kernels.vector import combination, cross, dot, plus, times

_NO_DRIVE = (0.0, 0.0, (0.0, 0.0, 0.0))
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


def _sums(count):
    """A function x + Σ ci ki of states of so many vectors."""
    if count == 1:
        return _last
    rest = _sums(count - 1)

    @inline
    def plus(x, c, a, b, e, f, g, h):
        first = _sum(x[0], c, a[0], b[0], e[0], f[0], g[0], h[0])
        return (first, *rest(x[1:], c, a[1:], b[1:], e[1:], f[1:], g[1:], h[1:]))

    return plus


def _step_function(rates, plus):
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


@inline
def _mix(a, x, b, y):
    return a * x[0] + b * y[0], a * x[1] + b * y[1], a * x[2] + b * y[2]


@inline
def _yield(node, n, m):
    """β, ζ and ω; node = (λ, ℓ, d, 1/K1, 1/K3 - 1/K1, 1/K0, load), flat (..., 1/K2 - 1/K1, e)."""
    rest_length, length, d, bending, twisting, axial = node[:6]
    beta = rest_length * twisting * dot(d, m)
    zeta = length + rest_length * axial * dot(d, n)
    return beta, zeta, _mix(rest_length * bending, m, beta, d)


@inline
def _moment_rate(node, n, m, beta, zeta):
    return cross(node[2], _mix(beta, m, zeta, n))


@inline
def _tangent_rate(node, n, m, yields, theta, dm, dn, drive):
    """Product rule, theory (68), (73): dθ, dδM, and δω and δζ; drive = (δλ, δℓ, δω̂)."""
    rest_length, _, d, bending, twisting, axial = node[:6]
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


@inline
def _kappa(node, m):
    return node[0] * node[7] * dot(node[8], m)


@inline
def _flat_yield(node, n, m):
    beta, zeta, turn = _yield(node, n, m)
    return beta, zeta, plus(turn, times(_kappa(node, m), node[8]))


@inline
def _flat_moment_rate(node, n, m, beta, zeta):
    bent = times(_kappa(node, m), cross(node[8], m))
    return plus(_moment_rate(node, n, m, beta, zeta), bent)


@inline
def _flat_tangent_rate(node, n, m, yields, theta, dm, dn, drive):
    """The same with δκ = λ (1/K2 - 1/K1) (e·δM) + δλ (1/K2 - 1/K1) (e·M)."""
    d_theta, d_moment, turned, d_zeta = _tangent_rate(node, n, m, yields, theta, dm, dn, drive)
    d_kappa = _kappa(node, dm) + drive[0] * node[7] * dot(node[8], m)
    more = times(d_kappa, node[8])
    bent = cross(node[8], _mix(d_kappa, m, _kappa(node, m), dm))
    return plus(d_theta, more), plus(d_moment, bent), plus(turned, more), d_zeta


class Law(NamedTuple):
    """How sections yield: functions for β, ζ, ω, for dM, and for the rates of a tangent."""

    yields: Any
    moment_rate: Any
    tangent_rate: Any


class Steps(NamedTuple):
    """Steps of rods of one law; they return the states at their stages too."""

    direction_walk: Any
    """Of (G, M) and two tangents of it."""
    direction_tip: Any
    """Of (G, M, y)."""
    frame_walk: Any
    """Of (G, H, M) and three tangents of it."""
    frame_tip: Any
    """Of (G, H, M, y)."""
    column: Any
    """Of one tangent, given the states at the stages."""


def _steps_of(law):
    """Steps for round sections or flat ones."""
    walk, tip = _along_one(law)
    frame_walk, frame_tip = _in_space(law)
    column = _step_function(_column_rates_of(law), _sums(3))
    return Steps(walk, tip, frame_walk, frame_tip, column)


def _along_one(law):
    """Steps under forces along one direction: after six numbers a node has w."""
    yields, moment_rate, tangent_rate = law

    @inline
    def walk_rates(node, s):
        """Of (G, M, θ1, δM1, θ2, δM2); a turn about G itself changes nothing."""
        n, m = times(node[6], s[0]), s[1]
        known = yields(node, n, m)
        beta, zeta, turn = known
        a = tangent_rate(node, n, m, known, s[2], s[3], cross(s[2], n), _NO_DRIVE)
        b = tangent_rate(node, n, m, known, s[4], s[5], cross(s[4], n), _NO_DRIVE)
        return cross(turn, s[0]), moment_rate(node, n, m, beta, zeta), a[0], a[1], b[0], b[1]

    @inline
    def tip_rates(node, s):
        n, m = times(node[6], s[0]), s[1]
        beta, zeta, turn = yields(node, n, m)
        dy = plus(cross(turn, s[2]), times(zeta, node[2]))
        return cross(turn, s[0]), moment_rate(node, n, m, beta, zeta), dy

    return _step_function(walk_rates, _sums(6)), _step_function(tip_rates, _sums(3))


def _in_space(law):
    """Steps under any loads: a node has (n1, n2, n3), and the changes u of three tangents."""
    yields, moment_rate, tangent_rate = law

    @inline
    def walk_rates(node, s):
        """Of (G, H, M, θ1, δM1, θ2, δM2, θ3, δM3)."""
        axes, m = (s[0], s[1], cross(s[0], s[1])), s[2]
        load, u1, u2, u3 = node[6]
        n = combination(load, axes)
        known = yields(node, n, m)
        beta, zeta, turn = known
        d1 = plus(cross(s[3], n), combination(u1, axes))
        d2 = plus(cross(s[5], n), combination(u2, axes))
        d3 = plus(cross(s[7], n), combination(u3, axes))
        a = tangent_rate(node, n, m, known, s[3], s[4], d1, _NO_DRIVE)
        b = tangent_rate(node, n, m, known, s[5], s[6], d2, _NO_DRIVE)
        c = tangent_rate(node, n, m, known, s[7], s[8], d3, _NO_DRIVE)
        dm = moment_rate(node, n, m, beta, zeta)
        return cross(turn, s[0]), cross(turn, s[1]), dm, a[0], a[1], b[0], b[1], c[0], c[1]

    @inline
    def tip_rates(node, s):
        n, m = combination(node[6], (s[0], s[1], cross(s[0], s[1]))), s[2]
        beta, zeta, turn = yields(node, n, m)
        dy = plus(cross(turn, s[3]), times(zeta, node[2]))
        return cross(turn, s[0]), cross(turn, s[1]), moment_rate(node, n, m, beta, zeta), dy

    return _step_function(walk_rates, _sums(9)), _step_function(tip_rates, _sums(4))


def _column_rates_of(law):
    yields, _, tangent_rate = law

    @inline
    def rates(place, t):
        """Of (θ, δM, δy); place = (node, (G, H, M, y), (δλ, δℓ, δω̂, u))."""
        node, (g, h, m, y), (d_rest_length, d_length, d_turn, unit) = place
        axes = g, h, cross(g, h)
        n = combination(node[6], axes)
        dn = plus(cross(t[0], n), combination(unit, axes))
        known, drive = yields(node, n, m), (d_rest_length, d_length, d_turn)
        theta, dm, turned, d_zeta = tangent_rate(node, n, m, known, t[0], t[1], dn, drive)
        dy = plus(plus(cross(known[2], t[2]), cross(turned, y)), times(d_zeta, node[2]))
        return theta, dm, dy

    return rates


ROUND = _steps_of(Law(_yield, _moment_rate, _tangent_rate))
"""Steps of sections whose two bending stiffnesses are one."""
FLAT = _steps_of(Law(_flat_yield, _flat_moment_rate, _flat_tangent_rate))
"""Steps of sections with two."""
