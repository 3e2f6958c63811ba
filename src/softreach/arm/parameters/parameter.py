"""One design parameter: its name, its unit, its value for an arm, and how it changes one."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from softreach.arm.actuators import Actuator
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters.draft import Draft
from softreach.arm.parameters.parts import part_of
from softreach.arm.variable import Variable
from softreach.support.arguments import plain
from softreach.support.errors import Fault

__all__ = [
    "BoundParameter",
    "ElementParameter",
    "FieldParameter",
    "Parameter",
    "SharedParameter",
]


@dataclass(frozen=True, kw_only=True)
class Parameter(ABC):
    """A number in which designs can differ."""

    name: str
    """What it is called: `taper`, `left.offset`, or `rings[0].material.young_modulus`."""
    owner: str = ""
    """The part that it belongs to, such as `left` or `rings[0].material`; "" for the whole arm."""
    variable: Variable
    """The field behind it."""

    @property
    def unit(self) -> str:
        """Unit of its values: "m", "rad", "Pa", "kg/m³", "N", or "1"."""
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
    def field(self) -> str:
        """The name without its owner."""
        return self.name.removeprefix(f"{self.owner}.") if self.owner else self.name

    @abstractmethod
    def value(self, arm: Manipulator) -> float:
        """Its value on an arm [unit]; where several parts share it, that of the first.

        NaN where the arm does not give it as one number: a modulus that is left out, or an angle
        that changes along the arm. It can be set all the same.
        """

    @abstractmethod
    def change(self, draft: Draft, value: float) -> None:
        """Note the change to this value [unit]."""


@dataclass(frozen=True, kw_only=True)
class FieldParameter(Parameter):
    """A field of one part."""

    key: str
    """Of the part."""

    def value(self, arm: Manipulator) -> float:
        """What the part has on this arm."""
        part, name = part_of(arm, self.key), self.variable.field
        if isinstance(part, Actuator):
            return _number(part.value_on(name, arm.profile, arm.section))
        return _number(getattr(part, name))

    def change(self, draft: Draft, value: float) -> None:
        """Change the part."""
        counted = self.whole and float(value).is_integer()
        draft.set_field(self.name, self.key, self.variable.field, int(value) if counted else value)


@dataclass(frozen=True, kw_only=True)
class ElementParameter(Parameter):
    """One number of a series: a radius of a profile, or a value along the arm."""

    key: str
    """Of the part."""
    series: str
    """Path of the series in the part: `radii`, or `helical_angle.values`."""
    place: int
    """Which number, from 0."""

    def value(self, arm: Manipulator) -> float:
        """What the series has there."""
        numbers = part_of(arm, self.key)
        for field in self.series.split("."):
            numbers = getattr(numbers, field)
        return float(numbers[self.place])

    def change(self, draft: Draft, value: float) -> None:
        """Change that number, if it may have this value: whatever holds it names no places."""
        if not self.variable.allowed.admits(plain(value)):
            draft.refuse(Fault(self.name, value, self.variable.allowed))
            return
        draft.set_element(self.name, self.key, self.series, self.place, value)


@dataclass(frozen=True, kw_only=True)
class BoundParameter(Parameter):
    """The lower or the upper bound of one actuator's activations."""

    key: str
    """Of the actuator."""
    side: int
    """0 for lower, 1 for upper."""
    bundle: int | None = None
    """Which bundle, from 0; None for all."""

    def value(self, arm: Manipulator) -> float:
        """The bound of the bundle; of all of them, that of the first."""
        return float(part_of(arm, self.key).bounds[self.bundle or 0, self.side])

    def change(self, draft: Draft, value: float) -> None:
        """Change the bound."""
        draft.set_bound(self.name, self.key, self.side, self.bundle, value)


@dataclass(frozen=True, kw_only=True)
class SharedParameter(Parameter):
    """The same field of several parts at once."""

    parts: tuple[Parameter, ...]

    def value(self, arm: Manipulator) -> float:
        """That of the first."""
        return self.parts[0].value(arm)

    def change(self, draft: Draft, value: float) -> None:
        """Change all of them, under the name that they share."""
        for part in self.parts:
            replace(part, name=self.name).change(draft, value)


def _number(value: Any) -> float:
    """The value, or NaN where it is left out or no number."""
    plain = isinstance(value, int | float | np.number)
    return float(value) if plain else float("nan")
