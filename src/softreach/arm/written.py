"""Parameters as files and the command line write them: the unit in the name, angles in degrees."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Self

from softreach.arm.manipulator import Manipulator
from softreach.arm.number import unit_suffix
from softreach.arm.parameters import Parameter, parameters_by_every_name
from softreach.support.quantity import read_quantity, unit_names


def written_name(name: str, unit: str) -> str:
    """A name with its unit: `taper_deg`, `left.helical_angle.values_deg[2]`."""
    return with_suffix(name, unit_suffix(unit))


def with_suffix(name: str, suffix: str) -> str:
    """The name with a suffix, which stands before the place in a series."""
    return re.sub(r"(\[\d+\])?$", lambda place: suffix + place[0], name, count=1)


class Written:
    """Parameters by every name, with and without units, and values as people write them."""

    def __init__(self, plain: Mapping[str, Parameter]) -> None:
        self.written = {written_name(name, p.unit): p for name, p in plain.items()}
        self.by_key = {**self.written, **plain}
        self._with_unit = self.written.keys() - plain.keys()

    @classmethod
    def of(cls, arm: Manipulator) -> Self:
        """Those of an arm."""
        return cls(parameters_by_every_name(arm))

    def number(self, key: str, value: object, unit: str | None = None) -> float:
        """A value in SI: a number under a key with its unit, or text with it; else ValueError."""
        unit = self.by_key[key].unit if unit is None else unit
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(value)
        if key in self._with_unit:
            return from_written(read_quantity(str(value), "1"), unit)
        if not isinstance(value, str) and value != 0 and unit != "1":
            raise ValueError(value)
        return read_quantity(str(value), unit)

    def allowed(self, key: str, unit: str | None = None) -> str:
        """Kind of value allowed under a key, in words."""
        unit = self.by_key[key].unit if unit is None else unit
        if key in self._with_unit:
            return "a finite number without a unit, which the name holds"
        units = ", ".join(unit_names(unit))
        if not units:
            return "a finite number without a unit"
        under = f", or a number under {written_name(key, unit)}" if key in self.by_key else ""
        return f"a finite number with its unit ({units}){under}"


def from_written(value: float, unit: str) -> float:
    """A value in SI units, from degrees where these are radians."""
    return math.radians(value) if unit == "rad" else value
