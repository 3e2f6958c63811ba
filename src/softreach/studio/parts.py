"""The parts of an arm as a list, and the numbers of each in units that a person types."""

from __future__ import annotations

import math
from typing import NamedTuple

from softreach.arm.actuators import SectorActuator
from softreach.arm.edits import ring_label
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import Parameter, parameters

__all__ = ["BODY", "Number", "Part", "numbers", "parts"]

BODY = "body"

_SHOWN = {"rad": ("deg", math.radians(1)), "m": ("mm", 1e-3), "Pa": ("kPa", 1e3)}


class Part(NamedTuple):
    """One thing that an arm consists of."""

    label: str
    """What the list calls it."""
    owners: tuple[str, ...]
    """Owners of its parameters."""
    name: str
    """Its own name, which may be empty."""
    ring: int | None = None
    """Index of a ring; None for all else."""
    actuator: str = ""
    """Name of an actuator; "" for all else."""
    home: int | str | None = None
    """The ring that an actuator is in."""


class Number(NamedTuple):
    """One parameter of a part as it is typed."""

    parameter: str
    label: str
    hint: str
    value: float
    """In the unit that is shown; NaN where the design leaves it out."""
    scale: float
    """Units of the parameter per shown unit."""
    whole: bool


def parts(arm: Manipulator) -> list[Part]:
    """Body, core, rings and actuators of an arm."""
    found = [Part(BODY, ("", "profile"), "")]
    if arm.section.core is not None:
        found.append(Part("core", ("core",), ""))
    for k, ring in enumerate(arm.section.rings):
        owners = (f"rings[{k}]", f"rings[{k}].material")
        found.append(Part(ring_label(arm, k), owners, ring.name, ring=k))
    for one in arm.actuators:
        home = one.ring if isinstance(one, SectorActuator) else None
        taken = any(part.label == one.name for part in found)
        label = f"{one.name} (actuator)" if taken else one.name
        found.append(Part(label, (one.name,), one.name, actuator=one.name, home=home))
    return found


def numbers(arm: Manipulator, part: Part) -> list[Number]:
    """What can be typed for a part, in the order of its parameters."""
    known = parameters(arm).values()
    return [_number(arm, one) for one in known if one.owner in part.owners]


def _number(arm: Manipulator, one: Parameter) -> Number:
    unit, scale = _SHOWN.get(one.unit, ("" if one.unit == "1" else one.unit, 1.0))
    label = f"{one.symbol} [{unit}]" if unit else one.symbol
    value = float(f"{one.value(arm) / scale:.10g}")
    return Number(one.name, label, f"{one.meaning}: {one.name}", value, scale, one.whole)
