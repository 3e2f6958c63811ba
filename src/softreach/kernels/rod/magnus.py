"""One step of the rod: the sixth-order Magnus exponent from three Gauss nodes, and its derivative.

[Blanes2000], theory (21) and (22). Written for the point y seen from the moving frame, which
obeys y' = -A y from base to tip, hence y' = A y walking from the tip to the base: the nodes come in
the order of that walk, and the commutators have their textbook signs.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline
from softreach.kernels.rod.twist import add, bracket, cobracket, scaled

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
