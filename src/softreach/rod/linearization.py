"""How far the tip map of a free rod can be from its linearization.

A change d of activation changes the twist by κ = ∂(ζu)/∂γ d = ζ U d + (z·d) u, and turns a section
by at most a = ∫ |κ|. From r = ∫ ζ d3 the second derivative along d is

r''[d, d] = ∫ 2 (z·d) ω × d3 + ζ ω' × d3 + ζ ω × (ω × d3),   |ω'| <= ½ a² + ∫ 2 |z·d| |U d|,

so that |r''[d, d]| <= ∫ 2 |z·d| a + ζ (3/2 a² + ∫ 2 |z·d| |U d|) with ζ and u at their largest in
the activation box. Here ω' is the change of ω = ∫ R κ, whose part ∫ ω × ω' is at most ½ a². The
remainder of the linearization is at most half of that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import both_sides, tables
from softreach.rod.activation_box import ActivationBox

__all__ = ["Linearization"]

Array = NDArray[np.float64]

_STATIONS = 201
_SAFETY = 1.02  # for quadrature, and for the steps of the map as it is computed
_MOST_SIGNS = 8  # bundles up to which all signs of d are tried


class Linearization:
    """The bound for one arm, its tables computed once."""

    def __init__(self, arm: Manipulator, box: ActivationBox) -> None:
        # Even in S, in which the response of a tapered arm is even.
        s = np.linspace(0.0, arm.profile.slender_length, _STATIONS)
        table = tables(arm, both_sides(arm, arm.profile.station(s)))
        self.stations, self.curvature = table.stations, table.curvature
        self.stretch = np.abs(table.extension)
        middle, half = 0.5 * (box.low + box.high), 0.5 * box.widths
        self.longest = 1.0 + table.extension @ middle + self.stretch @ half
        size = np.linalg.norm(self.curvature, axis=1)
        self.bending = np.linalg.norm(self.curvature @ middle, axis=1) + size @ half

    @property
    def longest_arm(self) -> float:
        """∫ ζ along the arm with every bundle at its longest [m]."""
        return _SAFETY * float(_integrals(self.longest, self.stations)[-1])

    def error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box."""
        free = np.flatnonzero(half_widths > 0)
        if not len(free):
            return 0.0
        stretch = self.stretch @ half_widths
        turned = self._turns(half_widths, free)
        turn = _integrals(self.longest * turned + stretch * self.bending, self.stations)
        # The square of a is convex in d, so that it is largest where all |dj| are.
        square = _integrals(1.5 * self.longest * turn**2, self.stations)[:, -1].max()
        most = turned.max(axis=0)
        inner = 2.0 * stretch * turn.max(axis=0)
        inner += self.longest * _integrals(2.0 * stretch * most, self.stations)
        return 0.5 * _SAFETY * float(square + _integrals(inner, self.stations)[-1])

    def _turns(self, half_widths: Array, free: NDArray[np.intp]) -> Array:
        """|U d| at every station for every d that counts, shape (d, station)."""
        of_each = self.curvature[:, :, free] * half_widths[free]
        if len(free) > _MOST_SIGNS:
            return np.linalg.norm(of_each, axis=1).sum(axis=1)[None]
        bits = np.arange(1 << (len(free) - 1))[:, None] >> np.arange(len(free)) & 1
        return np.linalg.norm(np.einsum("scj,dj->dsc", of_each, 1.0 - 2.0 * bits), axis=2)


def _integrals(values: Array, z: Array) -> Array:
    """∫ from the base to every station along the last axis, by trapezoids."""
    sums = np.cumsum(0.5 * np.diff(z) * (values[..., 1:] + values[..., :-1]), axis=-1)
    return np.concatenate([np.zeros_like(values[..., :1]), sums], axis=-1)
