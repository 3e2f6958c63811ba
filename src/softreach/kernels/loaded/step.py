"""One step of the loaded rod, from its tip end to its base end, in the frames of the unloaded arm.

There gravity G and the moment M turn with the load alone, theory (64). With d the tangent of the
unloaded arm, λ = η dZ, ℓ = ζ̂ dZ and n = w G,

    dG = ω × G,  dM = d × (β M + ζ w G),  dy = ω × y + ζ d,
    ω = λ M/K1 + β d,  β = λ (1/K3 - 1/K1) (d·M),  ζ = ℓ + λ w (d·G)/K0,

y the tip seen from the section. A state (G, M) is a tuple of six, and so
is each of its tangents.
"""

from __future__ import annotations

from softreach.kernels.compiler import inline
from softreach.kernels.loaded.explicit_rk8 import step_function, sum3, sum6
from softreach.kernels.vector import cross, dot

__all__ = ["tangent_step", "tip_step"]


@inline
def _rate(node, x):
    """Change of (G, M) over the step at one node; node = (λ, ℓ, d, 1/K1, 1/K3 - 1/K1, 1/K0, w)."""
    growth, length, d, bending, twisting, axial, w = node
    g, m = x[:3], x[3:]
    beta = growth * twisting * dot(d, m)
    zeta = w * (length + growth * axial * w * dot(d, g))
    a = growth * bending
    turn = cross((a * m[0] + beta * d[0], a * m[1] + beta * d[1], a * m[2] + beta * d[2]), g)
    push = (beta * m[0] + zeta * g[0], beta * m[1] + zeta * g[1], beta * m[2] + zeta * g[2])
    return turn + cross(d, push)


@inline
def _tip_rate(node, x, y):
    """Change of the tip y as the section sees it."""
    growth, length, d, bending, twisting, axial, w = node
    g, m = x[:3], x[3:]
    a, beta = growth * bending, growth * twisting * dot(d, m)
    zeta = length + growth * axial * w * dot(d, g)
    turn = cross((a * m[0] + beta * d[0], a * m[1] + beta * d[1], a * m[2] + beta * d[2]), y)
    return turn[0] + zeta * d[0], turn[1] + zeta * d[1], turn[2] + zeta * d[2]


@inline
def _tangent_rate(node, x, t):
    """Product rule on `_rate`, for the tangents of theory (68)."""
    growth, length, d, bending, twisting, axial, w = node
    g, m, dg, dm = x[:3], x[3:], t[:3], t[3:]
    a, beta = growth * bending, growth * twisting * dot(d, m)
    zeta = w * (length + growth * axial * w * dot(d, g))
    d_beta, d_zeta = growth * twisting * dot(d, dm), growth * axial * w * w * dot(d, dg)
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
def _tip_rates(node, s):
    return _rate(node, s[0]), _tip_rate(node, s[0], s[1])


@inline
def _tip_plus(s, c, a, b, e, f, g, h):
    return (
        sum6(s[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        sum3(s[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
    )


@inline
def _tangent_rates(node, s):
    return _rate(node, s[0]), _tangent_rate(node, s[0], s[1]), _tangent_rate(node, s[0], s[2])


@inline
def _tangent_plus(s, c, a, b, e, f, g, h):
    return (
        sum6(s[0], c, a[0], b[0], e[0], f[0], g[0], h[0]),
        sum6(s[1], c, a[1], b[1], e[1], f[1], g[1], h[1]),
        sum6(s[2], c, a[2], b[2], e[2], f[2], g[2], h[2]),
    )


tip_step = step_function(_tip_rates, _tip_plus)
"""Step of ((G, M), y)."""
tangent_step = step_function(_tangent_rates, _tangent_plus)
"""Step of (G, M) and two tangents of it."""
