"""Free numbers of a calibration as they are typed: names with units in them, priors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.values import pairs_in
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator
    from softreach.arm.written import Written

Free = Annotated[
    list[str],
    Parameter(
        help="Numbers that may change, comma-separated: names of softreach list parameters DESIGN, "
        "with * for any text; a=b=c to share one value; pose, pose.position or pose.rotation for "
        "the base. May be repeated.",
    ),
]
_POSE = ("pose.x", "pose.y", "pose.z", "pose.rx", "pose.ry", "pose.rz")


def free_names(arm: Manipulator, texts: Sequence[str]) -> list[str]:
    """Names of free numbers as Python takes them, from names that may have their units."""
    from softreach.arm.written import Written

    names = Written.of(arm)
    given = [name.strip() for text in texts for name in text.split(",")]
    return [_tied(names, name) for name in given if name]


def priors(arm: Manipulator, texts: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Width, or mean and width, of numbers in their units by name, from NAME=MEAN:WIDTH.

    Raises:
        InvalidInput: Text that is anything else, or no such number.
    """
    from softreach.arm.written import Written

    names, result = Written.of(arm), {}
    allowed = "NAME=WIDTH or NAME=MEAN:WIDTH, such as taper=1deg"
    for name, text in (pairs_in("prior", texts, allowed) or {}).items():
        first = name.split("=")[0].strip()
        unit = None if first not in _POSE else "m" if _POSE.index(first) < 3 else "rad"
        if unit is None and first not in names.by_key:
            raise InvalidInput("prior", name, "of a number that is free, by its full name")
        try:
            values = tuple(names.number(first, part, unit) for part in text.split(":"))
        except ValueError:
            allowed = names.allowed(first, unit)
            raise InvalidInput(f"prior of {name}", text, allowed) from None
        result[_tied(names, name)] = values
    return result


def _tied(names: Written, name: str) -> str:
    parts = (part.strip() for part in name.split("="))
    return " = ".join(names.by_key[x].name if x in names.by_key else x for x in parts)
