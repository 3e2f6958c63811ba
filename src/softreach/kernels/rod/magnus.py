"""One step of the rod: the sixth-order Magnus exponent from three Gauss nodes, and its derivative.

[Blanes2000], theory (21) and (22). Written for the point y seen from the moving frame, which
obeys y' = -A y from base to tip, hence y' = A y walking from the tip to the base: the nodes come in
the order of that walk, and the commutators have their textbook signs.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline
from softreach.kernels.rod.twist import add, bracket, scaled

__all__ = ["NODES", "exponent", "exponent_derivative"]

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
    b1, b2, b3 = _moments(base, middle, tip)
    c1 = bracket(b1, b2)
    c2 = scaled(-1 / 60, bracket(b1, add(scaled(2.0, b3), c1)))
    left = add(add(scaled(-20.0, b1), scaled(-1.0, b3)), c1)
    return add(add(b1, scaled(1 / 12, b3)), scaled(1 / 240, bracket(left, add(b2, c2))))


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
