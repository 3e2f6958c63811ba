"""Pressure chambers: channels along the arm whose fluid pushes at their ends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators.actuator import Outline, PolarActuator, Resultants
from softreach.arm.number import number
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.support.errors import Fault

__all__ = ["Chamber"]

Array = NDArray[np.float64]


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
        "Linear material, and thin-walled channels that do not widen; else calibrate `area_factor`."
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
        "a",
        "m",
        "radius of the channel",
        low=0.0,
        open_low=True,
        instead_of="radius_ratio",
        default=None,
    )
    """a, radius of the channel [m]."""
    radius_ratio: float | None = number(
        "a/R2", "", "radius of the channel over R2", low=0.0, open_low=True, default=None
    )
    """a over the outer radius R2(Z) [-]."""
    area_factor: float = number(
        "A/πa²", "", "effective over geometric area", low=0.0, open_low=True, default=1.0
    )
    """Effective area over π a² [-], from a measurement; 1 where the channel does not widen."""

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = A and M = p × A e3 with the effective area A and the center p: theory (53)."""
        del section
        area = np.pi * self.area_factor * self.length_at("radius", profile, z) ** 2
        arm = area * self.length_at("distance", profile, z)
        angle = self.start_angles
        along = np.zeros((len(z), self.bundles))
        moment = [arm[:, None] * np.sin(angle), -arm[:, None] * np.cos(angle), along]
        return Resultants(area[:, None] + along, np.stack(moment, axis=1))

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        del section
        each, outer = np.ones(self.bundles), profile.radius(z)
        distance, radius = (
            self.length_at("distance", profile, z),
            self.length_at("radius", profile, z),
        )
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
        del profile
        return section.modulus_faults(f"for chamber {self.name!r}, whose activation is in Pa")
