"""Quantities that change along an arm: constant in pieces, or drawn through samples.

Stations count from 0 at the base to 1 at the tip, so that an arm of another length keeps its shape.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.number import series_faults, stations
from softreach.arm.part import Part
from softreach.support.arrays import Array
from softreach.support.errors import Fault
from softreach.support.lazy import lazy

_INTERPOLATIONS = ("cubic", "linear")


@dataclass(frozen=True, kw_only=True)
class AlongArm(Part, ABC):
    """A function of Z/L."""

    stations_over_length: tuple[float, ...] = stations("place of a value")
    """Z/L of the samples, or of the ends of the pieces [-]: from 0 to 1, rising."""
    values: tuple[float, ...]
    """One for each station, or one for each piece between them."""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "values", tuple(np.asarray(self.values, float).tolist()))

    @abstractmethod
    def __call__(self, x: ArrayLike) -> Array:
        """Value at x = Z/L; at the end of a piece, that of the piece which begins there."""

    @abstractmethod
    def derivative(self, x: ArrayLike) -> Array:
        """Derivative by x = Z/L [unit of the values], of the shape of x."""

    @property
    def breaks(self) -> tuple[float, ...]:
        """Z/L inside (0, 1) where it is not smooth."""
        return self.stations_over_length[1:-1]

    def _faults(self) -> list[Fault]:
        return series_faults(vars(self), "values")


@dataclass(frozen=True, kw_only=True)
class Pieces(AlongArm):
    """Constant between stations.

    Raises:
        InvalidDesign: Stations that do not rise from 0 to 1, or not one value for each piece.
    """

    def __call__(self, x: ArrayLike) -> Array:
        piece = np.searchsorted(self.stations_over_length[1:-1], np.asarray(x, float), "right")
        return np.asarray(self.values)[piece]

    def derivative(self, x: ArrayLike) -> Array:
        return np.zeros(np.shape(x))

    def _faults(self) -> list[Fault]:
        return series_faults(vars(self), "values", per_station=False)


@dataclass(frozen=True, kw_only=True)
class Samples(AlongArm):
    """Drawn through samples: by a monotone cubic, or by straight lines.

    Raises:
        InvalidDesign: Stations that do not rise from 0 to 1, not one value for each, or another
            kind of interpolation.
    """

    interpolation: Literal["cubic", "linear"] = "cubic"
    """The monotone cubic (PCHIP) overshoots no sample and has a continuous slope."""

    def __call__(self, x: ArrayLike) -> Array:
        if self.interpolation == "linear":
            return np.interp(np.asarray(x, float), self.stations_over_length, self.values)
        return self._curve(np.asarray(x, float))

    def derivative(self, x: ArrayLike) -> Array:
        """The slope; at a sample between straight lines, that of the line which begins there."""
        if self.interpolation == "linear":
            slopes = np.diff(self.values) / np.diff(self.stations_over_length)
            return slopes[np.searchsorted(self.breaks, np.asarray(x, float), "right")]
        return self._slope(np.asarray(x, float))

    @lazy
    def _curve(self) -> Any:
        """The monotone piecewise cubic as SciPy's PCHIP [FritschCarlson1980]."""
        from scipy.interpolate import PchipInterpolator

        return PchipInterpolator(self.stations_over_length, self.values)

    @lazy
    def _slope(self) -> Any:
        return self._curve.derivative()

    def _faults(self) -> list[Fault]:
        if isinstance(self.interpolation, str) and self.interpolation in _INTERPOLATIONS:
            return super()._faults()
        allowed = f"must be one of {', '.join(_INTERPOLATIONS)}"
        return [*super()._faults(), Fault("interpolation", self.interpolation, allowed)]


def values_along(value: float | AlongArm, x: ArrayLike) -> Array:
    """A number, or a function along the arm, at x = Z/L."""
    return value(x) if isinstance(value, AlongArm) else np.full(np.shape(x), value)
