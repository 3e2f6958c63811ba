"""Changes of an arm, gathered before any of its parts is made again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from softreach.arm.actuators import Actuator, FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.arm.section import Section
from softreach.errors import Fault, InvalidDesign

__all__ = ["ActuatorDraft", "Draft"]

Part = TypeVar("Part")


@dataclass
class ActuatorDraft:
    """Changes of one actuator."""

    start: Actuator
    """What the changes start from."""
    fields: dict[str, float] = field(default_factory=dict)
    """Field -> new value."""
    bounds: dict[int, float] = field(default_factory=dict)
    """0 for the lower bound, 1 for the upper one -> new value for every bundle."""

    def made(self) -> Actuator:
        """The changed actuator.

        Each bundle keeps its bounds while their number stays the same; else all have the first's.
        """
        actuator = self.start
        if self.fields.get("bundles", actuator.bundles) != actuator.bundles:
            actuator = actuator.with_bounds(actuator.bounds[:1].repeat(actuator.bundles, axis=0))
        actuator = actuator.replace(**self.fields) if self.fields else actuator
        if not self.bounds:
            return actuator
        bounds = actuator.bounds.copy()
        for side, value in self.bounds.items():
            bounds[:, side] = value
        return actuator.with_bounds(bounds)


class Draft:
    """An arm that is being changed.

    Its parts are made, and checked, when all changes are known: a change may be valid only together
    with others.
    """

    def __init__(self, arm: Manipulator) -> None:
        """Begin without a change."""
        self.arm = arm
        self.profile: dict[str, float] = {}
        self.ring: dict[str, float] = {}
        self.material: dict[str, float] = {}
        self.actuators = {one.name: ActuatorDraft(one) for one in arm.actuators}

    def wind(self, name: str, revolution: float) -> None:
        """Give a fiber another revolution, which its own parameters may still override."""
        draft = self.actuators[name]
        draft.start = draft.start.replace(revolution=revolution)

    def keep_revolutions(self) -> None:
        """State the revolutions of helical fibers, so that their angles follow the profile."""
        for name, draft in self.actuators.items():
            fiber = draft.start
            if isinstance(fiber, FiberArchitecture) and fiber.helical_angle:
                self.wind(name, fiber.revolution_on(self.arm.profile, self.arm.section))

    def made(self) -> Manipulator:
        """The changed arm.

        Raises:
            InvalidDesign: The arm cannot exist; the error names every fault.
        """
        faults: list[Fault] = []
        arm = self.arm
        parts: dict[str, Any] = {
            "profile": _made(lambda: arm.profile.replace(**self.profile), "", faults),
            "section": _made(self._section, "", faults),
            "actuators": tuple(
                _made(draft.made, f"{name}.", faults) for name, draft in self.actuators.items()
            ),
        }
        if faults:
            raise InvalidDesign(faults)
        return arm.replace(**parts)

    def _section(self) -> Section:
        ring, *others = self.arm.section.rings
        material = replace(ring.material, **self.material)
        changed = replace(ring, material=material, **self.ring)
        return replace(self.arm.section, rings=(changed, *others))


def _made(make: Callable[[], Part], prefix: str, faults: list[Fault]) -> Part | None:
    """The part, or None and its faults."""
    try:
        return make()
    except InvalidDesign as error:
        faults += [fault._replace(path=prefix + fault.path) for fault in error.faults]
        return None
