"""Profiles given at stations along the arm: straight between them, or a curve through them."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.along import monotone_cubic
from softreach.arm.checks import PROFILE_RANGES
from softreach.arm.profile import Profile, relative_expm1, relative_log
from softreach.arm.value_checks import INSIDE_RANGE, range_faults, series_faults
from softreach.arm.variable import Variable
from softreach.support.arguments import plain
from softreach.support.arrays import as_floats
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["PiecewiseTaper", "SampledTaper"]

Array = NDArray[np.float64]

# Enough for machine precision while a radius changes by less than tenfold between two stations.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
_NEWTON_STEPS = 60


@dataclass(frozen=True, kw_only=True)
class _GivenRadii(Profile):
    """Radii at stations."""

    variables: ClassVar[tuple[Variable, ...]] = (
        Variable("length", "L", "length before activation", PROFILE_RANGES["length"]),
    )

    series: ClassVar[tuple[Variable, ...]] = (
        Variable("stations_over_length", "Z/L", "station of a radius", INSIDE_RANGE),
        Variable("radii", "R2", "outer radius at a station", PROFILE_RANGES["outer_radius"]),
    )

    length: float
    """L, from base to tip before activation [m]."""
    stations_over_length: tuple[float, ...]
    """Z/L of the radii [-], from 0 to 1, rising."""
    radii: tuple[float, ...]
    """R2 at these stations before activation [m]."""

    def __post_init__(self) -> None:
        values = vars(self)
        faults = range_faults(values, {"length": PROFILE_RANGES["length"]})
        faults += series_faults(values, "radii")
        if not faults and min(self.radii) <= 0:
            faults = [Fault("radii", self.radii, "must be positive, in m")]
        if faults:
            raise InvalidDesign(faults)
        object.__setattr__(self, "length", float(plain(self.length)))
        for field in ("stations_over_length", "radii"):
            numbers = np.asarray(getattr(self, field), float).tolist()
            object.__setattr__(self, field, tuple(numbers))

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """The stations between base and tip [m]."""
        return tuple(self.length * x for x in self.stations_over_length[1:-1])

    @cached_property
    def _knots(self) -> Array:
        """The stations [m]."""
        return np.array([0.0, *self.breakpoints, self.length])

    @cached_property
    def _slender_knots(self) -> Array:
        """S at the stations [-]."""
        gaps = self._slender_gap(np.arange(len(self._knots) - 1), np.diff(self._knots))
        return np.concatenate([[0.0], np.cumsum(gaps)])

    def _piece(self, z: Array) -> NDArray[np.intp]:
        return np.searchsorted(self._knots[1:-1], z, "right")

    def slender_coordinate(self, z: ArrayLike) -> Array:
        """S(Z) [-], piece by piece: theory (15)."""
        z = as_floats("z", z)
        piece = self._piece(z)
        return self._slender_knots[piece] + self._slender_gap(piece, z - self._knots[piece])

    def station(self, s: ArrayLike) -> Array:
        """Z(S) [m], the inverse of `slender_coordinate`."""
        s = as_floats("s", s)
        piece = np.searchsorted(self._slender_knots[1:-1], s, "right")
        return self._knots[piece] + self._length_gap(piece, s - self._slender_knots[piece])

    @abstractmethod
    def _slender_gap(self, piece: NDArray[np.intp], gap: Array) -> Array:
        """∫ dZ/R2 [-] over the first `gap` [m] of a piece."""

    @abstractmethod
    def _length_gap(self, piece: NDArray[np.intp], gap: Array) -> Array:
        """Length [m] over which the first `gap` [-] of S in a piece extends."""


@dataclass(frozen=True, kw_only=True)
class PiecewiseTaper(_GivenRadii):
    """R2(Z) straight between stations: cones and cylinders one after the other.

    Raises:
        InvalidDesign: Stations that do not rise from 0 to 1, or radii that are not positive.
    """

    def radius(self, z: ArrayLike) -> Array:
        """R2(Z) [m]."""
        return np.interp(as_floats("z", z), self._knots, self.radii)

    def slope(self, z: ArrayLike) -> Array:
        """tan φ(Z) [-]; at a station, that of the piece which begins there."""
        return self._slopes[self._piece(as_floats("z", z))]

    @cached_property
    def _slopes(self) -> Array:
        return -np.diff(self.radii) / np.diff(self._knots)

    def surface_coordinate(self, z: ArrayLike, ratio: float = 1.0) -> Array:
        """∫ dZ/(R cos φ) [-], piece by piece: theory (17)."""
        z = as_floats("z", z)
        piece, secant = self._piece(z), np.hypot(1.0, ratio * self._slopes) / ratio
        whole = np.concatenate([[0.0], np.cumsum(np.diff(self._slender_knots) * secant)])
        rest = self._slender_gap(piece, z - self._knots[piece])
        return whole[piece] + rest * secant[piece]

    def _slender_gap(self, piece: NDArray[np.intp], gap: Array) -> Array:
        start, slope = np.asarray(self.radii)[piece], self._slopes[piece]
        return gap / start * relative_log(gap * slope / start)

    def _length_gap(self, piece: NDArray[np.intp], gap: Array) -> Array:
        return np.asarray(self.radii)[piece] * gap * relative_expm1(-gap * self._slopes[piece])


@dataclass(frozen=True, kw_only=True)
class SampledTaper(_GivenRadii):
    """R2(Z) as the monotone cubic through samples: no wider and no thinner than they are.

    Raises:
        InvalidDesign: Stations that do not rise from 0 to 1, or radii that are not positive.
    """

    def radius(self, z: ArrayLike) -> Array:
        """R2(Z) [m]."""
        return self._curve(as_floats("z", z) / self.length)

    def slope(self, z: ArrayLike) -> Array:
        """tan φ(Z) = -R2'(Z) [-]."""
        return -self._curve_slope(as_floats("z", z) / self.length) / self.length

    @cached_property
    def _curve(self) -> Any:
        return monotone_cubic(self.stations_over_length, self.radii)

    @cached_property
    def _curve_slope(self) -> Any:
        return self._curve.derivative()

    def surface_coordinate(self, z: ArrayLike, ratio: float = 1.0) -> Array:
        """∫ dZ/(R cos φ) [-] by Gauss quadrature in each piece: theory (14)."""
        z = as_floats("z", z)

        def secant(station: Array) -> Array:
            return np.hypot(1.0, ratio * self.slope(station)) / (ratio * self.radius(station))

        starts, gaps = self._knots[:-1], np.diff(self._knots)
        whole = np.concatenate([[0.0], np.cumsum(_integral(secant, starts, gaps))])
        piece = self._piece(z)
        return whole[piece] + _integral(secant, self._knots[piece], z - self._knots[piece])

    def _slender_gap(self, piece: NDArray[np.intp], gap: Array) -> Array:
        return _integral(lambda station: 1.0 / self.radius(station), self._knots[piece], gap)

    def _length_gap(self, piece: NDArray[np.intp], gap: Array) -> Array:
        """By Newton's method, within the piece."""
        width = np.diff(self._knots)[piece]
        found = width * gap / np.diff(self._slender_knots)[piece]
        for _ in range(_NEWTON_STEPS):
            wrong = self._slender_gap(piece, found) - gap
            change = wrong * self.radius(self._knots[piece] + found)
            found = np.clip(found - change, 0.0, width)
            if np.all(np.abs(change) <= 1e-15 * self.length):
                break
        return found


def _integral(function: Any, start: Array, gap: Array) -> Array:
    """∫ over [start, start + gap], all at once."""
    half = 0.5 * np.asarray(gap)[..., None]
    nodes = np.asarray(start)[..., None] + half * (1.0 + _NODES)
    return np.sum(half * _WEIGHTS * function(nodes), axis=-1)
