"""Loads on an arm beside its actuators: gravity, a payload, forces and moments."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

from softreach.arm.number import number
from softreach.arm.part import Part, Triple, kind_faults
from softreach.support.errors import Fault

if TYPE_CHECKING:
    from softreach.arm.base import Base
    from softreach.arm.profile import Profile
    from softreach.arm.section import Section

GRAVITY = 9.81  # g, standard acceleration of what falls [m/s²]

GRAVITIES: Mapping[str, Triple] = {
    "down": (0.0, 0.0, -GRAVITY),
    "up": (0.0, 0.0, GRAVITY),
    "sideways": (GRAVITY, 0.0, 0.0),
    "none": (0.0, 0.0, 0.0),
}
"""Gravity by name in the world, whose z points up [m/s²]."""

_ZERO: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class PointLoad(Part):
    """A force and a moment on one section, in the world whatever the arm does.

    Raises:
        InvalidDesign: A field is not what it must be.
    """

    station: float = number("Z", "m", "where they act", low=0.0)
    """Z [m]."""
    force: Triple = number("F", "N", "force on the section", default=_ZERO, shape="triple")
    """[N]."""
    moment: Triple = number("M", "N m", "moment on the section", default=_ZERO, shape="triple")
    """[N m]."""


@dataclass(frozen=True, kw_only=True)
class Loads(Part):
    """Gravity, a payload, forces and moments; in the world unless they follow the tip.

    The base of an arm decides how they act on it: one that points up has gravity against the
    straight arm, one that points down along it.

    Raises:
        InvalidDesign: A field is not what it must be.
    """

    gravity: Triple = number(
        "g", "m/s²", "acceleration of what falls", default=(0.0, 0.0, -GRAVITY), shape="triple"
    )
    """Acceleration of what falls in the world, whose z points up [m/s²]."""
    payload: float = number("mp", "kg", "mass at the tip", low=0.0, default=0.0)
    """Mass at the tip [kg]."""
    payload_arm: Triple = number(
        "a", "m", "lever arm of the payload", default=_ZERO, shape="triple"
    )
    """Place of the center of the payload from the tip, in the directors of the tip [m]."""
    tip_force: Triple = number("F", "N", "force on the tip", default=_ZERO, shape="triple")
    """Force on the tip, in the world [N]."""
    tip_moment: Triple = number("M", "N m", "moment on the tip", default=_ZERO, shape="triple")
    """Moment on the tip, in the world [N m]."""
    follower_force: Triple = number(
        "F'", "N", "force that follows the tip", default=_ZERO, shape="triple"
    )
    """Force on the tip that turns with it, in its directors [N]."""
    follower_moment: Triple = number(
        "M'", "N m", "moment that follows the tip", default=_ZERO, shape="triple"
    )
    """Moment on the tip that turns with it, in its directors [N m]."""
    force_per_length: Triple = number("f", "N/m", "force per length", default=_ZERO, shape="triple")
    """Force per length before activation, beside weight [N/m]."""
    point_loads: tuple[PointLoad, ...] = ()
    """Forces and moments anywhere along the arm."""

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "point_loads", tuple(self.point_loads))

    def _faults(self) -> list[Fault]:
        return super()._faults() + kind_faults(self, {"point_loads": ([PointLoad], "PointLoads")})

    def section_faults(self, section: Section, length: float) -> list[Fault]:
        """Faults that keep them from acting on an arm: moduli, densities, places off the arm."""
        faults = section.load_faults()
        if any(self.gravity):
            faults += section.density_faults("where weight counts")
        allowed = f"must be on the arm, at most {length:g} m"
        return faults + [
            Fault(f"loads.point_loads[{k}].station", load.station, allowed)
            for k, load in enumerate(self.point_loads)
            if load.station > length
        ]

    def sizes(self, section: Section, profile: Profile) -> tuple[float, float]:
        """Force per length at the base [N/m], and other forces with moments over the length [N].

        Sizes are added whatever their directions.
        """
        gravity = math.hypot(*self.gravity)
        payload = self.payload * gravity
        per_length = math.hypot(*self.force_per_length)
        if gravity:
            per_length += gravity * float(section.mass_per_length_at(profile, 0.0))
        force = payload + math.hypot(*self.tip_force) + math.hypot(*self.follower_force)
        force += sum(math.hypot(*load.force) for load in self.point_loads)
        return per_length, force + self.moment_size / profile.length

    @property
    def moment_size(self) -> float:
        """The sizes of all moments, added, that of the payload on its lever among them [N m]."""
        moments = [self.tip_moment, self.follower_moment]
        moments += [load.moment for load in self.point_loads]
        weight = self.payload * math.hypot(*self.gravity)
        lever = math.hypot(*self.payload_arm)
        return weight * lever + sum(math.hypot(*moment) for moment in moments)

    def seen_from(self, base: Base) -> Self:
        """The same in the frame of a base: everything that does not follow the tip is turned."""
        if base.is_identity:
            return self
        turn = base.directions_to_base
        points = tuple(
            load.replace(force=turn(load.force), moment=turn(load.moment))
            for load in self.point_loads
        )
        dead = ("gravity", "tip_force", "tip_moment", "force_per_length")
        turned = {name: turn(getattr(self, name)) for name in dead}
        return self.replace(point_loads=points, **turned)
