"""Maps of the metrics of an atlas over the two parameters of its designs."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softreach.atlas import over_length
from softreach.plot.coloring import COLORMAP
from softreach.plot.style import styled_axes
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes


_UNITS = {"rad": "°", "1": ""}
_INDEXED = re.compile(r"(?<![a-z])[ERZaρθγ][0-9]+")
_LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_METRICS = {
    "volume": "V/L³ (α-shape)",
    "exact_volume": "V/L³ (exact)",
    "convex_volume": "convex V/L³",
    "exact_convex_volume": "convex V/L³ (exact)",
    "unreachability": "UNR (α-shape)",
    "exact_unreachability": "UNR (exact)",
}
_RELATIVE = {"m": " / L", "m2": " / L²", "m3": " / L³", "1/m": " · L"}


class SheetAxis(NamedTuple):
    """A parameter along an edge of a sheet, in the units of people."""

    label: str
    values: tuple[float, ...]

    def text(self, k: int) -> str:
        """One of its values, such as "φ = 2°"."""
        symbol, _, unit = self.label.partition(" (")
        unit = unit.rstrip(")")
        return f"{symbol} = {self.values[k]:.4g}{' ' if unit.isalpha() else ''}{unit}"


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


def plot_metric_map(atlas: xr.Dataset, metric: str, *, ax: Axes | None = None) -> Axes:
    """Contours of a metric over the two parameters of an atlas (figure 3b); its best is marked.

    Volumes and lengths are relative to each design's own L. The best is the largest value, of
    unreachability the smallest. Designs without a value stay white; where there are no contours, as
    in a single row of designs, each design is a cell.

    Args:
        atlas: From `open_atlas`, a grid of two parameters.
        metric: Which one.
        ax: Axes to draw in; None for a new figure.

    Raises:
        InvalidInput: No such metric, or no two parameters.
        MissingExtra: matplotlib is not installed.
    """
    across, up = sheet_axes(atlas)
    if metric not in atlas or atlas[metric].dims != atlas["status"].dims:
        raise InvalidInput("metric", metric, "a metric of the atlas")
    values = over_length(atlas, metric).values.T
    with styled_axes(ax) as ax:
        filled = _fill(ax, across, up, np.ma.masked_invalid(values))
        if np.isfinite(values).any():
            _mark_best(ax, across, up, values, smallest="unreachability" in metric)
        relative = _RELATIVE.get(atlas[metric].attrs.get("units", "1"), "")
        label = _METRICS.get(metric, _plain(metric) + relative)
        ax.figure.colorbar(filled, ax=ax, label=label)
        ax.set(xlabel=across.label, ylabel=up.label)
    return ax


def _axis(values: xr.DataArray) -> SheetAxis:
    si_unit = values.attrs.get("units", "1")
    unit = _UNITS.get(si_unit, si_unit)
    shown = np.degrees(values.values) if si_unit == "rad" else values.values
    name = _plain(str(values.name))
    if symbol := values.attrs.get("symbol"):
        name = _INDEXED.sub(lambda found: found[0].translate(_LOWERED), symbol)
        name += f" of {part}" if (part := values.attrs.get("part")) else ""
    return SheetAxis(f"{name} ({unit})" if unit else name, tuple(np.round(shown, 9).tolist()))


def _plain(name: str) -> str:
    return name.replace("_", " ")


def _fill(ax: Axes, across: SheetAxis, up: SheetAxis, values: Any) -> Any:
    known = values.compressed()
    if min(values.shape) < 2 or not len(known) or np.ptp(known) == 0:
        return ax.pcolormesh(_edges(across), _edges(up), values, cmap=COLORMAP)
    filled = ax.contourf(across.values, up.values, values, 14, cmap=COLORMAP)
    _draw_contours(ax, across, up, values, np.asarray(filled.levels))
    return filled


def _edges(axis: SheetAxis) -> Array:
    """Of cells around the values, the outer ones like their neighbors; around one value 1 wide."""
    values = np.asarray(axis.values, float)
    if len(values) == 1:
        return values + [-0.5, 0.5]
    middle = (values[1:] + values[:-1]) / 2
    return np.array([2 * values[0] - middle[0], *middle, 2 * values[-1] - middle[-1]])


def _draw_contours(
    ax: Axes, across: SheetAxis, up: SheetAxis, values: Array, levels: Array
) -> None:
    ink = ["w" if k < 0.65 * len(levels) else "0.15" for k in range(0, len(levels), 2)]
    lines = ax.contour(across.values, up.values, values, levels[::2], colors=ink, linewidths=0.5)
    low = np.array([across.values[0], up.values[0]])
    span = np.array([across.values[-1], up.values[-1]]) - low
    paths = ((np.asarray(path.vertices, float) - low) / span for path in lines.get_paths())
    places = []
    for path in paths:  # far from every edge
        inside = path[((path > 0.1) & (path < 0.86)).all(axis=1)]
        if len(inside):
            distance = np.abs(inside - (0.5, 0.35)).sum(axis=1)
            places.append(low + span * inside[distance.argmin()])
    if places:
        decimals = max(0, math.ceil(-math.log10(levels[1] - levels[0])))
        ax.clabel(lines, manual=places, fontsize=6, fmt=f"%.{decimals}f")


def _mark_best(ax: Axes, across: SheetAxis, up: SheetAxis, values: Array, smallest: bool) -> None:
    best = np.nanargmin(values) if smallest else np.nanargmax(values)
    row, column = np.unravel_index(best, values.shape)
    place = across.values[column], up.values[row]
    dot = {"ms": 5, "mfc": "w", "mec": "k", "mew": 0.8, "clip_on": False, "zorder": 5}
    ax.plot(*place, "o", **dot)
    # inside the axes, whichever edge the best lies at
    left = column > (len(across.values) - 1) / 2
    down = row > (len(up.values) - 1) / 2
    ax.annotate(
        f"{values[row, column]:.3f}",
        place,
        (-7 if left else 7, -6 if down else 6),
        textcoords="offset points",
        ha="right" if left else "left",
        va="top" if down else "bottom",
        fontsize=7,
        bbox={"fc": "w", "ec": "none", "pad": 1.2, "alpha": 0.8},
    )
