"""Markers: points that go with a section of an arm, where something is measured or held."""

from __future__ import annotations

from dataclasses import dataclass

from softreach.arm.number import number
from softreach.arm.stations import Located
from softreach.support.errors import Fault

__all__ = ["Marker"]

Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Marker(Located):
    """A point at r(Z) + x d1 + y d2 + z d3 of one section; it changes nothing about the arm.

    One beyond the tip, at an offset along d3, is the point of a tool that the tip holds.

    Raises:
        InvalidDesign: No name, or a station off the arm, given twice, or of no such name.
    """

    name: str
    """Name in files and results; unique within an arm."""
    station_over_length: float = number(
        "Z/L", "", "where its section is", low=0.0, high=1.0, default=1.0
    )
    """Z/L of its section [-]."""
    station: float | str | None = number(
        "Z",
        "m",
        "where its section is",
        low=0.0,
        named=True,
        instead_of="station_over_length",
        default=None,
    )
    """Z [m], or the name of a station of the arm, in place of `station_over_length`."""
    offset: Triple = number(
        "a", "m", "from the center of its section", default=(0.0, 0.0, 0.0), shape="triple"
    )
    """(x, y, z) from the center of its section, in the directors [m]."""

    def _faults(self) -> list[Fault]:
        unnamed = [] if self.name else [Fault("name", self.name, "must be given")]
        return super()._faults() + unnamed
