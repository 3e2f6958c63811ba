"""Actuators along a line: tendons, which pull at their ends, and chambers, whose fluid pushes.

Tendons are driven by their tension, or by a winch or servo that decides how much is pulled in.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from softreach.arm.actuators.actuator import MOST_TURN, Outline, PolarActuator, Resultants
from softreach.arm.number import as_numbers, number
from softreach.arm.part import Samples
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.support.arrays import Array
from softreach.support.errors import Fault

_SAME = 1e-9  # of the length: guides that are one
_PLACES = 65  # along a tendon, at which its distance is seen


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
    """Least activation that a bound may be [N]."""
    validity: ClassVar[str] = (
        "The material is linear: real silicone (neo-Hookean) bends less, by about 2.3 τ/K0. A "
        "tendon that is not parallel to the axis is taken to pull as it lies before activation. "
        "The relative error is about its curvature times its distance from the axis."
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
        pair="two at its ends",
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
    guides: int = number(
        "ng", "", "guides that hold it, evenly spaced", low=0, high=100, integer=True, default=0
    )
    """Guides that hold it, evenly spaced, the last at its anchor [-]: between them, and between
    where it begins and the first, it is straight. 0 for so many that it follows the arm."""
    guide_stations: tuple[float, ...] | None = number(
        "Zg", "m", "guides", above=0.0, shape="several", instead_of="guides", default=None
    )
    """Z of the guides [m], ascending, in place of their number; its anchor holds it too."""
    disk_radius: float | None = number(
        "Rd", "m", "radius of the disks that hold it", above=0.0, default=None
    )
    """Radius of the disks at its guides, or all along where it has none [m]; None for disks that
    just hold it. Pictures show it, and clearance counts it."""

    @property
    def has_guides(self) -> bool:
        """True if it is straight between guides."""
        return self.guides > 0 or self.guide_stations is not None

    def held_at(self, length: float) -> Array:
        """Z of where it begins, its guides and its anchor [m], on an arm of a length [m]."""
        start, end = self.span(length)
        if self.guide_stations is None:
            return np.linspace(start, end, self.guides + 1)
        inside = [z for z in self.guide_stations if z < end - _SAME * length]
        return np.array([start, *inside, end])

    def points_at(self, profile: Profile, z: Array) -> Array:
        """Where it goes through the sections at stations Z [m], were it guided there.

        Returns:
            In the directors [m], shape (station, 3, bundle).
        """
        (distance, _), (angle, _) = self._route(profile, z)
        x, y = distance * np.cos(angle), distance * np.sin(angle)
        return np.stack([x, y, np.zeros_like(x)], axis=1)

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = -t3 and M = -p × t along t = (p' + e3)/|p' + e3| of the straight arm: (52)."""
        (x, y), (t1, t2) = self._path(profile, z)
        t3 = 1.0 / np.hypot(1.0, np.hypot(t1, t2))
        moment = np.stack([-y * t3, x * t3, (y * t1 - x * t2) * t3], axis=1)
        return Resultants(-t3, moment)

    def _path(self, profile: Profile, z: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """p of the straight arm [m] and p' [-] at stations Z [m], shape (station, bundle) each."""
        if self.has_guides:
            held = self.held_at(profile.length)
            points = self.points_at(profile, held)[:, :2]
            first = np.clip(np.searchsorted(held, z, side="right") - 1, 0, len(held) - 2)
            slopes = np.diff(points, axis=0) / np.diff(held)[:, None, None]
            points = points[first] + slopes[first] * (z - held[first])[:, None, None]
            return (points[:, 0], points[:, 1]), (slopes[first, 0], slopes[first, 1])
        (distance, inclination), (angle, turning) = self._route(profile, z)
        cos, sin, around = np.cos(angle), np.sin(angle), distance * turning
        slopes = inclination * cos - around * sin, inclination * sin + around * cos
        return (distance * cos, distance * sin), slopes

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        (distance, _), (angle, _) = self._route(profile, z)
        if self.has_guides:
            (x, y), _ = self._path(profile, z)
            distance, straight = np.hypot(x, y), np.arctan2(y, x)
            angle = angle + np.remainder(straight - angle + np.pi, 2.0 * np.pi) - np.pi
        outer, each = profile.radius(z)[:, None], np.ones(self.bundles)
        ratio = distance / outer * each
        return Outline(
            center=angle,
            extent=np.zeros(self.bundles),
            inner_ratio=ratio,
            outer_ratio=ratio,
            shape=("line",) * self.bundles,
            acts=self.acts(profile, z),
            disk_ratio=None if self.disk_radius is None else self.disk_radius / outer * each,
        )

    def disk_stations(self, profile: Profile) -> tuple[float, ...]:
        return tuple(self.held_at(profile.length)[1:].tolist()) if self.has_guides else ()

    def breakpoints(self, profile: Profile) -> tuple[float, ...]:
        held = self.held_at(profile.length)[1:-1].tolist() if self.has_guides else []
        return (*super().breakpoints(profile), *held)

    def section_faults(self, profile: Profile, section: Section) -> list[Fault]:
        faults = section.modulus_faults(f"for tendon {self.name!r}, whose activation is in N")
        given, (start, end) = self.guide_stations or (), self.span(profile.length)
        same = _SAME * profile.length
        if (np.diff([start, *given]) <= same).any() or max(given, default=end) > end + same:
            between = f"{start:g} m, where the tendon begins, and its anchor at {end:g} m"
            faults.append(Fault("guide_stations", given, f"must rise between {between}"))
        farthest = float(self._route(profile, np.linspace(start, end, _PLACES))[0][0].max())
        if self.disk_radius is not None and self.disk_radius < (1.0 - _SAME) * farthest:
            allowed = f"must be at least {farthest:g} m, how far from the axis the tendon is"
            faults.append(Fault("disk_radius", self.disk_radius, allowed))
        return faults

    def _following(self, field: str, other: Any, profile: Profile, section: Section) -> Any:
        """The revolution of a routing: from where the tendon begins to its anchor."""
        if field == "revolution":
            return float(np.diff(other(self.span_over_length(profile.length)))[0])
        return super()._following(field, other, profile, section)

    def _route(self, profile: Profile, z: Array) -> tuple[tuple[Array, Array], tuple[Array, Array]]:
        """ρt [m] with its slope [-], (station, 1); θ [rad], (station, bundle), with its [1/m]."""
        distance = self.length_along("distance", profile, z[:, None])
        x = z[:, None] / profile.length
        if self.routing is not None:
            turned, rate = self.routing(x), self.routing.derivative(x)
        else:
            start, end = self.span_over_length(profile.length)
            rate = np.full(x.shape, self.revolution / (end - start))
            turned = rate * (x - start)
        return distance, (self.start_angles + turned, rate / profile.length)

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        tensions = as_numbers(self.activation_bounds)
        if tensions.size and tensions.min() < self.least:
            allowed = "must be at least 0 N: a tendon pulls and cannot push"
            faults.append(Fault("activation_bounds", self.activation_bounds, allowed))
        return faults


@dataclass(frozen=True, kw_only=True)
class LengthTendon(Tendon):
    """A tendon without friction whose activation is how much of it is pulled in, q [m].

    Its tension τ follows, and loads the arm as that of a `Tendon` does: τ = k (q - slack - s) +
    pretension where that is positive, with s the shortening of its path, else it is slack. Without
    a stiffness k it does not stretch: s = q - slack, unless it is slack.

    Raises:
        InvalidDesign: A field is out of its range, both or neither of `distance` and
            `distance_ratio` are given, or a pretension without `tendon_stiffness`.
    """

    unit: ClassVar[str] = "m"
    symbol: ClassVar[str] = "q"
    activation: ClassVar[str] = "displacement"
    least: ClassVar[float] = -math.inf

    slack: float | tuple[float, ...] = number(
        "q0", "m", "pulled in by so much before it is taut", each=True, default=0.0
    )
    """q0, pulled in by so much before it is taut [m]; negative where it is pretensioned. One for
    all bundles, or one for each."""
    tendon_stiffness: float | None = number(
        "k", "N/m", "stiffness of tendon and drive in series", above=0.0, default=None
    )
    """k, stiffness of tendon and drive in series [N/m]; None for one that does not stretch."""
    pretension: float = number("τ0", "N", "tension at q0 of the straight arm", low=0.0, default=0.0)
    """τ0, tension at q = q0 while the arm keeps its shape [N]."""

    @property
    def compliance(self) -> float:
        """1/k [m/N]."""
        return 0.0 if self.tendon_stiffness is None else 1.0 / self.tendon_stiffness

    @property
    def taut_from(self) -> Array:
        """Displacement at which each becomes taut while the arm keeps its shape [m], (bundle,)."""
        return np.array(self.of_bundles("slack")) - self.pretension * self.compliance

    def by_tension(self) -> Tendon:
        """The same tendon driven by its tension; its bounds are 0 until the arm sets them."""
        same: dict[str, Any] = {field.name: getattr(self, field.name) for field in fields(Tendon)}
        same["activation_bounds"] = (0.0, 0.0)
        return Tendon(**same)

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        blamed = {fault.path for fault in faults}
        is_doubtful = blamed & {"pretension", "tendon_stiffness"}
        if not is_doubtful and self.pretension and self.tendon_stiffness is None:
            allowed = "must be 0 without tendon_stiffness: such a tendon takes a slack below 0"
            faults.append(Fault("pretension", self.pretension, allowed))
        return faults


@dataclass(frozen=True, kw_only=True)
class Chamber(PolarActuator):
    """A round channel parallel to the axis, or several evenly around it.

    Its activation is the pressure P [Pa] above that outside. Sizes are ratios to R2(Z), or lengths
    that stay the same along the arm. That the channel takes matter out of the section is not
    counted: give its ring the modulus of what is left.

    Raises:
        InvalidDesign: A field is out of its range, or not exactly one of `radius` and
            `radius_ratio`, or of `distance` and `distance_ratio`, is given.
    """

    unit: ClassVar[str] = "Pa"
    symbol: ClassVar[str] = "P"
    activation: ClassVar[str] = "pressure"
    is_force: ClassVar[bool] = True
    default_name: ClassVar[str] = "chamber"
    validity: ClassVar[str] = (
        "The material is linear, and thin-walled channels do not widen: where they do, calibrate "
        "`area_factor`."
    )

    distance: float | None = number(
        "ρc",
        "m",
        "distance of its center from the axis",
        low=0.0,
        instead_of="distance_ratio",
        default=None,
    )
    """ρc, of the center from the axis [m]."""
    distance_ratio: float | None = number(
        "ρc/R2", "", "distance from the axis over R2", low=0.0, default=None
    )
    """ρc over the outer radius R2(Z) [-]."""
    radius: float | None = number(
        "a", "m", "radius of the channel", above=0.0, instead_of="radius_ratio", default=None
    )
    """a, radius of the channel [m]."""
    radius_ratio: float | None = number(
        "a/R2", "", "radius of the channel over R2", above=0.0, default=None
    )
    """a over the outer radius R2(Z) [-]."""
    area_factor: float = number(
        "A/πa²", "", "effective over geometric area", above=0.0, default=1.0
    )
    """Effective area over π a² [-], from a measurement; 1 where the channel does not widen."""

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = A and M = p × A e3 with the effective area A and the center p: theory (53)."""
        area = np.pi * self.area_factor * self.length_along("radius", profile, z)[0] ** 2
        arm = area * self.length_along("distance", profile, z)[0]
        angle = self.start_angles
        along = np.zeros((len(z), self.bundles))
        moment = [arm[:, None] * np.sin(angle), -arm[:, None] * np.cos(angle), along]
        return Resultants(area[:, None] + along, np.stack(moment, axis=1))

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        each, outer = np.ones(self.bundles), profile.radius(z)
        distance = self.length_along("distance", profile, z)[0]
        radius = self.length_along("radius", profile, z)[0]
        share = float(np.max(radius / np.maximum(distance, radius)))
        return Outline(
            center=np.broadcast_to(self.start_angles, (len(z), self.bundles)),
            extent=2.0 * np.arcsin(share) * each,
            inner_ratio=((distance - radius) / outer)[:, None] * each,
            outer_ratio=((distance + radius) / outer)[:, None] * each,
            shape=("lumen",) * self.bundles,
            acts=self.acts(profile, z),
        )

    def section_faults(self, profile: Profile, section: Section) -> list[Fault]:
        return section.modulus_faults(f"for chamber {self.name!r}, whose activation is in Pa")
