"""What the color of a point says, and the key that tells the reader."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.cloud.redundancy import activation_distance
from softreach.plot.coloring import UNSTABLE, BundleKey, Coloring, ScalarKey, color_samples
from softreach.rod.tip_map import TipStatus
from softreach.schema import activation_symbols
from softreach.studio import markup
from softreach.studio.multiplicity import count_activations
from softreach.studio.reach import Reach, shown_rows, shown_samples
from softreach.studio.rod import rod_of
from softreach.studio.worker import all_cores

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "FAINT",
    "UNSTABLE",
    "color_label",
    "color_names",
    "key_html",
    "manipulability",
    "sample_colors",
    "sample_values",
    "shown_color",
]

Array = NDArray[np.float64]

FAINT = (196, 198, 206)
"""Gray, of the cloud without loads."""

_CLIPPED = ("manipulability", "activation distance")
_PERCENTILES = (1.0, 99.0)
_RADIUS = 1 / 60  # [L], within which D̄ compares activations


def color_names(arm: Manipulator) -> dict[str, str]:
    """What points can be colored by: name -> what the menu says."""
    box = rod_of(arm).box
    names = {"effort": "effort: mean |γ| / max |γ|", "rgb": "all activations (RGB)"}
    labels = zip(activation_symbols(arm.bundle_units), box.names, strict=True)
    names |= {f"bundle {k}": f"|{symbol}| {name}" for k, (symbol, name) in enumerate(labels)}
    names["manipulability"] = "manipulability"
    names["activation distance"] = "activation distance D̄"
    if box.dimension == 3:
        names["multiplicity"] = "multiplicity"
    return names


def sample_colors(reach: Reach, level: int, color: str) -> Coloring:
    """Colors of the samples that are shown; an unknown name colors by all activations.

    The few smallest and largest values of a scale look like the next ones: they would leave the
    others one color.
    """
    cloud = reach.cloud[["tip", "activation"]].isel(sample=shown_samples(reach, level))
    return color_samples(cloud, sample_values(reach, level, color))


def sample_values(reach: Reach, level: int, color: str) -> Literal["rgb"] | int | xr.DataArray:
    """What the samples that are shown are colored by, as the library's own figures take it."""
    import xarray as xr

    color = shown_color(reach.arm, color)
    if color == "rgb":
        return "rgb"
    if color.startswith("bundle "):
        return int(color[7:])
    if color == "multiplicity" and not reach.fine:
        return "rgb"  # coarse clouds last for a moment only, in which nothing is counted
    values = _values(reach, shown_rows(reach, level), color)
    clipped = color in _CLIPPED and np.isfinite(values).any()
    if clipped:
        values = np.clip(values, *np.nanpercentile(values, _PERCENTILES))
    attrs = {"long_name": color_label(color), "clipped": clipped}
    return xr.DataArray(values, dims="sample", attrs=attrs)


def _values(reach: Reach, rows: NDArray[np.int64], color: str) -> Array:
    if color == "multiplicity":
        return count_activations(reach, rows)  # which lets others have their turn
    with all_cores:
        return _VALUES[color](reach, rows)


def shown_color(arm: Manipulator, color: str) -> str:
    """What points are colored by where that color is asked for; it may be one of another arm."""
    return color if color in color_names(arm) else "rgb"


def color_label(color: str) -> str:
    """Label of the key of a color; "" where the key needs none."""
    return _LABELS.get(color, "")


def manipulability(arm: Manipulator, activation: Array) -> Array:
    """Volume of the tip's velocities for unit rates, √det(J Jᵀ) [L³], shape (n,).

    J = ∂r/∂γ [L]; with fewer than three bundles √det(Jᵀ J): an area or a length.
    """
    rod = rod_of(arm)
    _, slope = rod.tips_and_slopes(activation)
    return np.prod(np.linalg.svd(slope / rod.length, compute_uv=False), axis=1)


def key_html(key: BundleKey | ScalarKey | None) -> str:
    """The colors explained, as HTML without anything from elsewhere."""
    if isinstance(key, BundleKey):
        named = zip(key.labels, key.colors.tolist(), strict=True)
        parts = ((markup.Swatch(rgb), f" {label} \N{EN SPACE} ") for label, rgb in named)
        return _line(markup.inline(*(part for pair in parts for part in pair)))
    if key is None:
        return ""
    stops = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")  # viridis
    bar = f"background:linear-gradient(90deg,{','.join(stops)});height:0.6em;margin:0.2em 0"
    below, above = ("≤ ", "≥ ") if key.clipped else ("", "")
    ends = markup.spread(f"{below}{key.low:.3g}", key.label, f"{above}{key.high:.3g}")
    return _line(f'<div style="{bar}"></div>{ends}')


def _line(content: str) -> str:
    return f'<div style="font-size:0.8em;padding:0 0.8em 0.4em">{content}</div>'


def _effort(reach: Reach, rows: NDArray[np.int64]) -> Array:
    """Mean over the bundles of |γ| over the largest that each can have [-]."""
    largest = np.abs(rod_of(reach.arm).box.bounds).max(axis=1)
    share = np.abs(reach.cloud.activation.values[rows]) / np.where(largest > 0, largest, 1.0)
    return share.sum(axis=1) / max(np.count_nonzero(largest), 1)


def _manipulability(reach: Reach, rows: NDArray[np.int64]) -> Array:
    return manipulability(reach.arm, reach.cloud.activation.values[rows])


def _activation_distance(reach: Reach, rows: NDArray[np.int64]) -> Array:
    """D̄ of the samples that are shown, among all that have a tip; NaN where isolated."""
    settled = np.flatnonzero(reach.status != TipStatus.NO_EQUILIBRIUM)
    cloud = reach.cloud if len(settled) == reach.samples else reach.cloud.isel(sample=settled)
    shown = np.searchsorted(settled, rows)
    found = activation_distance(cloud, _RADIUS * reach.arm.length, queries=np.sort(shown))
    return found.values[np.argsort(np.argsort(shown))]


_VALUES = {
    "effort": _effort,
    "manipulability": _manipulability,
    "activation distance": _activation_distance,
}

_LABELS = {
    "effort": "effort: mean |γ| / max |γ| [-]",
    "multiplicity": "multiplicity",
    "manipulability": "manipulability [L³]",
    "activation distance": "activation distance D̄ [-]",
}
