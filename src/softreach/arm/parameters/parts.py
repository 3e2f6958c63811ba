"""The parts of an arm that have numbers, and where in them these stand."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

from softreach.arm.actuators import Actuator
from softreach.arm.along import AlongArm
from softreach.arm.manipulator import Manipulator
from softreach.arm.value_checks import INSIDE_RANGE
from softreach.arm.variable import Variable

__all__ = ["WHOLE", "Series", "actuator_key", "part_of", "parts", "prefix_of", "series_of"]

WHOLE = {"profile": "", "section": "", "loads": "loads."}
"""Fields of an arm that are parts, and what the names of their variables begin with."""

_STATION = Variable("stations_over_length", "Z/L", "place of a value", INSIDE_RANGE)


class Series(NamedTuple):
    """Several numbers in one field of a part, each of which is a parameter."""

    path: str
    """`radii`, or `helical_angle.values` where the field is a function along the arm."""
    variable: Variable
    """What each of them is."""
    places: range
    """Which of them may change."""


def parts(arm: Manipulator) -> dict[str, Any]:
    """Every part by its key: `profile`, `rings[0].material`, `core`, `actuators[left]`."""
    found = {field: part for field in WHOLE if (part := getattr(arm, field)) is not None}
    for k, ring in enumerate(arm.section.rings):
        found |= {f"rings[{k}]": ring, f"rings[{k}].material": ring.material}
    if arm.section.core is not None:
        found["core"] = arm.section.core
    return found | {actuator_key(one): one for one in arm.actuators}


def part_of(arm: Manipulator, key: str) -> Any:
    """One part by its key."""
    return parts(arm)[key]


def actuator_key(actuator: Actuator) -> str:
    """The key of an actuator, which no other part has, whatever the actuator is called."""
    return f"actuators[{actuator.name}]"


def prefix_of(key: str, path: str = "") -> str:
    """What the name of a parameter of this part begins with.

    Args:
        key: Of the part.
        path: Field or series; series of the whole arm bear the name of their part.
    """
    if key.startswith("actuators["):
        return key[len("actuators[") : -1] + "."
    in_series = key == "profile" and path in ("radii", "stations_over_length")
    return f"{key}." if in_series else WHOLE.get(key, f"{key}.")


def series_of(part: Any) -> Iterator[Series]:
    """All series of a part; of stations only those between base and tip can change."""
    along: tuple[Variable, ...] = getattr(part, "series", ())
    for variable in (*part.variables, *along):
        value = getattr(part, variable.field)
        if isinstance(value, AlongArm):
            field, inside = variable.field, range(1, len(value.stations_over_length) - 1)
            yield Series(f"{field}.stations_over_length", _STATION, inside)
            yield Series(f"{field}.values", variable, range(len(value.values)))
        elif isinstance(value, tuple):
            last = len(value) - 1
            stations = variable.field == "stations_over_length"
            yield Series(variable.field, variable, range(1, last) if stations else range(last + 1))
