"""One design parameter: its name, its unit, its value for an arm, and how it changes one."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass

from softreach.arm.actuators import Actuator, FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters.draft import Draft
from softreach.arm.variable import Variable

__all__ = [
    "ActuatorParameter",
    "BoundParameter",
    "Parameter",
    "ProfileParameter",
    "RadiusRatio",
    "Revolution",
    "RingMaterialParameter",
    "SharedParameter",
    "Taper",
]


@dataclass(frozen=True)
class Parameter(ABC):
    """A number in which designs can differ."""

    name: str
    """What it is called: `taper`, or `left.offset` for the offset of the actuator "left"."""
    variable: Variable
    """The field behind it."""

    @property
    def unit(self) -> str:
        """Unit of its values: "m", "rad", or "1"."""
        return self.variable.allowed.unit or "1"

    @property
    def symbol(self) -> str:
        """What formulas call it."""
        return self.variable.symbol

    @property
    def meaning(self) -> str:
        """What it is, in a few words."""
        return self.variable.meaning

    @property
    def whole(self) -> bool:
        """Whether it counts something."""
        return self.variable.allowed.whole

    @property
    def owner(self) -> str:
        """Name of the actuator that it belongs to; "" for one of the whole arm."""
        return self.name.rpartition(".")[0]

    @property
    def field(self) -> str:
        """The name without its owner."""
        return self.name.rpartition(".")[2]

    @abstractmethod
    def value(self, arm: Manipulator) -> float:
        """Its value on an arm [unit]; where several actuators share it, that of the first."""

    @abstractmethod
    def change(self, draft: Draft, value: float) -> None:
        """Note the change to this value [unit]."""


@dataclass(frozen=True)
class ProfileParameter(Parameter):
    """A field of the profile."""

    def value(self, arm: Manipulator) -> float:
        """What the profile has."""
        return float(getattr(arm.profile, self.variable.field))

    def change(self, draft: Draft, value: float) -> None:
        """Change the profile."""
        draft.profile[self.variable.field] = value


@dataclass(frozen=True)
class Taper(Parameter):
    """The taper angle: when it changes, revolutions stay and helical angles follow."""

    def value(self, arm: Manipulator) -> float:
        """φ [rad]."""
        return float(getattr(arm.profile, self.variable.field))

    def change(self, draft: Draft, value: float) -> None:
        """Change the profile; the fibers keep their revolutions."""
        draft.keep_revolutions()
        draft.profile[self.variable.field] = value


@dataclass(frozen=True)
class RadiusRatio(Parameter):
    """Where the ring begins."""

    def value(self, arm: Manipulator) -> float:
        """R1/R2 [-]."""
        return arm.section.rings[0].inner_ratio

    def change(self, draft: Draft, value: float) -> None:
        """Change the ring."""
        draft.ring["inner_ratio"] = value


@dataclass(frozen=True)
class RingMaterialParameter(Parameter):
    """A field of the ring's material."""

    def value(self, arm: Manipulator) -> float:
        """What the material has."""
        return float(getattr(arm.section.rings[0].material, self.variable.field))

    def change(self, draft: Draft, value: float) -> None:
        """Change the material."""
        draft.material[self.variable.field] = value


@dataclass(frozen=True)
class Revolution(Parameter):
    """The revolution of all helical fibers; each keeps its sense, longitudinal ones stay so."""

    def value(self, arm: Manipulator) -> float:
        """|Ω| of the first helical fiber [rad]; 0 without one."""
        return next((abs(turn) for turn in _revolutions(arm).values() if turn), 0.0)

    def change(self, draft: Draft, value: float) -> None:
        """Wind the fibers."""
        for name, turn in _revolutions(draft.arm).items():
            if turn:
                draft.wind(name, math.copysign(value, turn))


@dataclass(frozen=True)
class ActuatorParameter(Parameter):
    """A field of one actuator."""

    def value(self, arm: Manipulator) -> float:
        """What the actuator has on this arm."""
        actuator = _actuator(arm, self.owner)
        return float(actuator.value_on(self.variable.field, arm.profile, arm.section))

    def change(self, draft: Draft, value: float) -> None:
        """Change the actuator."""
        count = int(value) if self.whole and value == int(value) else value
        draft.actuators[self.owner].fields[self.variable.field] = count


@dataclass(frozen=True)
class BoundParameter(Parameter):
    """The lower or the upper bound of one actuator's activations."""

    side: int
    """0 for lower, 1 for upper."""

    def value(self, arm: Manipulator) -> float:
        """The bound of its first bundle."""
        return float(_actuator(arm, self.owner).bounds[0, self.side])

    def change(self, draft: Draft, value: float) -> None:
        """Change the bound of all its bundles."""
        draft.actuators[self.owner].bounds[self.side] = value


@dataclass(frozen=True)
class SharedParameter(Parameter):
    """The same field of several actuators at once."""

    parts: tuple[Parameter, ...]

    def value(self, arm: Manipulator) -> float:
        """What the first of them has."""
        return self.parts[0].value(arm)

    def change(self, draft: Draft, value: float) -> None:
        """Change them all."""
        for part in self.parts:
            part.change(draft, value)


def _actuator(arm: Manipulator, name: str) -> Actuator:
    return next(one for one in arm.actuators if one.name == name)


def _revolutions(arm: Manipulator) -> dict[str, float]:
    """Ω of every fiber architecture [rad], by its name."""
    fibers = [one for one in arm.actuators if isinstance(one, FiberArchitecture)]
    return {fiber.name: fiber.revolution_on(arm.profile, arm.section) for fiber in fibers}
