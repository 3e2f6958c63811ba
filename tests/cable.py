"""An actuator of a kind that the library does not know: a cable parallel to the axis."""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from softreach.arm import Actuator, Outline, Profile, Resultants, Section
from softreach.arm.actuators.actuator import Bounds

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Cable(Actuator):
    """Pulls along the axis at a fixed place of every section; its activation is a tension [N].

    Where Young's modulus is left out, it is the tension over that.
    """

    unit: ClassVar[str] = "N"
    is_force: ClassVar[bool] = True
    default_name: ClassVar[str] = "cable"

    place: tuple[float, float]
    """(x, y) in the sections [m]."""
    activation_bounds: Bounds = (0.0, 1e-3)

    def resultants(self, profile: Profile, section: Section, z: Array) -> Resultants:
        """N = -1 and M = -p × e3."""
        x, y = self.place
        moment = np.broadcast_to(np.array([-y, x, 0.0])[:, None], (len(z), 3, 1))
        return Resultants(np.full((len(z), 1), -1.0), moment)

    def outline(self, profile: Profile, section: Section, z: Array) -> Outline:
        """A thin sector about its place."""
        x, y = self.place
        ratio = np.full((len(z), 1), math.hypot(x, y) / float(profile.radius(0.0)))
        return Outline(
            center=np.full((len(z), 1), math.atan2(y, x)),
            extent=np.array([0.1]),
            inner_ratio=0.9 * ratio,
            outer_ratio=np.minimum(1.0, 1.1 * ratio),
            shape=("sector",),
            acts=self.acts(profile, z),
        )
