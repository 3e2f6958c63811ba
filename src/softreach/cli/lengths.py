"""Lengths as commands show and write them: in the unit that was chosen, or one that is handy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from softreach.support.units import METER, LengthUnit, as_unit

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

Rows = dict[str, tuple[Any, str]]
"""Name -> (value, unit)."""

_POWERS = {"m": 1, "m²": 2, "m³": 3}
_ERROR = " error (estimate)"  # behind the name of a row with the error of another


def check_unit(unit: str | None) -> None:
    """Refuse a unit that does not exist before anything is computed."""
    if unit is not None:
        as_unit(unit, 1.0)


@dataclass(frozen=True)
class Lengths:
    """The lengths of one arm in a unit."""

    unit: LengthUnit
    """Of what is printed and drawn."""
    length: float
    """L [m]."""
    chosen: bool
    """True if the unit was asked for, here or in the design file."""

    @classmethod
    def of(cls, arm: Manipulator, unit: str | None) -> Self:
        """Lengths of an arm in the unit asked for, that of its file, or one that is handy.

        Raises:
            InvalidInput: No such unit.
        """
        chosen = unit is not None or arm.display_unit is not None
        shown = arm.length_unit if unit is None else as_unit(unit, arm.length)
        return cls(shown, arm.length, chosen)

    @property
    def written(self) -> LengthUnit:
        """Unit of tables and meshes, which other programs take to be in m unless it was chosen."""
        return self.unit if self.chosen else METER

    def place(self, point: Iterable[float]) -> str:
        """A position [m] in words: "(200, 100, 600) mm"."""
        return f"({', '.join(f'{x / self.unit.size:.6g}' for x in point)}) {self.unit.name}"

    def text(self, meters: float, digits: str = ".6g") -> str:
        """A length [m] in words: "12.5 mm"."""
        return self.unit.rounded(meters, digits=digits)

    def record(self, name: str, meters: Any) -> dict[str, Any]:
        """Lengths [m] for machines, in m and in L."""
        return {f"{name}_m": meters, f"{name}_L": _over(meters, self.length)}

    def for_people(self, rows: Mapping[str, tuple[Any, str]]) -> Rows:
        """The rows with lengths, areas and volumes in the unit, each beside its error."""
        shown: Rows = {}
        beside: set[str] = set()  # errors that stand in the row of their value
        for name, (value, unit) in rows.items():
            power, error = _POWERS.get(unit), rows.get(f"{name}{_ERROR}", (None, ""))[0]
            if power is None:
                shown[name] = (value, unit)
            elif error is not None and math.isfinite(value) and 0.0 < error < math.inf:
                shown[name] = (self.unit.text(value, power, error), "")
                beside.add(f"{name}{_ERROR}")
            elif name not in beside:
                shown[name] = (_over(value, self.unit.scale(power)), self.unit.symbol(power))
        return shown

    def for_machines(self, rows: Mapping[str, tuple[Any, str]]) -> Iterator[tuple[str, Any, str]]:
        """Name, value and unit of every row; lengths, areas and volumes in SI units and in L."""
        relative = LengthUnit("L", self.length)
        for name, (value, unit) in rows.items():
            yield name, value, unit
            if power := _POWERS.get(unit):
                yield name, _over(value, relative.scale(power)), relative.symbol(power)


def _over(value: Any, scale: float) -> Any:
    if value is None:
        return None
    if isinstance(value, list | tuple):
        return [_over(item, scale) for item in value]
    return value / scale
