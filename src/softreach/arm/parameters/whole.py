"""Parameters of the whole arm that keep something else: revolutions, proportions, senses."""

from __future__ import annotations

import math
from dataclasses import dataclass

from softreach.arm.actuators import Actuator
from softreach.arm.along import AlongArm
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters.draft import Draft
from softreach.arm.parameters.parameter import FieldParameter, Parameter
from softreach.arm.parameters.parts import actuator_key
from softreach.support.arguments import plain
from softreach.support.errors import Fault

__all__ = ["OuterRadius", "Revolution", "Taper"]


@dataclass(frozen=True, kw_only=True)
class Taper(FieldParameter):
    """The taper angle: when it changes, revolutions stay and helical angles follow."""

    def change(self, draft: Draft, value: float) -> None:
        """Change the profile; the fibers keep their revolutions."""
        draft.keep_revolutions()
        super().change(draft, value)


@dataclass(frozen=True, kw_only=True)
class OuterRadius(Parameter):
    """The radius at the base of a profile given by radii: all of them keep their proportions."""

    def value(self, arm: Manipulator) -> float:
        """R2(0) [m]."""
        return float(arm.profile.radius(0.0))

    def change(self, draft: Draft, value: float) -> None:
        """Change all radii."""
        if not self.variable.allowed.admits(plain(value)):
            draft.refuse(Fault(self.name, value, self.variable.allowed))
            return
        radii: tuple[float, ...] = draft.parts["profile"].start.radii
        for place, radius in enumerate(radii):
            scaled = value if place == 0 else radius * value / radii[0]
            draft.set_element(self.name, "profile", "radii", place, scaled)


@dataclass(frozen=True, kw_only=True)
class Revolution(Parameter):
    """The revolution of all that is helical; each keeps its sense, what is straight stays so.

    Angles that are given along the arm stay as they are.
    """

    def value(self, arm: Manipulator) -> float:
        """|Ω| of the first helical fiber or tendon [rad]; 0 without one."""
        return next((abs(turn) for turn in _revolutions(arm).values() if turn), 0.0)

    def change(self, draft: Draft, value: float) -> None:
        """Wind fibers and tendons."""
        for key, turn in _revolutions(draft.arm).items():
            if turn:
                draft.wind(self.name, key, math.copysign(value, turn))


def _revolutions(arm: Manipulator) -> dict[str, float]:
    """Ω of all that winds by a single number [rad], by its key."""
    return {
        actuator_key(one): float(one.value_on("revolution", arm.profile, arm.section))
        for one in arm.actuators
        if _winds_evenly(one)
    }


def _winds_evenly(actuator: Actuator) -> bool:
    angles = {one.field for one in (*actuator.variables, *actuator.series)}
    along = (
        isinstance(getattr(actuator, field), AlongArm)
        for field in angles & {"helical_angle", "routing"}
    )
    return "revolution" in angles and not any(along)
