"""Muscles of a muscular hydrostat, such as an elephant's trunk: oblique and radial ones.

Kaczmarski, Leanza, Zhao, Kuhl, Moulton and Goriely, J. Mech. Phys. Solids (2025) 106102.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators.ring_integrals import RingIntegrals
from softreach.arm.actuators.sector import SectorActuator, cone_integrals
from softreach.arm.number import number
from softreach.arm.profile import Profile
from softreach.arm.section import Section

__all__ = ["ObliqueMuscle", "RadialMuscle"]

Array = NDArray[np.float64]


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
        "α",
        "rad",
        "angle of its fibers",
        low=-math.pi / 2,
        high=math.pi / 2,
        open_low=True,
        open_high=True,
    )
    """α of its fibers from the axis, at the outer radius of the ring [rad]; 0 is longitudinal."""

    @property
    def course(self) -> str:
        if self.helical_angle == 0:
            return "along"
        return "right-handed" if self.helical_angle > 0 else "left-handed"

    def integrals(self, profile: Profile, section: Section, z: Array) -> RingIntegrals:
        """I0, I1, I3 with the local taper and the angle of the fibers: theory (3)."""
        angle = np.full(len(z), self.helical_angle)
        return cone_integrals(section.ring(self.ring), profile.slope(z), angle)

    def rotation(self, profile: Profile, section: Section, z: Array) -> Array:
        del profile, section
        return np.zeros(len(z))


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
    def course(self) -> str:
        return "radial"

    def integrals(self, profile: Profile, section: Section, z: Array) -> RingIntegrals:
        """I0 = -ν (1 - ρ²)/2, I1 = -ν (1 - ρ³)/3, I3 = 0 [-]."""
        del profile
        ring = section.ring(self.ring)
        nu, rho, each = ring.material.poisson_ratio, ring.radius_ratio, np.ones(len(z))
        return RingIntegrals(
            -nu * (1.0 - rho**2) / 2.0 * each, -nu * (1.0 - rho**3) / 3.0 * each, 0.0 * each
        )

    def rotation(self, profile: Profile, section: Section, z: Array) -> Array:
        del profile, section
        return np.zeros(len(z))
