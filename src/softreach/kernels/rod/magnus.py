"""One step of the rod: twists, their exponential, and the Magnus exponent of a step.

The sixth-order Magnus exponent from three Gauss nodes, and its derivative: [Blanes2000], theory
(21) and (22). Written for the point y seen from the moving frame, which obeys y' = -A y from base
to tip, hence y' = A y walking from the tip to the base: the nodes come in the order of that walk,
and the commutators have their textbook signs.

Twists (ω, v) of se(3) are tuples of six scalars, which live in registers; an array allocated in a
sample loop would cost more than the arithmetic. Zeros written as literals are folded away by the
compiler, so sparse twists need no code of their own.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline
from softreach.kernels.vector import cross

_TERMS = range(8)
"""Terms kept of each series in θ²: exact to rounding for θ <= 1, to 1e-13 for θ <= 1.5."""

# sin θ/θ, (1 - cos θ)/θ², (θ - sin θ)/θ³ as power series in θ², theory (24).
_SINC, _COSC, _SINC3 = (
    tuple((-1) ** k / math.factorial(2 * k + shift) for k in _TERMS) for shift in (1, 2, 3)
)

# Their derivatives by θ over θ, of the last two.
_COSC_SLOPE, _SINC3_SLOPE = (
    tuple(-2 * (k + 1) * (-1) ** k / math.factorial(2 * k + shift) for k in _TERMS)
    for shift in (4, 5)
)

# Coefficients of ad .. ad⁴ in the left-trivialized differential of exp [Selig2005]: reducing
# Σ adᵏ/(k+1)! with ad⁵ = -2θ² ad³ - θ⁴ ad leaves four functions of θ alone, theory (30), as series.
_DEXP = (
    tuple((-1) ** k * (1 - k) / math.factorial(2 * k + 2) for k in _TERMS),
    tuple((-1) ** k * (1 - k) / math.factorial(2 * k + 3) for k in _TERMS),
    tuple((-1) ** k * (1 + k) / math.factorial(2 * k + 4) for k in _TERMS),
    tuple((-1) ** k * (1 + k) / math.factorial(2 * k + 5) for k in _TERMS),
)
_DEXP1, _DEXP2, _DEXP3, _DEXP4 = _DEXP


@inline
def add(a, b):
    """a + b of two twists."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5]


@inline
def scaled(s, a):
    """s a."""
    return s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5]


@inline
def bracket(a, b):
    """[(ω1, v1), (ω2, v2)] = (ω1 × ω2, ω1 × v2 - ω2 × v1), theory (20)."""
    x, y, z = cross(a[:3], b[:3])
    p, q, r = cross(a[:3], b[3:])
    s, t, u = cross(b[:3], a[3:])
    return x, y, z, p - s, q - t, r - u


@inline
def cobracket(a, c):
    """The row of numbers for which its product with x is that of c with [a, x]."""
    x, y, z = cross(c[:3], a[:3])
    p, q, r = cross(c[3:], a[3:])
    s, t, u = cross(c[3:], a[:3])
    return x + p, y + q, z + r, s, t, u


@inline
def _series(t, c):
    """Horner's rule for eight terms."""
    high = c[4] + t * (c[5] + t * (c[6] + t * c[7]))
    return c[0] + t * (c[1] + t * (c[2] + t * (c[3] + t * high)))


@inline
def exp_coefficients(a):
    """sin θ/θ, (1 - cos θ)/θ² and (θ - sin θ)/θ³ of a twist's rotation."""
    t = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    return _series(t, _SINC), _series(t, _COSC), _series(t, _SINC3)


@inline
def act(a, p):
    """exp(a) applied to a point: p + v + ω × (s p + c v + ω × (c p + k v)), theory (23)."""
    s, c, k = exp_coefficients(a)
    w, v = a[:3], a[3:]
    inner = cross(w, (c * p[0] + k * v[0], c * p[1] + k * v[1], c * p[2] + k * v[2]))
    x = s * p[0] + c * v[0] + inner[0]
    y = s * p[1] + c * v[1] + inner[1]
    z = s * p[2] + c * v[2] + inner[2]
    outer = cross(w, (x, y, z))
    return p[0] + v[0] + outer[0], p[1] + v[1] + outer[1], p[2] + v[2] + outer[2]


@inline
def dexp(a, x):
    """d exp(a) exp(-a) along x: Σ ad_aᵏ x/(k+1)!, summed in closed form."""
    t = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    total = add(x, scaled(_series(t, _DEXP1), bracket(a, x)))
    second = bracket(a, bracket(a, x))
    total = add(total, scaled(_series(t, _DEXP2), second))
    third = bracket(a, second)
    total = add(total, scaled(_series(t, _DEXP3), third))
    return add(total, scaled(_series(t, _DEXP4), bracket(a, third)))


@inline
def exp_derivatives(a):
    """R of exp(a), and A and B of its differential: dexp(a) (ω, v) = (A ω, B ω + A v).

    A = I + c ŵ + k ŵ² with (w, v) = a, and B its derivative along v, as ad_a is w + εv in dual
    numbers. Rows of each matrix.
    """
    w0, w1, w2, v0, v1, v2 = a
    t, along = w0 * w0 + w1 * w1 + w2 * w2, w0 * v0 + w1 * v1 + w2 * v2
    s, c, k = _series(t, _SINC), _series(t, _COSC), _series(t, _SINC3)
    dc, dk = along * _series(t, _COSC_SLOPE), along * _series(t, _SINC3_SLOPE)
    turn = _polynomial(1.0 - c * t, s * w0, s * w1, s * w2, c, w0, w1, w2)
    first = _polynomial(1.0 - k * t, c * w0, c * w1, c * w2, k, w0, w1, w2)
    # k (v wᵀ + w vᵀ) + dk w wᵀ = x wᵀ + w xᵀ with x = k v + dk w / 2
    x0, x1, x2 = k * v0 + 0.5 * dk * w0, k * v1 + 0.5 * dk * w1, k * v2 + 0.5 * dk * w2
    e0, e1, e2 = c * v0 + dc * w0, c * v1 + dc * w1, c * v2 + dc * w2
    d = -2.0 * k * along - dk * t
    xy, xz, yz = x0 * w1 + w0 * x1, x0 * w2 + w0 * x2, x1 * w2 + w1 * x2
    second = (
        (d + 2.0 * x0 * w0, xy - e2, xz + e1),
        (xy + e2, d + 2.0 * x1 * w1, yz - e0),
        (xz - e1, yz + e0, d + 2.0 * x2 * w2),
    )
    return turn, first, second


@inline
def _polynomial(d, e0, e1, e2, k, w0, w1, w2):
    """d I + ê + k w wᵀ."""
    xy, xz, yz = k * w0 * w1, k * w0 * w2, k * w1 * w2
    return (
        (d + k * w0 * w0, xy - e2, xz + e1),
        (xy + e2, d + k * w1 * w1, yz - e0),
        (xz - e1, yz + e0, d + k * w2 * w2),
    )


NODES = (0.5 - math.sqrt(0.15), 0.5, 0.5 + math.sqrt(0.15))
"""Gauss-Legendre nodes of the unit step, base first."""

_FIRST = math.sqrt(15) / 3
_SECOND = 10 / 3


@inline
def _moments(base, middle, tip):
    """A at the middle of the step, and its first and second variation along the walk."""
    slope = scaled(_FIRST, add(base, scaled(-1.0, tip)))
    bend = scaled(_SECOND, add(add(base, tip), scaled(-2.0, middle)))
    return middle, slope, bend


@inline
def exponent(base, middle, tip):
    """Ω of the step [b1 + b3/12 + [-20 b1 - b3 + C1, b2 + C2]/240] from A at its three nodes."""
    return exponent_and_parts(base, middle, tip)[0]


@inline
def exponent_and_parts(base, middle, tip):
    """Ω, and what its derivative is made of: b1, b2, 2 b3 + C1 and both sides of the bracket."""
    b1, b2, b3 = _moments(base, middle, tip)
    c1 = bracket(b1, b2)
    inner = add(scaled(2.0, b3), c1)
    c2 = scaled(-1 / 60, bracket(b1, inner))
    left = add(add(scaled(-20.0, b1), scaled(-1.0, b3)), c1)
    right = add(b2, c2)
    omega = add(add(b1, scaled(1 / 12, b3)), scaled(1 / 240, bracket(left, right)))
    return omega, (b1, b2, inner, left, right)


@inline
def exponent_derivative(base, middle, tip, d_base, d_middle, d_tip):
    """The change of `exponent` when A changes by dA at the nodes: its product rule."""
    b1, b2, b3 = _moments(base, middle, tip)
    d1, d2, d3 = _moments(d_base, d_middle, d_tip)
    c1 = bracket(b1, b2)
    dc1 = add(bracket(d1, b2), bracket(b1, d2))
    outer, d_outer = add(scaled(2.0, b3), c1), add(scaled(2.0, d3), dc1)
    c2 = scaled(-1 / 60, bracket(b1, outer))
    dc2 = scaled(-1 / 60, add(bracket(d1, outer), bracket(b1, d_outer)))
    left = add(add(scaled(-20.0, b1), scaled(-1.0, b3)), c1)
    d_left = add(add(scaled(-20.0, d1), scaled(-1.0, d3)), dc1)
    d_last = add(bracket(d_left, add(b2, c2)), bracket(left, add(d2, dc2)))
    return add(add(d1, scaled(1 / 12, d3)), scaled(1 / 240, d_last))


@inline
def pulled_back(parts, row):
    """What multiplies dA at the nodes in `row` · dΩ, base first: the transpose of the derivative.

    Args:
        parts: As `exponent_and_parts` gives them.
        row: Six numbers.
    """
    b1, b2, inner, left, right = parts
    on_bracket = scaled(1 / 240, row)
    on_left = scaled(-1.0, cobracket(right, on_bracket))
    on_right = cobracket(left, on_bracket)
    on_c2 = scaled(-1 / 60, on_right)
    on_inner = cobracket(b1, on_c2)
    on_c1 = add(on_left, on_inner)
    to_b1 = add(cobracket(inner, on_c2), cobracket(b2, on_c1))
    on_b1 = add(add(row, scaled(-20.0, on_left)), scaled(-1.0, to_b1))
    on_b2 = scaled(_FIRST, add(on_right, cobracket(b1, on_c1)))
    on_b3 = add(add(scaled(1 / 12, row), scaled(-1.0, on_left)), scaled(2.0, on_inner))
    on_b3 = scaled(_SECOND, on_b3)
    at_middle = add(on_b1, scaled(-2.0, on_b3))
    return add(on_b2, on_b3), at_middle, add(scaled(-1.0, on_b2), on_b3)
