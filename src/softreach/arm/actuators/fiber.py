"""The fiber architecture: one family of fibers, how it winds, where its bundles sit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.actuators.actuator import Actuator, Outline, Resultants
from softreach.arm.actuators.ring_integrals import ring_integrals
from softreach.arm.checks import FIBER_RANGES, fiber_faults, plain_number
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.arm.variable import Variable
from softreach.errors import InvalidDesign, InvalidInput

__all__ = ["FiberArchitecture"]

Array = NDArray[np.float64]
Bounds = tuple[float, float] | tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class FiberArchitecture(Actuator):
    """A helical or longitudinal fiber architecture with equidistant bundles (section 2).

    Give either the helical angle or the revolution; 0 is longitudinal, positive is right-handed.

    Raises:
        InvalidDesign: A field is out of its range, or both or neither of `helical_angle` and
            `revolution` are given.
    """

    variables: ClassVar[tuple[Variable, ...]] = tuple(
        Variable(field, symbol, meaning, FIBER_RANGES[field])
        for field, symbol, meaning in (
            ("revolution", "Ω", "revolution from base to tip"),
            ("helical_angle", "α", "helical angle at the outer radius"),
            ("offset", "θ0", "polar angle of the first bundle at the base"),
            ("extent", "σ", "angular extent of a bundle"),
            ("bundles", "n", "number of bundles"),
        )
    )
    default_name: ClassVar[str] = "fiber"

    helical_angle: float | None = None
    """α, from the axis, at the outer radius [rad]; |α| < π/2."""
    revolution: float | None = None
    """Ω = Θ(L), total rotation of a fiber about the axis from base to tip [rad]."""
    offset: float = 0.0
    """θ0, polar angle of the center of the first bundle at Z = 0 [rad]."""
    extent: float
    """σ, angular extent of every bundle [rad]; 0 < σ ≤ 2π."""
    bundles: int = 1
    """n, independent bundles, spaced evenly by 2π/n [-]."""
    name: str = ""
    """What summaries and pictures call it; an arm calls unnamed ones "fiber 1", "fiber 2", ..."""
    activation_bounds: Bounds = (-5 / 3, 0.0)
    """(lower, upper) of γ for every bundle, or one pair per bundle [-]; γ < 0 contracts."""

    def __post_init__(self) -> None:
        if faults := fiber_faults(vars(self)):
            raise InvalidDesign(faults)
        for field in FIBER_RANGES:
            object.__setattr__(self, field, plain_number(getattr(self, field)))
        object.__setattr__(self, "activation_bounds", _plain_bounds(self.activation_bounds))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed; a new angle takes the place of a revolution."""
        if changes.get("helical_angle") is not None:
            changes.setdefault("revolution", None)
        if changes.get("revolution") is not None:
            changes.setdefault("helical_angle", None)
        return replace(self, **changes)

    @property
    def bounds(self) -> Array:
        """Lower and upper γ of each bundle [-], shape (bundles, 2)."""
        return np.broadcast_to(np.asarray(self.activation_bounds, float), (self.bundles, 2))

    def with_bounds(self, bounds: Array) -> Self:
        """A copy with other bounds [-], shape (bundles, 2)."""
        return self.replace(activation_bounds=bounds)

    def helical_angle_on(self, profile: Profile, section: Section) -> float:
        """α at the outer radius of the ring [rad], which the revolution fixes."""
        if self.helical_angle is not None:
            return self.helical_angle
        turn = profile.surface_coordinate(profile.length, section.rings[0].outer_ratio)
        return math.atan((self.revolution or 0.0) / float(turn))

    def revolution_on(self, profile: Profile, section: Section) -> float:
        """Ω = Θ(L) [rad], which the helical angle fixes: theory (14)."""
        return float(self._rotation(profile, section, np.asarray(profile.length)))

    def value_on(self, field: str, profile: Profile, section: Section) -> float:
        """Value of a variable on an arm; of Ω and α, the one not given follows from the other."""
        if field == "revolution" and self.revolution is None:
            return self.revolution_on(profile, section)
        if field == "helical_angle":
            return self.helical_angle_on(profile, section)
        return getattr(self, field)

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = R2² I0 σ and M = R2³ (I1 a sin θ, -I1 a cos θ, I3 σ), a = 2 sin(σ/2): theory (4)."""
        ring, radius = section.rings[0], profile.radius(z) * section.rings[0].outer_ratio
        slopes, station = np.unique(profile.slope(z), return_inverse=True)
        integrals = ring_integrals(
            ring.radius_ratio,
            np.arctan(slopes * ring.outer_ratio),
            self.helical_angle_on(profile, section),
            ring.material.poisson_ratio,
        )
        axial, bending, torsion = (integral[station] for integral in integrals)
        theta = self._angles(profile, section, z)
        share, mean = self.extent / np.pi, 2.0 * np.sin(self.extent / 2.0) / np.pi
        bend = (np.pi * radius**3 * bending * mean)[:, None]
        twist = (np.pi * radius**3 * torsion * share)[:, None]
        moment = [bend * np.sin(theta), -bend * np.cos(theta), np.broadcast_to(twist, theta.shape)]
        force = (np.pi * radius**2 * axial * share)[:, None]
        return Resultants(np.broadcast_to(force, theta.shape), np.stack(moment, axis=1))

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        """The sectors of the bundles, turned as the fibers wind."""
        ring, each = section.rings[0], np.ones(self.bundles)
        return Outline(
            center=self._angles(profile, section, z),
            extent=self.extent * each,
            inner_ratio=ring.inner_ratio * each,
            outer_ratio=ring.outer_ratio * each,
        )

    def split(self, count: int, *, keep_extent: bool = True) -> tuple[Self, ...]:
        """Several architectures of one bundle in place of this one, evenly about its center.

        Args:
            count: How many.
            keep_extent: True gives each the extent σ of the original, one extent apart; False its
                share σ / count, so that together they fill the sector of the original.

        Returns:
            The parts, named "NAME 1", "NAME 2", ...; they have the winding and the bounds of the
            original.

        Raises:
            InvalidInput: Several bundles, which are independent already, or a count below 1.
        """
        if isinstance(count, bool) or not isinstance(count, int | np.integer) or count < 1:
            raise InvalidInput("count", count, "a whole number >= 1")
        if self.bundles != 1:
            hint = "its bundles are independent already"
            raise InvalidInput(f"{self.name}.bundles", self.bundles, "1 to be split", hint)
        return tuple(self._parts(int(count), keep_extent)) if count > 1 else (self,)

    def _parts(self, count: int, keep_extent: bool) -> Iterator[Self]:
        extent = self.extent if keep_extent else self.extent / count
        for k in range(count):
            offset = self.offset + (k - (count - 1) / 2) * extent
            name = f"{self.name} {k + 1}" if self.name else ""
            yield self.replace(name=name, offset=offset, extent=extent)

    def _angles(self, profile: Profile, section: Section, z: Array) -> Array:
        """θ0 + 2πj/n + Θ(Z) [rad], shape (station, bundle): theory (11)."""
        start = self.offset + 2 * np.pi * np.arange(self.bundles) / self.bundles
        return start + np.asarray(self._rotation(profile, section, z))[:, None]

    def _rotation(self, profile: Profile, section: Section, z: Array) -> Array:
        """Θ(Z) = tan α ∫ dZ/(R2 cos φ) [rad]: theory (14)."""
        tangent = np.tan(self.helical_angle_on(profile, section))
        return profile.surface_coordinate(z, section.rings[0].outer_ratio) * tangent


def _plain_bounds(bounds: ArrayLike) -> Bounds:
    """One pair where all bundles share it, else one for each."""
    pairs = [(low, high) for low, high in np.atleast_2d(np.asarray(bounds, float)).tolist()]
    return pairs[0] if all(pair == pairs[0] for pair in pairs) else tuple(pairs)
