"""Free numbers of a calibration as they are typed: names with units in them, priors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.values import pairs_in
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

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
    names = _Names(arm)
    given = [name.strip() for text in texts for name in text.split(",")]
    return [names.tied(name) for name in given if name]


def priors(arm: Manipulator, texts: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Width, or mean and width, of numbers in their units by name, from NAME=MEAN:WIDTH.

    Raises:
        InvalidInput: Text that is anything else, or no such number.
    """
    names, result = _Names(arm), {}
    allowed = "NAME=WIDTH or NAME=MEAN:WIDTH, such as taper=1deg"
    for name, value in (pairs_in("prior", texts, allowed) or {}).items():
        result[names.tied(name)] = tuple(names.value(name, part) for part in value.split(":"))
    return result


class _Names:
    def __init__(self, arm: Manipulator) -> None:
        from softreach.arm.parameters import parameters_by_every_name, written_parameters

        self.plain = parameters_by_every_name(arm)
        self.written = written_parameters(arm)

    def tied(self, name: str) -> str:
        return " = ".join(self._one(part.strip()) for part in name.split("="))

    def _one(self, name: str) -> str:
        return self.written[name].name if self._has_unit(name) else name

    def _has_unit(self, name: str) -> bool:
        return name in self.written and name not in self.plain

    def value(self, name: str, text: str) -> float:
        from softreach.arm.parameters import from_written
        from softreach.support.quantity import read_quantity, unit_names

        first = name.split("=")[0].strip()
        if first in _POSE:
            unit = "m" if _POSE.index(first) < 3 else "rad"
        else:
            known = self.written if self._has_unit(first) else self.plain
            if first not in known:
                allowed = "of a number that is free, by its full name"
                raise InvalidInput("prior", name, allowed)
            unit = known[first].unit
        try:
            if self._has_unit(first):
                return from_written(read_quantity(text, "1"), unit)
            return read_quantity(text, unit)
        except ValueError:
            units = "" if self._has_unit(first) else ", ".join(unit_names(unit))
            allowed = f"a finite number with its unit ({units})" if units else "a finite number"
            raise InvalidInput(f"prior of {name}", text, allowed) from None
