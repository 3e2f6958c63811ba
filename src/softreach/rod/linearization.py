"""Bounds of the distance of the tip map of a free rod from its linearization.

A change d of activation changes the twist ηu by κ = η U d + (y·d) u, with η = 1 + y·γ after the
change and u = Uγ before it; y is z of fibers and muscles and 0 of forces. In the frame of the base
κ' = Rκ turns what lies beyond a section: the frames after the change are QR with Q' = Q[κ'], Q = 1
at the base. Two steps of Picard's iteration leave

Q = 1 + [W] + ∫∫ Q [κ'] [κ'] over s < s',  W = ∫ κ',

whose last part is at most ½ a² with a = ∫ |κ|, as Q turns only. W is linear in d but for
∫ R (y·d) U d. So r = ∫ ζ Q d3 differs from its linearization by at most

∫ ½ ζ a² + ζ ∫ |y·d| |U d| + |z·d| a

with ζ, η and u at their largest in the activation box, or in the cell of it where γ + d lies.
(The largest second derivative bounds it by three halves of the first part.)

In a cell ζ and |u| are parts of what they are at most in the box, at every station no more than the
largest part anywhere along the arm; so is η where it is ζ, and else it stays at its largest. All
integrals are then those of the box times powers of the largest parts, and are computed once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import Tables, both_sides, tables
from softreach.kernels.rod.frames import relative_strains
from softreach.rod.inputs import ActivationBox
from softreach.support.arrays import Array
from softreach.support.lazy import lazy

_STATIONS = 201
_SAFETY = 1.02  # for quadrature, and for the steps of the map as it is computed
_MOST_SIGNS = 8  # bundles up to which all signs of d are tried
_MOST_KNOWN = 64  # proportions of half widths whose terms are kept


class _Terms(NamedTuple):
    """Twice the terms of the bound where extension and bending are largest: degree two in d."""

    turned_twice: float
    """∫ ζ a² by the first part of κ = η U d + (y·d) u."""
    turned_and_stretched: float
    """The same by one of each."""
    stretched_twice: float
    """The same by the second part."""
    turned: float
    """∫ 2 |z·d| a by the first part."""
    stretched: float
    """∫ 2 |z·d| a by the second part."""
    mixed: float
    """∫ ζ ∫ 2 |y·d| |U d|."""

    def sum(
        self, longest: Array | float, eta: Array | float, bending: Array | float
    ) -> Array | float:
        """The bound where ζ, η and bending are these parts of their largest values."""
        square = self.turned_twice * eta**2 + self.stretched_twice * bending**2
        square += self.turned_and_stretched * eta * bending
        linear = self.turned * eta + self.stretched * bending + self.mixed * longest
        return 0.5 * _SAFETY * (longest * square + linear)


class Linearization:
    """The bounds for one arm, its tables computed once."""

    def __init__(self, arm: Manipulator, box: ActivationBox, end: float, reach: float) -> None:
        """Bounds for a point at a distance from the center of the section at Z = end [m]."""
        # Even in S, in which the response of a tapered arm is even.
        s = np.linspace(0.0, arm.profile.slender_length, _STATIONS)
        z = both_sides(arm, arm.profile.station(s))
        table = tables(arm, np.minimum(z, end) if end < arm.length else z)
        if reach > 0.0:
            table = _with_rigid_end(table, end, reach)
        self.stations, self.curvature = table.stations, table.curvature
        self.extension, self.stretch = table.extension, np.abs(table.extension)
        middle, half = 0.5 * (box.low + box.high), 0.5 * box.widths
        self.longest = 1.0 + table.extension @ middle + self.stretch @ half
        self.has_forces = table.has_forces
        self.rest_length_factor = np.abs(table.rest_length_factor)
        self.largest_eta = 1.0 + table.rest_length_factor @ middle + self.rest_length_factor @ half
        self.size = np.linalg.norm(self.curvature, axis=1)
        self.bending = np.linalg.norm(self.curvature @ middle, axis=1) + self.size @ half
        self._known: dict[bytes, _Terms] = {}

    @property
    def longest_arm(self) -> float:
        """∫ ζ along the arm with every bundle at its longest [m]."""
        return _SAFETY * float(_integrals(self.longest, self.stations)[-1])

    def error(self, half_widths: Array) -> float:
        """The largest |r(γ + d) - r(γ) - r'(γ) d| [m] for |dj| <= half_widths[j] in the box."""
        square, terms = self._terms(half_widths)
        return square * float(terms.sum(1.0, 1.0, 1.0))

    def errors(self, centers: Array, half_widths: Array) -> Array:
        """The same for |dj| <= half_widths[j] around each center only, shape (n,)."""
        longest, bending = np.empty(len(centers)), np.empty(len(centers))
        offset = (1.0 + self.stretch @ half_widths) / self.longest
        inverse, *relative = self._relative
        relative_strains(np.ascontiguousarray(centers), offset, *relative, longest, bending)
        bending = np.sqrt(bending) + (self.size @ half_widths * inverse).max()
        longest, bending = np.minimum(longest, 1.0), np.minimum(bending, 1.0)
        square, terms = self._terms(half_widths)
        eta = 1.0 if self.has_forces else longest
        return square * np.asarray(terms.sum(longest, eta, bending))

    @lazy
    def _relative(self) -> tuple[Array, Array, Array]:
        """1/bending [m], 0 without any, and parts of the largest ζ and u that each bundle makes."""
        inverse = np.divide(1.0, self.bending, where=self.bending > 0, out=0 * self.bending)
        stretch = self.extension / self.longest[:, None]
        return inverse, stretch, self.curvature * inverse[:, None, None]

    def _terms(self, half_widths: Array) -> tuple[float, _Terms]:
        """The largest half width squared, and the terms for it at 1, known for each proportion."""
        largest = float(half_widths.max(initial=0.0))
        shape = half_widths / (largest or 1.0)
        terms = self._known.get(shape.tobytes())
        if terms is None:
            terms = self._computed(shape)
            if len(self._known) < _MOST_KNOWN:
                self._known[shape.tobytes()] = terms
        return largest**2, terms

    def _computed(self, half_widths: Array) -> _Terms:
        free, z = np.flatnonzero(half_widths > 0), self.stations
        if not len(free):
            return _Terms(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)

        def total(values: Array) -> float:
            return float(_integrals(values, z)[..., -1].max())

        stretch, turned = self.stretch @ half_widths, self._turns(half_widths, free)
        d_eta = self.rest_length_factor @ half_widths
        first = _integrals(self.largest_eta * turned, z)
        second = _integrals(d_eta * self.bending, z)
        # The square of a is convex in d, so that it is largest where all |dj| are.
        return _Terms(
            turned_twice=total(self.longest * first**2),
            turned_and_stretched=total(2.0 * self.longest * first * second),
            stretched_twice=total(self.longest * second**2),
            turned=total(2.0 * stretch * first.max(axis=0)),
            stretched=total(2.0 * stretch * second),
            mixed=total(self.longest * _integrals(2.0 * d_eta * turned.max(axis=0), z)),
        )

    def _turns(self, half_widths: Array, free: NDArray[np.intp]) -> Array:
        """|U d| at every station for every d that counts, shape (d, station)."""
        of_each = self.curvature[:, :, free] * half_widths[free]
        if len(free) > _MOST_SIGNS:
            return np.linalg.norm(of_each, axis=1).sum(axis=1)[None]
        bits = np.arange(1 << (len(free) - 1))[:, None] >> np.arange(len(free)) & 1
        signs = np.array(1.0 - 2.0 * bits, np.float64)  # but for that of all together
        return np.linalg.norm(np.einsum("scj,dj->dsc", of_each, signs), axis=2)


def _with_rigid_end(table: Tables, end: float, reach: float) -> Tables:
    """Tables with a straight piece beyond the end that nothing deforms [m]."""
    z = np.concatenate([table.stations, [end, end + reach]])
    parts = table.extension, table.curvature, table.rest_length_factor
    extension, curvature, resting = (
        np.concatenate([values, np.zeros_like(values[:2])]) for values in parts
    )
    return Tables(z, extension, curvature, resting if table.has_forces else extension)


def _integrals(values: Array, z: Array) -> Array:
    """∫ from the base to every station along the last axis, by trapezoids."""
    sums = np.cumsum(0.5 * np.diff(z) * (values[..., 1:] + values[..., :-1]), axis=-1)
    return np.concatenate([np.zeros_like(values[..., :1]), sums], axis=-1)
