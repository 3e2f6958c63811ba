"""What the color of a point says, and the key that tells the reader."""

from __future__ import annotations

import html
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.plot.coloring import BundleKey, Coloring, ScalarKey, color_samples
from softreach.redundancy import activation_distance
from softreach.schema import activation_symbols
from softreach.studio.reach import Reach, shown_samples
from softreach.studio.rod import rod_of
from softreach.studio.worker import all_cores
from softreach.workspace import ReachableSolid

if TYPE_CHECKING:
    import xarray as xr

__all__ = [
    "color_label",
    "color_names",
    "key_html",
    "manipulability",
    "sample_colors",
    "sample_values",
]

Array = NDArray[np.float64]

_RADIUS = 1 / 60  # [L], within which D̄ compares activations


def color_names(arm: Manipulator) -> dict[str, str]:
    """What points can be colored by: name -> what the menu says."""
    box = rod_of(arm).box
    names = {"rgb": "all activations (RGB)"}
    labels = zip(activation_symbols(arm.bundle_units), box.names, strict=True)
    names |= {f"bundle {k}": f"|{symbol}| {name}" for k, (symbol, name) in enumerate(labels)}
    names["manipulability"] = "manipulability"
    names["activation distance"] = "activation distance D̄"
    if box.dimension == 3:
        names["multiplicity"] = "multiplicity"
    return names


def sample_colors(reach: Reach, level: int, color: str) -> Coloring:
    """Colors of the samples that are shown; an unknown name colors by all activations."""
    cloud = reach.cloud[["tip", "activation"]].isel(sample=shown_samples(reach, level))
    coloring = color_samples(cloud, sample_values(reach, level, color))
    if isinstance(coloring.key, ScalarKey) and color in _VALUES:
        return coloring._replace(key=coloring.key._replace(label=color_label(color)))
    return coloring


def sample_values(reach: Reach, level: int, color: str) -> Literal["rgb"] | int | Array:
    """What the samples that are shown are colored by, as the library's own figures take it."""
    if color.startswith("bundle ") and int(color[7:]) < reach.arm.bundles:
        return int(color[7:])
    if color not in _VALUES or color not in color_names(reach.arm):
        return "rgb"
    cloud = reach.cloud[["tip", "activation"]].isel(sample=shown_samples(reach, level))
    with all_cores:
        return _VALUES[color](reach, cloud)


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
        parts = (f"{_swatch(rgb)} {html.escape(label)}" for label, rgb in named)
        return _line(" &ensp; ".join(parts))
    if key is None:
        return ""
    stops = ("#440154", "#3b528b", "#21918c", "#5ec962", "#fde725")  # viridis
    bar = f"background:linear-gradient(90deg,{','.join(stops)});height:0.6em;margin:0.2em 0"
    ends = f"<span>{key.low:.3g}</span><span>{html.escape(key.label)}</span><span>{key.high:.3g}"
    flex = "display:flex;justify-content:space-between"
    return _line(f'<div style="{bar}"></div><div style="{flex}">{ends}</span></div>')


def _swatch(rgb: list[int]) -> str:
    color = ",".join(map(str, rgb))
    return f'<span style="color:rgb({color})">\N{BLACK SQUARE}</span>'


def _line(content: str) -> str:
    return f'<div style="font-size:0.8em;padding:0 0.8em 0.4em">{content}</div>'


def _multiplicity(reach: Reach, cloud: xr.Dataset) -> Array:
    assert isinstance(reach.exact, ReachableSolid)  # as three free bundles make it
    # A sample is reached by its own activation at least, whatever the grid says at the rim.
    return np.maximum(reach.exact.image.counts_at(cloud.tip.values), 1).astype(float)


def _manipulability(reach: Reach, cloud: xr.Dataset) -> Array:
    return manipulability(reach.arm, cloud.activation.values)


def _activation_distance(reach: Reach, cloud: xr.Dataset) -> Array:
    """D̄ of the samples that are shown, among all there are; NaN where isolated."""
    shown = np.arange(reach.samples)[shown_samples(reach, cloud.sizes["sample"].bit_length() - 1)]
    rows = np.sort(shown)
    found = activation_distance(reach.cloud, _RADIUS * reach.arm.length, queries=rows)
    return found.values[np.argsort(np.argsort(shown))]


_VALUES = {
    "multiplicity": _multiplicity,
    "manipulability": _manipulability,
    "activation distance": _activation_distance,
}

_LABELS = {
    "multiplicity": "multiplicity",
    "manipulability": "manipulability [L³]",
    "activation distance": "activation distance D̄ [-]",
}
