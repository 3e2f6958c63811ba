"""Unit of lengths on paper: the one asked for, else L where the data know L, else the meter."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softreach.support.errors import InvalidInput
from softreach.support.units import LengthUnit, as_unit, in_lengths

if TYPE_CHECKING:
    import xarray as xr

Unit = str | LengthUnit | None
"""A unit asked for, "m", "cm", "mm" or "L"; None for L where it is known, else m."""


def unit_of(data: xr.Dataset | xr.DataArray, unit: Unit = None) -> LengthUnit:
    """The unit for data, whose attributes may say how long the arm is.

    Raises:
        InvalidInput: No such unit, or L of data that do not know it.
    """
    length = data.attrs.get("length")
    return unit_for(None if length is None else float(length), unit)


def unit_for(length: float | None, unit: Unit = None) -> LengthUnit:
    """The unit where the arm is of a length [m], or of one that is not known.

    Raises:
        InvalidInput: No such unit, L where it is not known, or a length that is not positive.
    """
    return in_lengths(length) if unit is None else as_unit(unit, length)


def common_unit(units: list[LengthUnit]) -> LengthUnit:
    """Any of them, if all are L or all are of one size, so that they may share axes.

    Raises:
        InvalidInput: None, or some data know L and others do not.
    """
    if len({unit.name for unit in units}) != 1:
        what = "some with and some without attrs['length']" if units else "none"
        raise InvalidInput("data", what, "one or more, all with attrs['length'] or all without")
    return units[0]
