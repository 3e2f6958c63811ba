"""What the figures of an atlas share: the axes of its two parameters, its lengths, its box."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.atlas import over_length
from softreach.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SheetAxis", "box_over_length", "plain", "sheet_axes"]

Array = NDArray[np.float64]

_UNITS = {"rad": "°", "1": ""}
_INDEXED = re.compile(r"(?<![a-z])([ERZaρθ])([0-9tc])")


class SheetAxis(NamedTuple):
    """A parameter along an edge of a sheet, in the units of people."""

    label: str
    values: tuple[float, ...]


def sheet_axes(atlas: xr.Dataset) -> tuple[SheetAxis, SheetAxis]:
    """The two parameters of an atlas, for the horizontal and the vertical edge.

    Raises:
        InvalidInput: The atlas is no grid of two parameters.
    """
    dims = atlas["status"].dims
    if len(dims) != 2:
        raise InvalidInput("atlas", f"of dimensions {dims}", "a grid of two parameters")
    across, up = (_axis(atlas[dim]) for dim in dims)
    return across, up


def box_over_length(atlas: xr.Dataset) -> Array:
    """Corners around all clouds, each in its own L [-], shape (2, 3).

    Raises:
        InvalidInput: The atlas has no bounding boxes, or no design is done.
    """
    if "x_min" not in atlas:
        raise InvalidInput("atlas", "without bounding boxes", 'built with the metrics "extent"')
    low = [float(over_length(atlas, f"{axis}_min").min()) for axis in "xyz"]
    high = [float(over_length(atlas, f"{axis}_max").max()) for axis in "xyz"]
    if not np.isfinite([low, high]).all():
        raise InvalidInput("atlas", "no design is done", "at least one design")
    return np.array([low, high])


def _axis(values: xr.DataArray) -> SheetAxis:
    given = values.attrs.get("units", "1")
    unit = _UNITS.get(given, given)
    shown = np.degrees(values.values) if given == "rad" else values.values
    name = _name(values)
    return SheetAxis(f"{name} ({unit})" if unit else name, tuple(np.round(shown, 9).tolist()))


def _name(values: xr.DataArray) -> str:
    """The symbol of a parameter and the part that it belongs to."""
    if "symbol" not in values.attrs:
        return plain(str(values.name))
    symbol = _in_math(values.attrs["symbol"])
    return f"{symbol} of {plain(part)}" if (part := values.attrs.get("part")) else symbol


def _in_math(symbol: str) -> str:
    """R1/R2 with its indices set low."""
    text = _INDEXED.sub(r"\1_\2", symbol)
    return symbol if text == symbol else f"${text}$"


def plain(name: str) -> str:
    """A name of the atlas as words."""
    return name.replace("_", " ")
