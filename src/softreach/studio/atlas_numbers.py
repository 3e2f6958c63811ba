"""What an atlas says of the design that is nearest, and why its numbers differ."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import find_parameter
from softreach.atlas import over_length

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["nearest_numbers"]

_PAIRS = {"volume": ("V / L³", 1.0, ""), "unreachability": ("UNR", 100.0, " %")}
_SPACINGS = 3.0
"""Radii below so many mean spacings fall through between the samples."""


def nearest_numbers(atlas: xr.Dataset, metric: str, design: Manipulator) -> str:
    """The metric at the design of the atlas that is nearest; beside it what it is compared with.

    The volume and the unreachability are known in two ways: of the α-shape of samples, and exactly.

    Args:
        atlas: From `open_atlas`.
        metric: Which one.
        design: The present one.
    """
    here = _nearest(atlas, design)
    name = metric.removeprefix("exact_")
    both = {name, f"exact_{name}", "exact_volume"} <= set(atlas.data_vars)
    where = f"Nearest design of the atlas ({_place(atlas, here)}): "
    if name not in _PAIRS or not both:
        return f"{where}{metric.replace('_', ' ')} {_value(atlas, metric, here):.4g}."
    symbol, scale, unit = _PAIRS[name]
    exact, sampled = (scale * _value(atlas, each, here) for each in (f"exact_{name}", name))
    if not np.isfinite([exact, sampled]).all():
        return f"{where}not computed."
    return (
        f"{where}{symbol} {exact:.4g}{unit} exact, {sampled:.4g}{unit} of the α-shape of "
        f"{_command(atlas)['n']:,} samples. {_reason(atlas, here)}"
    )


def _reason(atlas: xr.Dataset, here: dict[str, int]) -> str:
    """Why an α-shape is not the exact set."""
    command = _command(atlas)
    alpha, exact = command["alpha_over_length"], _value(atlas, "exact_volume", here)
    if alpha == "critical" or not exact > 0:
        return "Samples fill less than the set, a wide α bridges what is hollow."
    spacing = (exact / float(command["n"])) ** (1 / 3)
    needed = _SPACINGS * spacing
    if float(alpha) < needed:
        return (
            f"The samples are too few: {spacing:.2g} L apart, they need α ≥ {needed:.2g} L, and "
            f"it is {float(alpha):g} L, so that the α-shape is full of holes."
        )
    return (
        f"Samples {spacing:.2g} L apart fill a few percent less than the set; α = "
        f"{float(alpha):g} L bridges gaps and hollows narrower than {2 * float(alpha):g} L."
    )


def _nearest(atlas: xr.Dataset, design: Manipulator) -> dict[str, int]:
    """Its place along each parameter."""
    values = {str(name): atlas[name].values for name in atlas["status"].dims}
    return {
        name: int(np.abs(known - find_parameter(design, name).value(design)).argmin())
        for name, known in values.items()
    }


def _place(atlas: xr.Dataset, here: dict[str, int]) -> str:
    parts = []
    for name, k in here.items():
        value, unit = float(atlas[name].values[k]), atlas[name].attrs.get("units", "1")
        if unit == "rad":
            value, unit = float(np.degrees(value)), "deg"
        parts.append(f"{name.replace('_', ' ')} {value:.4g}{'' if unit == '1' else f' {unit}'}")
    return ", ".join(parts)


def _value(atlas: xr.Dataset, metric: str, here: dict[str, int]) -> float:
    return float(over_length(atlas, metric).isel(here))


def _command(atlas: xr.Dataset) -> dict[str, int | float | str]:
    return json.loads(atlas.attrs["command"])
