"""Fibers and muscles in a sector of a ring: families of fibers, oblique and radial muscles.

Muscles are those of a muscular hydrostat, such as an elephant's trunk: Kaczmarski, Leanza, Zhao,
Kuhl, Moulton and Goriely, J. Mech. Phys. Solids (2025) 106102.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.actuators.actuator import MOST_TURN
from softreach.arm.actuators.sector import RingIntegrals, SectorActuator, cone_integrals
from softreach.arm.along import AlongArm, Pieces, values_along
from softreach.arm.number import number
from softreach.arm.profile import Profile
from softreach.arm.section import Ring, Section
from softreach.support.arrays import Array

# Enough for machine precision between two samples of an angle.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(24)


@dataclass(frozen=True, kw_only=True)
class FiberArchitecture(SectorActuator):
    """A helical or longitudinal fiber architecture with equidistant bundles (section 2).

    Give either the helical angle or the revolution; 0 is longitudinal, positive is right-handed.

    Raises:
        InvalidDesign: A field is out of its range, or both or neither of `helical_angle` and
            `revolution` are given.
    """

    default_name: ClassVar[str] = "fiber"
    validity: ClassVar[str] = (
        "Exact to first order in the radius over the length along which shape changes; contraction "
        "below γ = -1 is a load on the matrix, not a strain of the fiber."
    )

    revolution: float | None = number(
        "Ω", "rad", "revolution from base to tip", low=-MOST_TURN, high=MOST_TURN, default=None
    )
    """Ω, total rotation of a fiber about the axis from where it begins to where it ends [rad]."""
    helical_angle: float | AlongArm | None = number(
        "α",
        "rad",
        "helical angle at the outer radius",
        above=-math.pi / 2,
        below=math.pi / 2,
        along=AlongArm,
        instead_of="revolution",
        hint=" (0 for a longitudinal fiber)",
        default=None,
    )
    """α, from the axis, at the outer radius of the ring [rad]; |α| < π/2; may change along Z."""

    def helical_angle_on(self, profile: Profile, section: Section) -> float | AlongArm:
        """α at the outer radius of the ring [rad], which the revolution fixes."""
        return self._angle(profile, section.ring(self.ring))

    def _angle(self, profile: Profile, ring: Ring) -> float | AlongArm:
        if self.revolution == 0.0:
            return 0.0
        given = self.helical_angle
        return _even_angle(self, profile, ring.outer_ratio) if given is None else given

    def revolution_on(self, profile: Profile, section: Section) -> float:
        """Ω = Θ(L) [rad], which the helical angle fixes: theory (14)."""
        end = np.asarray(self.span(profile.length)[1:])
        return float(self.rotation(profile, section.ring(self.ring), end)[0])

    def _following(self, field: str, other: Any, profile: Profile, section: Section) -> Any:
        if field == "revolution":
            return self.revolution_on(profile, section)
        if field == "helical_angle":
            return self.helical_angle_on(profile, section)
        return super()._following(field, other, profile, section)

    def integrals(self, profile: Profile, ring: Ring, z: Array) -> RingIntegrals:
        """I0, I1, I3 for the local taper and helical angle: theory (3)."""
        local = values_along(self._angle(profile, ring), z / profile.length)
        return cone_integrals(ring, profile.slope(z), local)

    def rotation(self, profile: Profile, ring: Ring, z: Array) -> Array:
        """Θ(Z) = ∫ tan α dZ/(R cos φ) from where it begins [rad]: theory (50)."""
        if self.helical_angle == 0.0 or self.revolution == 0.0:
            return np.zeros(np.shape(z))
        angle, ratio = self._angle(profile, ring), ring.outer_ratio
        start = self.station_at("start", profile.length)
        if isinstance(angle, AlongArm):
            turned = _rotation_from_base(profile, ratio, angle, np.append(z, start))
            return turned[:-1] - turned[-1]
        return _along_cone(profile, ratio, start, z) * np.tan(angle)


@lru_cache(maxsize=64)
def _even_angle(fiber: FiberArchitecture, profile: Profile, ratio: float) -> float:
    """α of a revolution on the cone of a ring [rad]; each table of an arm asks for it."""
    along = _along_cone(profile, ratio, *fiber.span(profile.length))
    return math.atan((fiber.revolution or 0.0) / float(along))


def _along_cone(profile: Profile, ratio: float, start: ArrayLike, end: ArrayLike) -> Array:
    whole = profile.surface_coordinate(end, ratio)
    return whole - profile.surface_coordinate(start, ratio) if np.any(start) else whole


def _rotation_from_base(profile: Profile, ratio: float, angle: AlongArm, z: Array) -> Array:
    """Θ from the base, summed over the pieces on which profile and angle are smooth."""
    breaks = [profile.length * x for x in angle.breaks]
    knots = np.union1d([0.0, *breaks, profile.length], profile.breakpoints)
    knots = knots[np.append(np.diff(knots) > 1e-14 * profile.length, True)]

    def turn(start: Array, end: Array) -> Array:
        if isinstance(angle, Pieces):
            middle = angle((start + 1e-13 * profile.length) / profile.length)
            return _along_cone(profile, ratio, start, end) * np.tan(middle)
        half = 0.5 * (end - start)[..., None]
        z = start[..., None] + half * (1.0 + _NODES)
        secant = np.hypot(1.0, ratio * profile.slope(z)) / (ratio * profile.radius(z))
        return np.sum(half * _WEIGHTS * np.tan(angle(z / profile.length)) * secant, axis=-1)

    before = np.concatenate([[0.0], np.cumsum(turn(knots[:-1], knots[1:]))])
    piece = np.clip(np.searchsorted(knots, z, "right") - 1, 0, len(knots) - 2)
    return before[piece] + turn(knots[piece], z)


@dataclass(frozen=True, kw_only=True)
class ObliqueMuscle(SectorActuator):
    """Fibers that run at an angle across a sector which does not wind.

    They leave the sector at one side while others enter at the other, so that the muscle stays in
    its place and twists the arm: theory (4) with Θ(Z) = 0 and the α of its fibers.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    default_name: ClassVar[str] = "oblique muscle"
    validity: ClassVar[str] = (
        "As for fibers; the ends of those fibers that leave the sector between base and tip are "
        "taken to hang on to the matrix."
    )

    helical_angle: float = number(
        "α", "rad", "angle of its fibers", above=-math.pi / 2, below=math.pi / 2
    )
    """α of its fibers from the axis, at the outer radius of the ring [rad]; 0 is longitudinal."""

    @property
    def fiber_direction(self) -> str:
        if self.helical_angle == 0:
            return "along"
        return "right-handed" if self.helical_angle > 0 else "left-handed"

    def integrals(self, profile: Profile, ring: Ring, z: Array) -> RingIntegrals:
        """I0, I1, I3 with the local taper and the angle of the fibers: theory (3)."""
        return cone_integrals(ring, profile.slope(z), np.full(len(z), self.helical_angle))


@dataclass(frozen=True, kw_only=True)
class RadialMuscle(SectorActuator):
    """Fibers along the radius of a sector: contracting them (γ < 0) makes the arm longer.

    A radial strain γ stretches an elastic section by -ν γ along the axis wherever it acts, so that
    k = -ν in theory (3), by theory (51): N = -ν E σ (R2² - R1²)/2 γ, and a moment unless the
    sectors go all around.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    default_name: ClassVar[str] = "radial muscle"
    validity: ClassVar[str] = "As for fibers; the change of radius itself is left out."

    @property
    def fiber_direction(self) -> str:
        return "radial"

    def integrals(self, profile: Profile, ring: Ring, z: Array) -> RingIntegrals:
        """I0 = -ν (1 - ρ²)/2, I1 = -ν (1 - ρ³)/3, I3 = 0 [-]."""
        nu, rho, each = ring.material.poisson_ratio, ring.radius_ratio, np.ones(len(z))
        return RingIntegrals(
            -nu * (1.0 - rho**2) / 2.0 * each, -nu * (1.0 - rho**3) / 3.0 * each, 0.0 * each
        )
