"""Unit of lengths on paper: L where the data know L, else the meter."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["METER", "LengthUnit", "common_unit", "in_lengths", "unit_of"]

_SUPERSCRIPTS = {1: "", 2: "²", 3: "³"}


class LengthUnit(NamedTuple):
    """Unit of an axis, and its label."""

    size: float
    """[m]"""
    relative: bool
    """True if it is L, the length of the arm."""

    def of(self, meters: ArrayLike) -> Array:
        """Lengths [m] as numbers on an axis."""
        return np.asarray(meters, float) / self.size

    def label(self, name: str, power: int = 1) -> str:
        """Of an axis with lengths, areas or volumes, such as "x / L" or "x [m]"."""
        above = _SUPERSCRIPTS[power]
        return f"{name} / L{above}" if self.relative else f"{name} [m{above}]"

    @property
    def symbol(self) -> str:
        """Behind a number."""
        return "L" if self.relative else "m"


METER = LengthUnit(1.0, relative=False)


def unit_of(data: xr.Dataset | xr.DataArray) -> LengthUnit:
    """L if the attributes of the data say how long the arm is, else the meter."""
    length = data.attrs.get("length")
    return METER if length is None else in_lengths(float(length))


def in_lengths(length: float | None) -> LengthUnit:
    """L for a given length [m], the meter for None.

    Raises:
        InvalidInput: A length that is not positive.
    """
    if length is None:
        return METER
    if not length > 0:
        raise InvalidInput("length", length, "> 0 m")
    return LengthUnit(length, relative=True)


def common_unit(units: list[LengthUnit]) -> LengthUnit:
    """Any of them, if all are L or all are meters, so that they may share axes.

    Raises:
        InvalidInput: None, or some data know L and others do not.
    """
    if len({unit.relative for unit in units}) != 1:
        what = "some with and some without attrs['length']" if units else "none"
        raise InvalidInput("data", what, "one or more, all with attrs['length'] or all without")
    return units[0]
