"""Profiles: how the outer radius changes along an arm.

All that depends on the radius alone is here: R2(Z), its slope, S(Z) = ∫ dZ/R2, its inverse. A
profile is one cone, or given at stations: straight between them, or a curve through them.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.number import number, series_faults, stations
from softreach.arm.part import Part, Samples
from softreach.support.arguments import plain
from softreach.support.arrays import Array, Index
from softreach.support.errors import Fault, InvalidDesign, Range
from softreach.support.lazy import lazy

# Enough for machine precision while a radius changes by less than tenfold between two stations.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)
_NEWTON_STEPS = 60
_WIDEST = 100.0  # over L, of any radius
_CHECKED = 65  # Places at which a radius is seen to be positive


@dataclass(frozen=True, kw_only=True)
class Profile(Part, ABC):
    """The outer radius along the arm, before activation.

    A new kind is a frozen dataclass that implements `radius` and `slope`, and `breakpoints` where
    these are not smooth.
    """

    length: float = number("L", "m", "length before activation", above=0.0)
    """L, from base to tip before activation [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        radii = self.radius(np.linspace(0.0, self.length, _CHECKED))
        if not (radii > 0.0).all():
            allowed = "must be above 0 m all along the arm"
            raise InvalidDesign([Fault("radius", float(np.min(radii)), allowed)])
        if not (radii <= (most := _WIDEST * self.length)).all():
            allowed = f"must be at most {most:g} m, {_WIDEST:g} times the length of the arm"
            raise InvalidDesign([Fault("radius", float(np.max(radii)), allowed)])

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Stations inside (0, L) where the radius is not smooth, ascending [m]."""
        return ()

    @abstractmethod
    def radius(self, z: ArrayLike) -> Array:
        """R2(Z) [m]."""

    @abstractmethod
    def slope(self, z: ArrayLike) -> Array:
        """tan φ(Z) = -R2'(Z) [-]; positive where the arm narrows toward the tip."""

    def slender_coordinate(self, z: ArrayLike) -> Array:
        """S(Z) = ∫ dZ / R2 from 0 to Z [-]: length counted in local radii, theory (15).

        In S the bending of each fiber has constant magnitude and rotates at a constant rate, so
        that uniform steps in S share the bending evenly.
        """
        z = np.asarray(z, float)
        piece = self._piece(z)
        return self._slender_knots[piece] + self._slender_gap(piece, z - self._knots[piece])

    def station(self, s: ArrayLike) -> Array:
        """Z(S) [m], the inverse of `slender_coordinate`."""
        s = np.asarray(s, float)
        piece = np.searchsorted(self._slender_knots[1:-1], s, "right")
        return self._knots[piece] + self._length_gap(piece, s - self._slender_knots[piece])

    def surface_coordinate(self, z: ArrayLike, ratio: float = 1.0) -> Array:
        """∫ dZ / (R cos φ) from 0 to Z along the cone R = ratio · R2 [-].

        Its slope there is ratio · tan φ. Times tan α it is the rotation Θ of a fiber of constant
        helical angle α on that cone: theory (14). Here by Gauss quadrature in each piece.
        """
        z = np.asarray(z, float)

        def secant(station: Array) -> Array:
            return np.hypot(1.0, ratio * self.slope(station)) / (ratio * self.radius(station))

        starts, gaps = self._knots[:-1], np.diff(self._knots)
        before = np.concatenate([[0.0], np.cumsum(_integral(secant, starts, gaps))])
        piece = self._piece(z)
        return before[piece] + _integral(secant, self._knots[piece], z - self._knots[piece])

    @property
    def slender_length(self) -> float:
        """S(L) [-]."""
        return float(self.slender_coordinate(self.length))

    @lazy
    def _knots(self) -> Array:
        return np.array([0.0, *self.breakpoints, self.length])

    @lazy
    def _slender_knots(self) -> Array:
        gaps = self._slender_gap(np.arange(len(self._knots) - 1), np.diff(self._knots))
        return np.concatenate([[0.0], np.cumsum(gaps)])

    def _piece(self, z: Array) -> Index:
        return np.searchsorted(self._knots[1:-1], z, "right")

    def _slender_gap(self, piece: Index, gap: Array) -> Array:
        """∫ dZ/R2 [-] over the first `gap` [m] of a piece, by Gauss quadrature."""
        return _integral(lambda station: 1.0 / self.radius(station), self._knots[piece], gap)

    def _length_gap(self, piece: Index, gap: Array) -> Array:
        """Length [m] over which the first `gap` [-] of S in a piece extends, by Newton's method."""
        width = np.diff(self._knots)[piece]
        length = width * gap / np.diff(self._slender_knots)[piece]
        for _ in range(_NEWTON_STEPS):
            residual = self._slender_gap(piece, length) - gap
            change = residual * self.radius(self._knots[piece] + length)
            length = np.clip(length - change, 0.0, width)
            if np.all(np.abs(change) <= 1e-15 * self.length):
                break
        return length


@dataclass(frozen=True, kw_only=True, init=False)
class LinearTaper(Profile):
    """R2(Z) = R2(0) - Z tan φ, theory (13): a cone, or a cylinder for φ = 0.

    Args:
        length: L [m].
        taper: φ [rad].
        outer_radius: R2(0) [m].
        tip_radius: R2(L) [m], instead of the taper.

    Raises:
        InvalidDesign: A field is out of its range, or the taper leaves no tip.
    """

    taper: float = number(
        "φ", "rad", "taper angle", above=-math.pi / 2, below=math.pi / 2, default=0.0
    )
    """φ, taper angle [rad]; negative widens toward the tip."""
    outer_radius: float = number("R2(0)", "m", "outer radius at the base", above=0.0)
    """R2(0), outer radius at the base [m]."""

    def __init__(
        self,
        *,
        length: float,
        taper: float = 0.0,
        outer_radius: float,
        tip_radius: float | None = None,
    ) -> None:
        if tip_radius is not None:
            tip, positive = plain(tip_radius), Range(0.0, unit="m", open_low=True)
            if not positive.admits(tip):
                raise InvalidDesign([Fault("tip_radius", tip, positive)])
            if taper != 0.0:
                allowed = "must be left out beside a taper"
                raise InvalidDesign([Fault("tip_radius", tip, allowed)])
            if positive.admits(plain(length)) and positive.admits(plain(outer_radius)):
                taper = math.atan((plain(outer_radius) - tip) / plain(length))
        for field, value in (("length", length), ("taper", taper), ("outer_radius", outer_radius)):
            object.__setattr__(self, field, value)
        self.__post_init__()

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one; `tip_radius` is one of them."""
        if changes.get("tip_radius") is not None:
            changes.setdefault("taper", 0.0)
        return super().replace(**changes)

    @property
    def tip_radius(self) -> float:
        """R2(L), outer radius at the tip [m]."""
        return float(self.radius(self.length))

    def radius(self, z: ArrayLike) -> Array:
        return self.outer_radius - np.asarray(z, float) * np.tan(self.taper)

    def slope(self, z: ArrayLike) -> Array:
        """tan φ, the same everywhere [-]."""
        return np.full(np.shape(z), np.tan(self.taper))

    def slender_coordinate(self, z: ArrayLike) -> Array:
        """S(Z) = Z/R2(0) · log(1 - q)/(-q) [-], with q = Z tan φ/R2(0): theory (15)."""
        z = np.asarray(z, float)
        return z / self.outer_radius * _relative_log(z * np.tan(self.taper) / self.outer_radius)

    def station(self, s: ArrayLike) -> Array:
        """Z(S) = R2(0) S (exp(y) - 1)/y [m] with y = -S tan φ: theory (16)."""
        s = np.asarray(s, float)
        return self.outer_radius * s * _relative_expm1(-s * np.tan(self.taper))

    def surface_coordinate(self, z: ArrayLike, ratio: float = 1.0) -> Array:
        """S(Z) / (ratio cos φ) with the slope ratio · tan φ of that cone [-]: theory (17)."""
        cos = np.cos(np.arctan(ratio * np.tan(self.taper)))
        return self.slender_coordinate(z) / (ratio * cos)

    def _faults(self) -> list[Fault]:
        if faults := super()._faults():
            return faults
        tip = self.outer_radius - self.length * math.tan(self.taper)
        if tip > 0.0:
            return []
        limit = math.atan(self.outer_radius / self.length)
        why = f"leaves no tip (R2(L) = {tip:.4g} m, R2(0) = {self.outer_radius:.4g} m)"
        return [Fault("taper", self.taper, Range(high=limit, unit="rad", open_high=True, why=why))]


@dataclass(frozen=True, kw_only=True)
class _RadiiAtStations(Profile):
    stations_over_length: tuple[float, ...] = stations("station of a radius")
    """Z/L of the radii [-], from 0 to 1, rising."""
    radii: tuple[float, ...] = number(
        "R2", "m", "outer radius at a station", shape="series", above=0.0
    )
    """R2 at these stations before activation [m]."""

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return tuple(self.length * x for x in self.stations_over_length[1:-1])

    def _faults(self) -> list[Fault]:
        return super()._faults() + series_faults(vars(self), "radii")


@dataclass(frozen=True, kw_only=True)
class PiecewiseTaper(_RadiiAtStations):
    """R2(Z) straight between stations: cones and cylinders one after the other.

    Raises:
        InvalidDesign: Stations that do not rise from 0 to 1, or radii that are not positive.
    """

    def radius(self, z: ArrayLike) -> Array:
        return np.interp(np.asarray(z, float), self._knots, self.radii)

    def slope(self, z: ArrayLike) -> Array:
        """tan φ(Z) [-]; at a station, that of the piece which begins there."""
        return self._slopes[self._piece(np.asarray(z, float))]

    @lazy
    def _slopes(self) -> Array:
        return -np.diff(self.radii) / np.diff(self._knots)

    def surface_coordinate(self, z: ArrayLike, ratio: float = 1.0) -> Array:
        """∫ dZ/(R cos φ) [-], piece by piece: theory (17)."""
        z = np.asarray(z, float)
        piece, secant = self._piece(z), np.hypot(1.0, ratio * self._slopes) / ratio
        before = np.concatenate([[0.0], np.cumsum(np.diff(self._slender_knots) * secant)])
        last = self._slender_gap(piece, z - self._knots[piece])
        return before[piece] + last * secant[piece]

    def _slender_gap(self, piece: Index, gap: Array) -> Array:
        start, slope = np.asarray(self.radii)[piece], self._slopes[piece]
        return gap / start * _relative_log(gap * slope / start)

    def _length_gap(self, piece: Index, gap: Array) -> Array:
        return np.asarray(self.radii)[piece] * gap * _relative_expm1(-gap * self._slopes[piece])


@dataclass(frozen=True, kw_only=True)
class SampledTaper(_RadiiAtStations):
    """R2(Z) as the monotone cubic through samples: no wider and no thinner than they are.

    Raises:
        InvalidDesign: Stations that do not rise from 0 to 1, or radii that are not positive.
    """

    def radius(self, z: ArrayLike) -> Array:
        return self._along(np.asarray(z, float) / self.length)

    def slope(self, z: ArrayLike) -> Array:
        return -self._along.derivative(np.asarray(z, float) / self.length) / self.length

    @lazy
    def _along(self) -> Samples:
        return Samples(stations_over_length=self.stations_over_length, values=self.radii)


def _integral(function: Any, start: Array, gap: Array) -> Array:
    """∫ over [start, start + gap], all at once."""
    half = 0.5 * np.asarray(gap)[..., None]
    nodes = np.asarray(start)[..., None] + half * (1.0 + _NODES)
    return np.sum(half * _WEIGHTS * function(nodes), axis=-1)


def _relative_log(q: Array) -> Array:
    """log(1 - q) / (-q), which is 1 at q = 0."""
    return np.divide(np.log1p(-q), -q, out=np.ones_like(q), where=q != 0)


def _relative_expm1(x: Array) -> Array:
    """(exp(x) - 1) / x, which is 1 at x = 0."""
    return np.divide(np.expm1(x), x, out=np.ones_like(x), where=x != 0)
