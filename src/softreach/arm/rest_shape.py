"""Rest shape: curvature and twist of an arm that nothing drives."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators.actuator import Actuator, Outline, Resultants
from softreach.arm.along import AlongArm, Samples
from softreach.arm.number import number
from softreach.arm.part import Part
from softreach.arm.profile import Profile
from softreach.arm.section import Section

__all__ = ["STRAIGHT", "RestShape", "RestStrains"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class RestShape(Part):
    """Curvature û of the arm before it is driven or loaded, in its directors.

    A cast arm keeps a bend, a wire its coil: each number is constant, or drawn through samples
    along the arm.

    Raises:
        InvalidDesign: A number is not finite.
    """

    curvature_x: float | Samples = number(
        "û1", "1/m", "curvature at rest about the first director", along=Samples, default=0.0
    )
    """û1, bending about d1 [1/m]: positive bends a straight arm toward -y."""
    curvature_y: float | Samples = number(
        "û2", "1/m", "curvature at rest about the second director", along=Samples, default=0.0
    )
    """û2, bending about d2 [1/m]: positive bends a straight arm toward +x."""
    twist: float | Samples = number("û3", "1/m", "twist at rest", along=Samples, default=0.0)
    """û3, twist about d3 [rad/m]."""

    @property
    def is_straight(self) -> bool:
        """True if nothing is bent or twisted."""
        return self == STRAIGHT

    def curvature(self, x: Array) -> Array:
        """û [1/m] at x = Z/L, shape (station, 3)."""
        each = (self.curvature_x, self.curvature_y, self.twist)
        return np.stack([a(x) if isinstance(a, AlongArm) else np.full(len(x), a) for a in each], 1)

    @property
    def breaks(self) -> tuple[float, ...]:
        """Z/L inside (0, 1) where it is not smooth."""
        each = (self.curvature_x, self.curvature_y, self.twist)
        return tuple(x for a in each if isinstance(a, AlongArm) for x in a.breaks)


STRAIGHT = RestShape()
"""A straight arm without twist."""


@dataclass(frozen=True, kw_only=True)
class RestStrains(Actuator):
    """The rest shape as a bundle that is held at an activation of 1, for tables and kernels."""

    unit: ClassVar[str] = "1"
    symbol: ClassVar[str] = "1"
    activation: ClassVar[str] = "share"
    is_force: ClassVar[bool] = False
    default_name: ClassVar[str] = "rest shape"

    shape: RestShape

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        del profile, section
        return Resultants(np.zeros((len(z), 1)), np.zeros((len(z), 3, 1)))

    def curvature(self, profile: Profile, z: Array) -> Array:
        """û [1/m], shape (station, 3)."""
        return self.shape.curvature(z / profile.length)

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        del section
        zero = np.zeros((len(z), 1))
        return Outline(
            center=zero,
            extent=np.zeros(1),
            inner_ratio=zero,
            outer_ratio=zero,
            shape=("line",),
            acts=self.acts(profile, z),
        )

    def breakpoints(self, profile: Profile) -> tuple[float, ...]:
        return tuple(profile.length * x for x in self.shape.breaks)
