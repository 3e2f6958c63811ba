"""An actuator of my own: magnets that draw the sections of a spine together."""

from dataclasses import dataclass

import numpy as np
from softreach.arm import Actuator, Outline, Resultants
from softreach.arm.number import number


@dataclass(frozen=True, kw_only=True)
class Magnets(Actuator):
    """Magnets at p = distance (cos angle, sin angle) that pull with so many newtons per ampere."""

    unit = "A"
    symbol = "I"
    is_force = True  # it loads the sections, and does not change how long matter is at rest
    default_name = "magnets"
    validity = "While neighbors stay as far apart as at rest: for small strains."

    distance: float = number("d", "m", "distance from the axis", low=0.0)
    angle: float = number("θ0", "rad", "polar angle", default=0.0)
    newtons_per_ampere: float = 1.0
    activation_bounds: tuple[float, float] = (0.0, 5.0)

    def resultants(self, profile, section, z):
        """N = -F and M = -p × F e₃ for each ampere."""
        x, y = self.distance * np.cos(self.angle), self.distance * np.sin(self.angle)
        moment = self.newtons_per_ampere * np.array([-y, x, 0.0])
        force = np.full((len(z), 1), -self.newtons_per_ampere)
        return Resultants(force, np.broadcast_to(moment[:, None], (len(z), 3, 1)))

    def outline(self, profile, section, z):
        """A line along the arm."""
        place = (self.distance / profile.radius(z))[:, None]
        return Outline(
            center=np.full((len(z), 1), self.angle),
            extent=np.zeros(1),
            inner_ratio=place,
            outer_ratio=place,
            shape=("line",),
            acts=self.acts(profile, z),
        )

    def section_faults(self, profile, section):
        return section.modulus_faults("for magnets, which pull with a force")
