"""What the figures of an atlas share: the axes of its two parameters, its lengths, its box."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.atlas import over_length
from softreach.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["SheetAxis", "box_over_length", "plain", "sheet_axes"]

Array = NDArray[np.float64]

_SYMBOLS = {"revolution": "Ω", "taper": "φ", "poisson_ratio": "ν", "radius_ratio": "$R_1/R_2$"}


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
    angle = values.attrs.get("units") == "rad"
    unit = (
        "°" if angle else {"1": ""}.get(values.attrs.get("units", "1"), values.attrs.get("units"))
    )
    shown = np.degrees(values.values) if angle else values.values
    name = _SYMBOLS.get(str(values.name), plain(str(values.name)))
    return SheetAxis(f"{name} ({unit})" if unit else name, tuple(np.round(shown, 9).tolist()))


def plain(name: str) -> str:
    """A name of the atlas as words."""
    return name.replace("_", " ")
