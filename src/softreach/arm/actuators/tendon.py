"""Tendons: cables that pull between where they enter and where they are anchored."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators.actuator import (
    MOST_TURN,
    Outline,
    PolarActuator,
    Resultants,
)
from softreach.arm.along import AlongArm, Samples
from softreach.arm.number import as_numbers, number
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.support.errors import Fault

__all__ = ["Tendon"]

Array = NDArray[np.float64]


class _Route(NamedTuple):
    """Polar coordinates of the tendons and their slopes along the arm."""

    distance: Array
    """ρt(Z) [m], shape (station, 1)."""
    distance_slope: Array
    """ρt'(Z) [-], shape (station, 1)."""
    angle: Array
    """θ(Z) [rad], shape (station, bundle)."""
    angle_slope: Array
    """θ'(Z) [rad/m], shape (station, 1)."""


@dataclass(frozen=True, kw_only=True)
class Tendon(PolarActuator):
    """A tendon without friction at p = ρt (cos θ, sin θ, 0) of every section, or several evenly.

    Its activation is the tension τ [N]. Give either the distance from the axis or its ratio to
    R2(Z); it may lie outside of the arm, where disks hold it.

    Raises:
        InvalidDesign: A field is out of its range, both or neither of `distance` and
            `distance_ratio` are given, or a tension below zero is allowed.
    """

    unit: ClassVar[str] = "N"
    symbol: ClassVar[str] = "τ"
    activation: ClassVar[str] = "tension"
    is_force: ClassVar[bool] = True
    default_name: ClassVar[str] = "tendon"
    least: ClassVar[float] = 0.0
    """Least activation that a bound may be."""
    validity: ClassVar[str] = (
        "Linear material: real silicone (neo-Hookean) bends less than this, by about 2.3 τ/K0. "
        "Tendons that are not parallel to the axis pull along their direction before activation, "
        "with a relative error of the order of curvature times distance from the axis."
    )

    revolution: float = number(
        "Ω", "rad", "rotation from end to end", low=-MOST_TURN, high=MOST_TURN, default=0.0
    )
    """Ω, rotation from where it begins to its anchor, even along Z [rad]."""
    distance: float | tuple[float, float] | Samples | None = number(
        "ρt",
        "m",
        "distance from the axis",
        low=0.0,
        along=Samples,
        pair=True,
        instead_of="distance_ratio",
        default=None,
    )
    """ρt, from the axis [m]; a number, two (where it begins and at its anchor; straight between
    them), or samples along the arm."""
    distance_ratio: float | None = number(
        "ρt/R2", "", "distance from the axis over R2", low=0.0, default=None
    )
    """ρt over the outer radius R2(Z) [-]."""
    routing: Samples | None = number(
        "θ",
        "rad",
        "angle along the arm",
        shape="along",
        along=Samples,
        instead_of="revolution",
        default=None,
    )
    """θ(Z) - θ0 along the arm [rad], in place of an even rotation."""

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = -t3 and M = -p × t along t = (p' + e3)/|p' + e3| of the straight arm: (52)."""
        del section
        route = self._route(profile, z)
        cos, sin = np.cos(route.angle), np.sin(route.angle)
        around = route.distance * route.angle_slope
        x, y = route.distance * cos, route.distance * sin
        t1 = route.distance_slope * cos - around * sin
        t2 = route.distance_slope * sin + around * cos
        t3 = 1.0 / np.hypot(1.0, np.hypot(t1, t2))
        moment = np.stack([-y * t3, x * t3, (y * t1 - x * t2) * t3], axis=1)
        return Resultants(-t3, moment)

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        """Lines along the arm."""
        del section
        route = self._route(profile, z)
        ratio = route.distance / profile.radius(z)[:, None] * np.ones(self.bundles)
        return Outline(
            center=route.angle,
            extent=np.zeros(self.bundles),
            inner_ratio=ratio,
            outer_ratio=ratio,
            shape=("line",) * self.bundles,
            acts=self.acts(profile, z),
        )

    def breakpoints(self, profile: Profile) -> tuple[float, ...]:
        """Stations where it begins, ends, or its route is not smooth [m]."""
        bent = [along for along in (self.distance, self.routing) if isinstance(along, AlongArm)]
        breaks = [profile.length * x for along in bent for x in along.breaks]
        return (*super().breakpoints(profile), *breaks)

    def section_faults(self, profile: Profile, section: Section) -> list[Fault]:
        """Moduli that its forces need."""
        del profile
        return section.modulus_faults(f"for tendon {self.name!r}, whose activation is in N")

    def _following(self, field: str, other: Any, profile: Profile, section: Section) -> Any:
        """The revolution of a routing: from where the tendon begins to its anchor."""
        if field == "revolution":
            return float(np.diff(other(self.span_over_length(profile.length)))[0])
        return super()._following(field, other, profile, section)

    def _route(self, profile: Profile, z: Array) -> _Route:
        column = z[:, None]
        angle, turning = self._angle(profile, column)
        return _Route(
            *self.length_and_slope("distance", profile, column), self.start_angles + angle, turning
        )

    def _angle(self, profile: Profile, z: Array) -> tuple[Array, Array]:
        """θ - θ0 and its slope."""
        x = z / profile.length
        if self.routing is not None:
            return self.routing(x), self.routing.derivative(x) / profile.length
        start, end = self.span_over_length(profile.length)
        rate = self.revolution / (end - start)
        return rate * (x - start), np.full(z.shape, rate / profile.length)

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        tensions = as_numbers(self.activation_bounds)
        if tensions.size and tensions.min() < self.least:
            allowed = "must be at least 0 N: a tendon pulls and cannot push"
            faults.append(Fault("activation_bounds", self.activation_bounds, allowed))
        return faults
