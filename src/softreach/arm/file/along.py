"""Quantities that change along an arm, as inline tables of design files."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, model_validator

from softreach.arm.actuators import FiberArchitecture, Tendon
from softreach.arm.along import AlongArm, Pieces, Samples
from softreach.arm.file.quantities import Quantity, refused
from softreach.arm.file.table import Table
from softreach.arm.file.toml_text import inline_table, value_text
from softreach.arm.value_checks import series_faults

__all__ = ["AlongTable", "AngleAlong", "DistanceAlong", "RoutingAlong", "along_text", "either"]


class AlongTable(Table):
    """A quantity along the arm, in the unit of the key that it belongs to."""

    stations_over_length: list[float] = Field(description="Z/L, rising from 0 to 1 [-]")
    values: list[float] = Field(
        description="One for each station; for constant ones, one for each gap between stations"
    )
    interpolation: Literal["cubic", "linear", "constant"] = Field(
        default="cubic",
        description="Monotone cubic or straight lines through values, or constant between stations",
    )

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if faults := series_faults(vars(self), "values", self.interpolation != "constant"):
            raise refused(faults[0])
        return self

    def value(self) -> AlongArm:
        """The function of Z/L."""
        if self.interpolation == "constant":
            return Pieces(stations_over_length=self._stations, values=tuple(self.values))
        return Samples(
            stations_over_length=self._stations,
            values=tuple(self.values),
            interpolation=self.interpolation,
        )

    @property
    def _stations(self) -> tuple[float, ...]:
        return tuple(self.stations_over_length)


class AngleAlong(AlongTable):
    """A helical angle along the arm."""

    values: list[Annotated[float, Quantity.of(FiberArchitecture, "helical_angle")]]  # pyright: ignore[reportIncompatibleVariableOverride]


class DistanceAlong(AlongTable):
    """A distance from the axis along the arm."""

    values: list[Annotated[float, Quantity.of(Tendon, "distance")]]  # pyright: ignore[reportIncompatibleVariableOverride]
    interpolation: Literal["cubic", "linear"] = "cubic"  # pyright: ignore[reportIncompatibleVariableOverride]


class RoutingAlong(AlongTable):
    """A polar angle along the arm, from that where it begins."""

    values: list[Annotated[float, Quantity.of(Tendon, "offset")]]  # pyright: ignore[reportIncompatibleVariableOverride]
    interpolation: Literal["cubic", "linear"] = "cubic"  # pyright: ignore[reportIncompatibleVariableOverride]


def along_text(along: AlongArm, number: Callable[[float], str] = value_text) -> str:
    """The inline table of a function of Z/L; `number` writes its values."""
    kind = along.interpolation if isinstance(along, Samples) else "constant"
    pairs = [
        ("stations_over_length", value_text(along.stations_over_length)),
        ("values", f"[{', '.join(map(number, along.values))}]"),
    ]
    return inline_table(pairs if kind == "cubic" else [*pairs, ("interpolation", value_text(kind))])


either = Discriminator(lambda value: "<table>" if isinstance(value, dict | Table) else "<plain>")
"""Which of two that a value is: a table, or something plain."""
