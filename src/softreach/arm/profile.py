"""Profiles: how the outer radius changes along an arm.

All that depends on the radius alone is here: R2(Z), its slope, S(Z) = ∫ dZ/R2, its inverse.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.checks import PROFILE_RANGES, profile_faults
from softreach.arm.variable import Variable
from softreach.support.arguments import plain
from softreach.support.arrays import as_floats
from softreach.support.errors import InvalidDesign

__all__ = ["LinearTaper", "Profile", "relative_expm1", "relative_log"]

Array = NDArray[np.float64]


class Profile(ABC):
    """The outer radius along the arm, before activation."""

    variables: ClassVar[tuple[Variable, ...]] = ()
    """Fields that a designer varies."""
    series: ClassVar[tuple[Variable, ...]] = ()
    """Fields that hold several numbers, each of which a designer varies."""

    length: float
    """L, from base to tip [m]."""

    @property
    @abstractmethod
    def breakpoints(self) -> tuple[float, ...]:
        """Stations inside (0, L) where the radius is not smooth, ascending [m]."""

    @abstractmethod
    def radius(self, z: ArrayLike) -> Array:
        """R2(Z) [m]."""

    @abstractmethod
    def slope(self, z: ArrayLike) -> Array:
        """tan φ(Z) = -R2'(Z) [-]; positive where the arm narrows toward the tip."""

    @abstractmethod
    def slender_coordinate(self, z: ArrayLike) -> Array:
        """S(Z) = ∫ dZ / R2 from 0 to Z [-]: length counted in local radii, theory (15).

        In S the bending of each fiber has constant magnitude and rotates at a constant rate, so
        that uniform steps in S share the bending evenly.
        """

    @abstractmethod
    def station(self, s: ArrayLike) -> Array:
        """Z(S) [m], the inverse of `slender_coordinate`."""

    @abstractmethod
    def surface_coordinate(self, z: ArrayLike, ratio: float = 1.0) -> Array:
        """∫ dZ / (R cos φ) from 0 to Z along the cone R = ratio · R2 [-].

        Its slope there is ratio · tan φ. Times tan α it is the rotation Θ of a fiber of constant
        helical angle α on that cone: theory (14).
        """

    @property
    def slender_length(self) -> float:
        """S(L) [-]."""
        return float(self.slender_coordinate(self.length))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one."""
        return replace(self, **changes)  # pyright: ignore[reportArgumentType]


@dataclass(frozen=True, kw_only=True)
class LinearTaper(Profile):
    """R2(Z) = R2(0) - Z tan φ, theory (13): a cone, or a cylinder for φ = 0.

    Raises:
        InvalidDesign: A field is out of its range, or the taper leaves no tip.
    """

    variables: ClassVar[tuple[Variable, ...]] = (
        Variable("taper", "φ", "taper angle", PROFILE_RANGES["taper"]),
        Variable(
            "outer_radius", "R2(0)", "outer radius at the base", PROFILE_RANGES["outer_radius"]
        ),
        Variable("length", "L", "length before activation", PROFILE_RANGES["length"]),
    )

    length: float
    """L, from base to tip before activation [m]."""
    outer_radius: float
    """R2(0), outer radius at the base [m]."""
    taper: float = 0.0
    """φ, taper angle [rad]; negative widens toward the tip."""

    def __post_init__(self) -> None:
        if faults := profile_faults(vars(self)):
            raise InvalidDesign(faults)
        for field in PROFILE_RANGES:
            object.__setattr__(self, field, float(plain(getattr(self, field))))

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """None: the slope is constant."""
        return ()

    def radius(self, z: ArrayLike) -> Array:
        """R2(Z) [m]."""
        return self.outer_radius - as_floats("z", z) * np.tan(self.taper)

    def slope(self, z: ArrayLike) -> Array:
        """tan φ, the same everywhere [-]."""
        return np.full(np.shape(z), np.tan(self.taper))

    def slender_coordinate(self, z: ArrayLike) -> Array:
        """S(Z) = Z/R2(0) · log(1 - q)/(-q) [-], with q = Z tan φ/R2(0): theory (15)."""
        z = as_floats("z", z)
        return z / self.outer_radius * relative_log(z * np.tan(self.taper) / self.outer_radius)

    def station(self, s: ArrayLike) -> Array:
        """Z(S) = R2(0) S (exp(y) - 1)/y [m] with y = -S tan φ: theory (16)."""
        s = as_floats("s", s)
        return self.outer_radius * s * relative_expm1(-s * np.tan(self.taper))

    def surface_coordinate(self, z: ArrayLike, ratio: float = 1.0) -> Array:
        """S(Z) / (ratio cos φ) with the slope ratio · tan φ of that cone [-]: theory (17)."""
        cos = np.cos(np.arctan(ratio * np.tan(self.taper)))
        return self.slender_coordinate(z) / (ratio * cos)


def relative_log(q: Array) -> Array:
    """log(1 - q) / (-q), which is 1 at q = 0."""
    return np.divide(np.log1p(-q), -q, out=np.ones_like(q), where=q != 0)


def relative_expm1(x: Array) -> Array:
    """(exp(x) - 1) / x, which is 1 at x = 0."""
    return np.divide(np.expm1(x), x, out=np.ones_like(x), where=x != 0)
