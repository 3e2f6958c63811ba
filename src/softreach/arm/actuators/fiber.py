"""The fiber architecture: one family of fibers, how it winds, where its bundles sit."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuator_checks import FIBER_RANGES, winding_faults
from softreach.arm.actuators.actuator import STRETCH
from softreach.arm.actuators.cone import cone_integrals
from softreach.arm.actuators.ring_integrals import RingIntegrals
from softreach.arm.actuators.sector import SectorActuator
from softreach.arm.actuators.winding import helical_rotation
from softreach.arm.along import AlongArm
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.arm.variable import Variable
from softreach.support.errors import Fault

__all__ = ["FiberArchitecture"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class FiberArchitecture(SectorActuator):
    """A helical or longitudinal fiber architecture with equidistant bundles (section 2).

    Give either the helical angle or the revolution; 0 is longitudinal, positive is right-handed.

    Raises:
        InvalidDesign: A field is out of its range, or both or neither of `helical_angle` and
            `revolution` are given.
    """

    variables: ClassVar[tuple[Variable, ...]] = (
        *(
            Variable(field, symbol, meaning, FIBER_RANGES[field])
            for field, symbol, meaning in (
                ("revolution", "Ω", "revolution from base to tip"),
                ("helical_angle", "α", "helical angle at the outer radius"),
                ("offset", "θ0", "polar angle of the first bundle at the base"),
                ("extent", "σ", "angular extent of a bundle"),
                ("bundles", "n", "number of bundles"),
            )
        ),
        *STRETCH,
    )
    default_name: ClassVar[str] = "fiber"
    validity: ClassVar[str] = (
        "Exact to first order in the radius over the length along which shape changes; contraction "
        "below γ = -1 is a load on the matrix, not a strain of the fiber."
    )

    helical_angle: float | AlongArm | None = None
    """α, from the axis, at the outer radius of the ring [rad]; |α| < π/2; may change along Z."""
    revolution: float | None = None
    """Ω, total rotation of a fiber about the axis from where it begins to where it ends [rad]."""

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed; a new angle takes the place of a revolution."""
        if changes.get("helical_angle") is not None:
            changes.setdefault("revolution", None)
        if changes.get("revolution") is not None:
            changes.setdefault("helical_angle", None)
        return super().replace(**changes)

    def breakpoints(self, profile: Profile) -> tuple[float, ...]:
        """Where it begins, ends, or its angle is not smooth [m]."""
        angle = self.helical_angle
        breaks = angle.breaks if isinstance(angle, AlongArm) else ()
        return (*super().breakpoints(profile), *(profile.length * x for x in breaks))

    def helical_angle_on(self, profile: Profile, section: Section) -> float | AlongArm:
        """α at the outer radius of the ring [rad], which the revolution fixes."""
        if self.helical_angle is not None:
            return self.helical_angle
        ratio, end = section.ring(self.ring).outer_ratio, self.end_over_length * profile.length
        turn = profile.surface_coordinate(end, ratio)
        if self.start_over_length > 0.0:
            turn -= profile.surface_coordinate(self.start_over_length * profile.length, ratio)
        return math.atan((self.revolution or 0.0) / float(turn))

    def revolution_on(self, profile: Profile, section: Section) -> float:
        """Ω = Θ(L) [rad], which the helical angle fixes: theory (14)."""
        end = np.asarray([self.end_over_length * profile.length])
        return float(self.rotation(profile, section, end)[0])

    def value_on(self, field: str, profile: Profile, section: Section) -> Any:
        """Value of a variable on an arm; of Ω and α, the one not given follows from the other."""
        if field == "revolution" and self.revolution is None:
            return self.revolution_on(profile, section)
        if field == "helical_angle":
            return self.helical_angle_on(profile, section)
        return getattr(self, field)

    def integrals(self, profile: Profile, section: Section, z: Array) -> RingIntegrals:
        """I0, I1, I3 for the local taper and helical angle: theory (3)."""
        angle = self.helical_angle_on(profile, section)
        local = angle(z / profile.length) if isinstance(angle, AlongArm) else np.full(len(z), angle)
        return cone_integrals(section.ring(self.ring), profile.slope(z), local)

    def rotation(self, profile: Profile, section: Section, z: Array) -> Array:
        """Θ(Z) = ∫ tan α dZ/(R cos φ) from where it begins [rad]: theory (50)."""
        angle = self.helical_angle_on(profile, section)
        start = self.start_over_length * profile.length
        return helical_rotation(profile, section.ring(self.ring).outer_ratio, angle, start, z)

    def _faults(self) -> list[Fault]:
        return super()._faults() + winding_faults(self.helical_angle, self.revolution)
