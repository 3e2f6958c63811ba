"""Figures of an atlas: maps of its metrics, and some of its clouds from two sides."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.atlas import over_length
from softreach.cloud import design_of
from softreach.errors import InvalidInput
from softreach.plot.arm import plot_arm
from softreach.plot.cloud import plot_cloud
from softreach.plot.coloring import color_samples, draw_figure_key
from softreach.plot.projection import OBLIQUE
from softreach.plot.sheet import SheetAxis
from softreach.plot.style import figure_style, pyplot, small_axes

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["atlas_box", "plot_corners", "plot_metric_map", "sheet_axes"]

Array = NDArray[np.float64]

_SYMBOLS = {"revolution": "Ω", "taper": "φ", "poisson_ratio": "ν", "radius_ratio": "$R_1/R_2$"}
_METRICS = {
    "volume": "$V/L^3$ (α-shape)",
    "exact_volume": "$V/L^3$ (exact)",
    "convex_volume": "$V_{conv}/L^3$",
    "exact_convex_volume": "$V_{conv}/L^3$ (exact)",
    "unreachability": "UNR (α-shape)",
    "exact_unreachability": "UNR (exact)",
}


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


def atlas_box(atlas: xr.Dataset) -> Array:
    """Corners around all clouds, each in lengths of its own design [L], shape (2, 3).

    Raises:
        InvalidInput: The atlas has no bounding boxes, or no design is done.
    """
    if "x_min" not in atlas:
        raise InvalidInput("atlas", "without bounding boxes", 'built with the metrics "extent"')
    low = [float(over_length(atlas, f"{axis}_min").min()) for axis in "xyz"]
    high = [float(over_length(atlas, f"{axis}_max").max()) for axis in "xyz"]
    if not np.isfinite([low, high]).all():
        raise InvalidInput("atlas", "no design is done", "one design at least")
    return np.array([low, high])


def plot_corners(
    clouds: list[tuple[str, xr.Dataset]],
    *,
    box: Array,
    view: tuple[float, float] = OBLIQUE,
    width: float = 6.9,
) -> Figure:
    """Clouds from two opposing sides, one column each, with their arms at rest (figure 2b).

    Args:
        clouds: Title and cloud of each column; the cloud says which arm.
        box: What each panel shows [L], shape (2, 3).
        view: Azimuth and elevation of the eye of the upper row [rad]; the lower row is opposite.
        width: Of the figure [inch].
    """
    azimuth, elevation = view
    sides = ((azimuth, elevation), (azimuth + np.pi, elevation))
    with figure_style():
        column = width / len(clouds)
        figure = pyplot().figure(figsize=(width, 2 * column + 0.5))
        panels = figure.subplots(2, len(clouds), squeeze=False)
        figure.subplots_adjust(0.085, 0.11, 0.965, 0.86, wspace=0.45, hspace=0.34)
        for k, (title, cloud) in enumerate(clouds):
            panels[0, k].set_title(f"({k + 1})  {title}", pad=4)
            for ax, side in zip(panels[:, k], sides, strict=True):
                plot_cloud(cloud, ax, view=side, key=False, box=box)
                plot_arm(design_of(cloud), ax=ax, view=side, box=box)
        draw_figure_key(figure, color_samples(clouds[0][1]).key, 0.09)
    return figure


def plot_metric_map(atlas: xr.Dataset, metric: str, ax: Axes | None = None) -> Axes:
    """Contours of a metric over the two parameters of an atlas (figure 3b); its best is marked.

    Volumes and lengths are relative to each design's own length. The best is the largest value, of
    unreachability the smallest. Designs without a value stay white.

    Args:
        atlas: From `open_atlas`, a grid of two parameters.
        metric: Which one.
        ax: Axes to draw in; None for a new figure.

    Raises:
        InvalidInput: No such metric, no two parameters, or nothing to show.
    """
    across, up = sheet_axes(atlas)
    if metric not in atlas or atlas[metric].dims != atlas["status"].dims:
        raise InvalidInput("metric", metric, "a metric of the atlas")
    values = over_length(atlas, metric).values.T
    if min(values.shape) < 2 or not np.isfinite(values).any():
        raise InvalidInput("atlas", f"{values.shape} designs", "2 x 2 or more, one done at least")
    with figure_style(ax):
        ax = small_axes() if ax is None else ax
        shown = np.ma.masked_invalid(values)
        filled = ax.contourf(across.values, up.values, shown, 14, cmap="viridis")
        _draw_contours(ax, across, up, shown, np.asarray(filled.levels))
        ax.figure.colorbar(filled, ax=ax, label=_METRICS.get(metric, _plain(metric)))
        _mark_best(ax, across, up, values, smallest="unreachability" in metric)
        ax.set(xlabel=across.label, ylabel=up.label)
    return ax


def _draw_contours(
    ax: Axes, across: SheetAxis, up: SheetAxis, values: Array, levels: Array
) -> None:
    """Every second level as a line, white on dark and dark on bright, with its value."""
    ink = ["w" if k < 0.65 * len(levels) else "0.15" for k in range(0, len(levels), 2)]
    lines = ax.contour(across.values, up.values, values, levels[::2], colors=ink, linewidths=0.5)
    low = np.array([across.values[0], up.values[0]])
    span = np.array([across.values[-1], up.values[-1]]) - low
    paths = ((np.asarray(path.vertices, float) - low) / span for path in lines.get_paths())
    places = [low + span * place for path in paths for place in _label_place(path)]
    if places:
        decimals = max(0, math.ceil(-math.log10(levels[1] - levels[0])))
        ax.clabel(lines, manual=places, fontsize=6, fmt=f"%.{decimals}f")


def _label_place(path: Array) -> list[Array]:
    """Where on a contour, from 0 to 1 across and up, its label is far from every edge."""
    inside = path[((path > 0.1) & (path < 0.86)).all(axis=1)]
    distance = np.abs(inside - (0.5, 0.35)).sum(axis=1)
    return [inside[distance.argmin()]] if len(inside) else []


def _mark_best(ax: Axes, across: SheetAxis, up: SheetAxis, values: Array, smallest: bool) -> None:
    row, column = _best(values, smallest)
    place = across.values[column], up.values[row]
    dot = {"ms": 5, "mfc": "w", "mec": "k", "mew": 0.8, "clip_on": False, "zorder": 5}
    ax.plot(*place, "o", **dot)
    # inside the axes, whichever edge the best lies at
    left = column > len(across.values) / 2
    down = row > len(up.values) / 2
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


def _axis(values: xr.DataArray) -> SheetAxis:
    angle = values.attrs.get("units") == "rad"
    unit = (
        "°" if angle else {"1": ""}.get(values.attrs.get("units", "1"), values.attrs.get("units"))
    )
    shown = np.degrees(values.values) if angle else values.values
    name = _SYMBOLS.get(str(values.name), _plain(str(values.name)))
    return SheetAxis(f"{name} ({unit})" if unit else name, tuple(np.round(shown, 9).tolist()))


def _plain(name: str) -> str:
    return name.replace("_", " ")


def _best(values: Array, smallest: bool) -> tuple[int, int]:
    flat = np.nanargmin(values) if smallest else np.nanargmax(values)
    row, column = np.unravel_index(flat, values.shape)
    return int(row), int(column)
