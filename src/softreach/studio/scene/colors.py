"""Colors of a reach: values of its samples and of its boundary, and the key to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud.dexterity import dexterity, manipulability_unit
from softreach.cloud.redundancy import activation_distance
from softreach.picture.page import ColorScale
from softreach.plot.coloring import POWERS, BundleKey, Coloring, ScalarKey, color_samples
from softreach.plot.figure_3d import page_keys
from softreach.rod.tip_map import has_tip
from softreach.schema import input_symbols
from softreach.studio import markup
from softreach.studio.reach import (
    Reach,
    count_activations,
    nearest_samples,
    sample_clearances,
    shown_samples,
)
from softreach.studio.state import LEVELS, rod_of
from softreach.studio.work import all_cores
from softreach.support.arrays import Array, Index

if TYPE_CHECKING:
    import xarray as xr


FAINT = (196, 198, 206)  # gray, of the cloud without loads
_MOST_COUNTS = 8  # numbers of activations that the key tells apart
_PERCENTILES = (1.0, 99.0)  # beyond which values look like the next ones
_RADIUS = 1 / 60  # [L], within which D̄ compares activations
_LEVEL = 15  # of the samples whose neighbors color a surface


def color_names(arm: Manipulator) -> dict[str, str]:
    """Colors that points can have: name -> what the menu says."""
    box = rod_of(arm).box
    names = {"effort": "effort: mean |γ| / max |γ|", "rgb": "all activations (RGB)"}
    if arm.inputs > 3:  # mixtures of more lights cannot be told apart
        names["strongest"] = "strongest bundle"
    labels = zip(input_symbols(arm), box.names, strict=True)
    names |= {f"bundle {k}": f"|{symbol}| {name}" for k, (symbol, name) in enumerate(labels)}
    names |= {"manipulability": "manipulability", "activation distance": "activation distance D̄"}
    names |= {"multiplicity": "multiplicity"} if box.dimension == 3 else {}
    return names | ({"clearance": "clearance"} if arm.surroundings else {})


def shown_color(arm: Manipulator, color: str) -> str:
    """The color of that name, which may be one of another arm."""
    return color if color in color_names(arm) else "rgb"


def sample_values(reach: Reach, level: int, color: str) -> str | int | xr.DataArray:
    """Values behind the colors of the samples shown, as the library's own figures take them."""
    import xarray as xr

    color = shown_color(reach.arm, color)
    if color.startswith("bundle "):
        return int(color[7:])
    if color not in _SCALES:
        return color
    if color == "multiplicity" and not reach.fine:
        return "rgb"  # coarse clouds last for a moment only, in which nothing is counted
    label, values_of = _SCALES[color]
    values = values_of(reach, shown_samples(reach, level))
    clipped = color != "multiplicity" and np.isfinite(values).any()
    if clipped:  # the few smallest and largest would leave the others one color
        low, high = np.nanpercentile(values, _PERCENTILES)
        if color == "clearance" and high > 0.0:  # what touches has one color
            low = max(low, 0.0)
        values = np.clip(values, low, high)
    unit = manipulability_unit(reach.arm.input_units, "L").translate(POWERS)
    name = label.format(unit=unit, length=reach.arm.length_unit.label("clearance"))
    attrs = {"long_name": name, "clipped": clipped}
    return xr.DataArray(values, dims="sample", attrs=attrs, name=color)


def sample_colors(reach: Reach, level: int, color: str, *, shares: bool = True) -> Coloring:
    """Colors of the first 2^level samples; the key to numbers of activations may have shares."""
    cloud = reach.cloud[["tip", "activation"]].isel(sample=shown_samples(reach, level))
    values = sample_values(reach, level, color)
    coloring = color_samples(cloud, values)
    if getattr(values, "name", "") != "multiplicity":
        return coloring
    return coloring._replace(key=_counts_key(coloring.rgb, np.asarray(values), shares))


def surface_colors(reach: Reach, color: str) -> Coloring:
    """Colors of the vertices of the boundary, and the key to them."""
    import xarray as xr

    boundary, color = reach.boundary, shown_color(reach.arm, color)
    known = reach.sheets.activation is not None and color != "activation distance"
    if known or color in ("multiplicity", "clearance"):
        return sample_colors(boundary, LEVELS[-1], color, shares=False)
    values = sample_values(reach, _LEVEL, color)
    if not isinstance(values, str | int):
        near = nearest_samples(reach, boundary.cloud.tip.values)
        values = xr.DataArray(values.values[near].mean(axis=1), dims="sample", attrs=values.attrs)
    return color_samples(boundary.cloud, values)


def _counts_key(colors: NDArray[np.uint8], counts: Array, shares: bool) -> BundleKey:
    """Color of each number of activations, and the share of the places that have it."""
    known, first, many = np.unique(counts, return_index=True, return_counts=True)
    last = min(len(known), _MOST_COUNTS) - 1
    names = [f"{count:.0f}" for count in known[: last + 1]]
    if len(known) > _MOST_COUNTS:
        names[last] += f" to {known[-1]:.0f}"
    if shares:
        parts = np.add.reduceat(100 * many / len(counts), np.arange(last + 1))
        names = [f"{name}: {part:.2g} %" for name, part in zip(names, parts, strict=True)]
    kept = colors[first][: len(names)]
    title = "activations that reach a place:"
    return BundleKey(tuple(names), kept, ("",) * len(names), title=title)


def key_html(key: BundleKey | ScalarKey | None) -> str:
    """The colors explained, as HTML without anything from elsewhere."""
    return "".join(
        markup.scale(each.colors, each.numbers[0], each.label, each.numbers[-1])
        if isinstance(each, ColorScale)
        else markup.swatches(each.title, each.entries)
        for each in page_keys(key)
    )


def _manipulability(reach: Reach, rows: Index) -> Array:
    """√det(J Jᵀ) with J = ∂r/∂γ [L per input]; of fewer than three bundles an area or a length."""
    with all_cores:
        volume = dexterity(reach.cloud.isel(sample=rows)).manipulability.values
    return volume / reach.arm.length ** min(reach.arm.inputs, 3)


def _clearance(reach: Reach, rows: Index) -> Array:
    return sample_clearances(reach, rows) / reach.arm.length_unit.size


def _activation_distance(reach: Reach, rows: Index) -> Array:
    """D̄ of the samples that are shown, among all that have a tip; NaN where isolated."""
    settled = np.flatnonzero(has_tip(reach.status))
    cloud = reach.cloud if len(settled) == reach.samples else reach.cloud.isel(sample=settled)
    shown = np.searchsorted(settled, rows)
    with all_cores:
        distance = activation_distance(cloud, _RADIUS * reach.arm.length, queries=np.sort(shown))
    return distance.values[np.argsort(np.argsort(shown))]


_SCALES = {
    "manipulability": ("manipulability [{unit}]", _manipulability),
    "activation distance": ("activation distance D̄ [-]", _activation_distance),
    "clearance": ("{length}", _clearance),
    # none is found where a set is thinner than a boundary looks inside
    "multiplicity": ("multiplicity", lambda *shown: np.maximum(count_activations(*shown), 1.0)),
}
"""Colors that are numbers: label of the key, and values of samples."""
