"""An actuator of a kind that the library does not know: a cable parallel to the axis."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from softreach.arm import Actuator, Outline, Profile, Resultants, Section

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Cable(Actuator):
    """Pulls along the axis at a fixed place of every section; its activation is tension over E."""

    unit: ClassVar[str] = "m2"
    default_name: ClassVar[str] = "cable"
    bundles: ClassVar[int] = 1

    place: tuple[float, float]
    """(x, y) in the sections [m]."""
    tension: tuple[float, float] = (0.0, 1e-3)
    """Lower and upper tension over E [m²]."""
    name: str = ""

    @property
    def bounds(self) -> Array:
        return np.array([self.tension])

    def with_bounds(self, bounds: Array) -> Self:
        low, high = np.asarray(bounds, float).reshape(2).tolist()
        return self.replace(tension=(low, high))

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = -1 and M = -p × e3."""
        x, y = self.place
        moment = np.broadcast_to(np.array([-y, x, 0.0])[:, None], (len(z), 3, 1))
        return Resultants(np.full((len(z), 1), -1.0), moment)

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        """A thin sector about its place."""
        x, y = self.place
        ratio = math.hypot(x, y) / float(profile.radius(0.0))
        return Outline(
            center=np.full((len(z), 1), math.atan2(y, x)),
            extent=np.array([0.1]),
            inner_ratio=np.array([0.9 * ratio]),
            outer_ratio=np.array([min(1.0, 1.1 * ratio)]),
        )
