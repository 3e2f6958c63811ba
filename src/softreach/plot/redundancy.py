"""Pictures of redundancy: slices of a cloud, and how differently its neighbors are activated."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.errors import InvalidInput
from softreach.plot.cloud import plot_cloud, tips_in_lengths
from softreach.plot.coloring import ScalarKey, color_samples, draw_key
from softreach.plot.frame import bounding_box, framed_axes, image_width, show_buffer, view_extent
from softreach.plot.projection import View, project
from softreach.plot.style import figure_style, pyplot
from softreach.plot.zbuffer import ZBuffer

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

__all__ = ["plot_distance", "plot_distance_histograms", "plot_redundancy", "plot_slab"]

_NORMAL = {"front": 1, "right": 0}  # the axis that a plane through the origin leaves out
_THICKNESS = 1 / 50  # of L
_ISOLATED = 190  # light gray
_LABEL = "mean activation distance D̄"


def plot_slab(
    cloud: xr.Dataset,
    ax: Axes | None = None,
    *,
    plane: str = "front",
    thickness: float = _THICKNESS,
    color: str | int | ArrayLike = "rgb",
    size: float | None = None,
    key: bool = True,
    box: NDArray[np.float64] | None = None,
) -> Axes:
    """Draw the tips in a slab about a plane through the origin; its thickness stands in the axes.

    Args:
        cloud: tip(sample, axis) [m] with attribute `length` [m], activation(sample, fiber) [-].
        ax: Axes to draw in; None for a new figure.
        plane: "front" for the frontal x-z plane, "right" for the right-facing y-z plane.
        thickness: Of the whole slab [L].
        color: As `plot_cloud` has it, for all samples of the cloud.
        size: Diameter of a point [pixels at 250 per inch]; None chooses by their number.
        key: Whether to explain the colors.
        box: What to show, lower and upper corner [L], shape (2, 3); None for all points.

    Returns:
        The axes, in units of L.

    Raises:
        InvalidInput: Unknown plane or color, or no tip in the slab.
        MissingExtra: matplotlib is not installed.
    """
    if plane not in _NORMAL:
        raise InvalidInput("plane", repr(plane), "'front' (x-z) or 'right' (y-z)")
    tips, normal = tips_in_lengths(cloud), _NORMAL[plane]
    inside = np.abs(tips[:, normal]) <= thickness / 2
    if not inside.any():
        raise InvalidInput("thickness", thickness, "such that a tip lies in the slab [L]")
    coloring = color_samples(cloud, color)
    with figure_style(ax):
        box = bounding_box(tips) if box is None else box
        ax = framed_axes(box, plane) if ax is None else ax
        slab = cloud.isel(sample=np.flatnonzero(inside))
        size = size or _size_in_plane(tips[inside], normal, box, plane, ax)
        rgb = coloring.rgb[inside] / 255
        plot_cloud(slab, ax, view=plane, color=rgb, size=size, key=False, box=box)
        _note(ax, f"|{'xyz'[normal]}| ≤ {thickness / 2:.3g} L", 0.03, 0.02)
        if key:
            draw_key(ax, coloring.key)
    return ax


def plot_distance(
    cloud: xr.Dataset,
    distance: xr.DataArray,
    ax: Axes | None = None,
    *,
    view: View = "front",
    high: float | None = None,
    size: float | None = None,
    key: bool = True,
    box: NDArray[np.float64] | None = None,
) -> Axes:
    """Draw the evaluated tips, their color D̄; isolated ones are light gray and behind.

    Args:
        cloud: The cloud that D̄ was computed from.
        distance: D̄ [-] from `activation_distance`; 10,000 points make a clear picture.
        ax: Axes to draw in; None for a new figure.
        view: A named view, or azimuth and elevation of the eye [rad].
        high: D̄ of the last color; None for the largest here. Give one to compare clouds.
        size: Diameter of a point [pixels at 250 per inch]; None chooses by their number.
        key: Whether to explain the colors.
        box: What to show, lower and upper corner [L], shape (2, 3); None for all points.

    Returns:
        The axes, in units of L.

    Raises:
        InvalidInput: Unknown view, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    values = distance.values
    high = _largest([distance]) if high is None else high
    tips = tips_in_lengths(cloud)[distance["sample"].values]
    with figure_style(ax):
        box = bounding_box(tips) if box is None else box
        ax = framed_axes(box, view) if ax is None else ax
        extent = view_extent(box, view)
        width = image_width(ax, extent)
        buffer = ZBuffer(extent, width, oversample=2)
        seen = project(tips, view)
        seen[np.isnan(values), 2] -= 10.0 * np.ptp(box)  # behind all others
        pixels = size or max(3.0, width / np.sqrt(1.2 * max(len(tips), 1)))
        buffer.draw_points(seen, _distance_colors(values, high), pixels)
        show_buffer(ax, buffer, box, view, "/ L")
        if key:
            draw_key(ax, ScalarKey(_LABEL, 0.0, high))
    return ax


def plot_distance_histograms(
    distances: Mapping[str, xr.DataArray], *, bins: int = 60, width: float = 6.9
) -> dict[str, Axes]:
    """Draw the distribution of D̄ of several clouds side by side, at one scale, in a new figure.

    Args:
        distances: D̄ [-] from `activation_distance` by title.
        bins: Number of bins.
        width: Of the figure [inch].

    Returns:
        The axes by title.

    Raises:
        InvalidInput: No distances.
        MissingExtra: matplotlib is not installed.
    """
    if not distances:
        raise InvalidInput("distances", "none", "one at least")
    with figure_style():
        shape = {"figsize": (width, 0.37 * width), "layout": "constrained", "squeeze": False}
        _, grid = pyplot().subplots(1, len(distances), sharex=True, **shape)
        edges = np.linspace(0.0, _largest(distances.values()), bins + 1)
        for ax, (title, distance) in zip(grid[0], distances.items(), strict=True):
            _draw_histogram(ax, distance.values, edges)
            ax.set_title(title)
        grid[0, 0].set_ylabel("share of points per bin / %")
    return dict(zip(distances, grid[0], strict=True))


def plot_redundancy(
    clouds: Mapping[str, xr.Dataset],
    distances: Mapping[str, xr.DataArray],
    *,
    bundles: Mapping[str, str | int] | None = None,
    thickness: float = _THICKNESS,
    width: float = 6.9,
) -> dict[str, dict[str, Axes]]:
    """Draw clouds, their slices and D̄ of several designs, a row for each, in a new figure.

    Args:
        clouds: Clouds by title.
        distances: D̄ from `activation_distance` by the same titles.
        bundles: Name or index of the bundle whose |γ| colors each cloud; None for the last.
        thickness: Of the slabs [L].
        width: Of the figure [inch].

    Returns:
        The axes by title and column: "cloud", "front", "right" and "distance".

    Raises:
        InvalidInput: Other titles, an unknown bundle, or no tip in a slab.
        MissingExtra: matplotlib is not installed.
    """
    if not clouds or set(clouds) != set(distances):
        raise InvalidInput("distances", sorted(distances), f"of the clouds {sorted(clouds)}")
    box = bounding_box(*(tips_in_lengths(cloud) for cloud in clouds.values()))
    high = _largest(distances.values())
    with figure_style():
        axes = _rows(list(clouds), box, width)
        for title, row in axes.items():
            cloud, last = clouds[title], clouds[title].sizes["bundle"] - 1
            bundle = last if bundles is None else bundles[title]
            shared = {"box": box, "key": False}
            coloring = color_samples(cloud, bundle)
            rgb = coloring.rgb / 255
            plot_cloud(cloud, row["cloud"], color=rgb, **shared)
            for plane in _NORMAL:
                plot_slab(cloud, row[plane], plane=plane, thickness=thickness, color=rgb, **shared)
            plot_distance(cloud, distances[title], row["distance"], high=high, **shared)
            _draw_row_keys(row, title, coloring.key, ScalarKey("D̄", 0.0, high))
    return axes


_MARGINS = {"left": 0.75, "right": 0.1, "bottom": 0.4, "top": 0.55, "gap": 0.12}  # inches
_COLUMNS = ("cloud", "front", "right", "distance")


def _rows(titles: list[str], box: NDArray[np.float64], width: float) -> dict[str, dict[str, Axes]]:
    """Axes at one scale: four columns, a row for each title."""
    x, y, z = np.ptp(box, axis=0)
    spans = {"cloud": x, "front": x, "right": y, "distance": x}
    m = _MARGINS
    scale = (width - m["left"] - m["right"] - 3 * m["gap"]) / sum(spans.values())
    row = z * scale + m["top"] + m["bottom"]
    figure = pyplot().figure(figsize=(width, row * len(titles)))
    axes: dict[str, dict[str, Axes]] = {title: {} for title in titles}
    for k, title in enumerate(titles):
        left, bottom = m["left"], row * (len(titles) - 1 - k) + m["bottom"]
        for name in _COLUMNS:
            place = (left, bottom, spans[name] * scale, z * scale)
            share = np.array(place) / np.tile(figure.get_size_inches(), 2)
            axes[title][name] = figure.add_axes(tuple(share))
            left += spans[name] * scale + m["gap"]
    return axes


def _draw_row_keys(row: dict[str, Axes], title: str, magnitude: Any, distance: ScalarKey) -> None:
    """Bars above the first and the last picture; heights only at the left."""
    for name, key in (("cloud", magnitude), ("distance", distance)):
        _bar_above(row[name], key)
    for name in _COLUMNS[1:]:
        row[name].set(ylabel="", yticklabels=[])
    label = row["cloud"].get_ylabel()
    row["cloud"].set_ylabel(f"{title}\n{label}")


def _bar_above(ax: Axes, key: ScalarKey) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize
    from matplotlib.ticker import MaxNLocator

    bar = ax.inset_axes((0.05, 1.05, 0.9, 0.035))
    mappable = ScalarMappable(Normalize(key.low, key.high), _colormap())
    shown = ax.figure.colorbar(mappable, cax=bar, orientation="horizontal", label=key.label)
    shown.locator = MaxNLocator(4)
    shown.ax.xaxis.set_ticks_position("top")
    shown.ax.xaxis.set_label_position("top")


def _draw_histogram(ax: Axes, values: NDArray[np.float64], edges: NDArray[np.float64]) -> None:
    finite = values[np.isfinite(values)]
    share = 100.0 * np.histogram(finite, edges)[0] / max(len(values), 1)
    colors = _distance_colors(edges[:-1], edges[-1]) / 255
    ax.bar(edges[:-1], share, np.diff(edges), align="edge", color=colors)
    ax.set(xlabel=_LABEL, xlim=(0.0, edges[-1]), ylim=(0.0, None))
    ax.spines[["top", "right"]].set_visible(False)
    if len(finite):
        median = float(np.median(finite))
        ax.axvline(median, color="0.15", linewidth=0.8, linestyle="--")
        _note(ax, f"median {median:.3f}\nisolated {1 - len(finite) / len(values):.2%}", 0.98, 0.98)


def _note(ax: Axes, text: str, right: float, up: float) -> None:
    across, along = ("right" if right > 0.5 else "left"), ("top" if up > 0.5 else "bottom")
    place = {"ha": across, "va": along, "transform": ax.transAxes}
    ax.text(right, up, text, fontsize=7, color="0.25", zorder=5, **place)


def _size_in_plane(
    tips: NDArray[np.float64], normal: int, box: NDArray[np.float64], plane: str, ax: Axes
) -> float:
    """A diameter [pixels] that closes a slice: about the mean spacing in the plane."""
    extent = view_extent(box, plane)
    area = (extent.right - extent.left) * (extent.top - extent.bottom)
    pixels = image_width(ax, extent) / (extent.right - extent.left)
    return float(np.clip(1.2 * np.sqrt(area / len(tips)) * pixels, 2.0, 8.0))


def _distance_colors(values: NDArray[np.float64], high: float) -> NDArray[np.uint8]:
    shares = np.nan_to_num(values) / (high or 1.0)
    colors = _colormap()(np.minimum(shares, 1.0), bytes=True)[:, :3]
    return np.where(np.isnan(values)[:, None], np.uint8(_ISOLATED), colors)


def _colormap() -> Any:
    from matplotlib import colormaps

    return colormaps["viridis"]


def _largest(distances: Any) -> float:
    """The largest finite D̄, 1 if there is none."""
    finite = [d.values[np.isfinite(d.values)] for d in distances]
    return max((float(f.max()) for f in finite if len(f)), default=1.0) or 1.0
