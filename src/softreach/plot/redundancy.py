"""Pictures of redundancy: activation distance D̄ in space, its distribution, and sheets."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.picture.projection import View, project
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.clouds import drawn_tips, plot_cloud, plot_slab
from softreach.plot.coloring import (
    COLORMAP,
    ScalarKey,
    bundle_activations,
    color_map,
    color_samples,
    draw_key,
)
from softreach.plot.lengths import Unit, common_unit, unit_of
from softreach.plot.style import (
    LENGTH,
    SIZE,
    WIDTH,
    figure_style,
    panel_arguments,
    pyplot,
    write_note,
)
from softreach.schema import a_cloud
from softreach.support.arguments import (
    POSITIVE,
    as_dataset,
    as_flag,
    as_integer,
    as_mapping,
    as_name_or_index,
    as_number,
)
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softreach.plot.coloring import BundleKey


_ISOLATED = 190  # light gray
_LABEL = "mean activation distance D̄"
_SLABS = ("front", "side")
_MARGINS = {"left": 0.75, "right": 0.1, "bottom": 0.4, "top": 0.55, "gap": 0.12}  # inches
_COLUMNS = ("cloud", *_SLABS, "distance")
_a_distance = partial(as_dataset, kind="DataArray")


def plot_distance(
    cloud: xr.Dataset,
    distance: xr.DataArray,
    *,
    ax: Axes | None = None,
    view: View = "front",
    high: float | None = None,
    size: float | None = None,
    key: bool = True,
    box: ArrayLike | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw the evaluated tips, their color D̄; isolated ones are light gray and behind.

    What is not described here is as in `plot_cloud`.

    Args:
        cloud: The cloud that D̄ was computed from.
        distance: D̄ [-] from `activation_distance`; 10,000 points make a clear picture.
        ax: As in `plot_cloud`.
        view: As in `plot_cloud`.
        high: D̄ of the last color; None for the largest here. Give one to compare clouds.
        size: As in `plot_cloud`.
        key: As in `plot_cloud`.
        box: As in `plot_cloud`.
        unit: As in `plot_cloud`.

    Returns:
        The axes, in that unit.

    Raises:
        InvalidInput: Unknown view, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    cloud, distance = a_cloud("cloud", cloud), _a_distance("distance", distance)
    high = largest_distance([distance]) if high is None else as_number("high", high, POSITIVE)
    size, key = None if size is None else as_number("size", size, SIZE), as_flag("key", key)
    (ax, box), values = panel_arguments(ax, view, box), distance.values
    counted = unit_of(cloud["tip"], unit)
    tips = drawn_tips(cloud, counted)[distance["sample"].values]
    with figure_style(ax):
        panel = Panel.opened(tips, counted, ax, view, box)
        buffer = panel.buffer(oversample=2)
        seen = project(tips, view)
        seen[np.isnan(values), 2] -= 10.0 * np.ptp(panel.box)  # behind all others
        pixels = size or max(3.0, buffer.shape[1] / np.sqrt(1.2 * max(len(tips), 1)))
        buffer.draw_points(seen, _colors(values, high), pixels)
        panel.show(buffer)
        if key:
            draw_key(panel.ax, ScalarKey(_LABEL, 0.0, high))
    return panel.ax


def plot_distance_histograms(
    distances: Mapping[str, xr.DataArray], *, bins: int = 60, width: float = 6.9
) -> Figure:
    """Draw the distribution of D̄ of several clouds side by side, at one scale.

    Args:
        distances: D̄ [-] from `activation_distance` by title.
        bins: Number of bins.
        width: Of the figure [inch].

    Returns:
        The figure, with axes in the order of the titles.

    Raises:
        InvalidInput: No distances.
        MissingExtra: matplotlib is not installed.
    """
    distances = as_mapping("distances", distances, _a_distance)
    bins, width = as_integer("bins", bins, 1, 10_000), as_number("width", width, WIDTH)
    if not distances:
        raise InvalidInput("distances", "none", "at least one")
    with figure_style():
        shape = {"figsize": (width, 0.37 * width), "layout": "constrained", "squeeze": False}
        figure, grid = pyplot().subplots(1, len(distances), sharex=True, **shape)
        edges = np.linspace(0.0, largest_distance(distances.values()), bins + 1)
        for ax, (title, distance) in zip(grid[0], distances.items(), strict=True):
            _draw_histogram(ax, distance.values, edges)
            ax.set_title(title)
        grid[0, 0].set_ylabel("share of points per bin / %")
    return figure


def largest_distance(distances: Iterable[xr.DataArray]) -> float:
    """The largest finite D̄, 1 if there is none."""
    finite = [d.values[np.isfinite(d.values)] for d in distances]
    return max((float(f.max()) for f in finite if len(f)), default=1.0) or 1.0


def plot_redundancy(
    clouds: Mapping[str, xr.Dataset],
    distances: Mapping[str, xr.DataArray],
    *,
    bundles: Mapping[str, str | int] | None = None,
    thickness: float | None = None,
    width: float = 6.9,
    unit: Unit = None,
) -> Figure:
    """Draw clouds, their slabs through the base and D̄ of several designs (figures 4b-d).

    Args:
        clouds: Clouds by title.
        distances: D̄ from `activation_distance` by the same titles.
        bundles: Name or index of the bundle whose |γ| colors each cloud; None for the last.
        thickness: Of the slabs [m]; None as in `plot_slab`.
        width: Of the figure [inch].
        unit: As in `plot_cloud`.

    Returns:
        The figure: a row for each title with the cloud from the front, the slabs from the front and
        the side, and D̄ from the front, all at one scale.

    Raises:
        InvalidInput: Other titles, an unknown bundle, no tip in a slab, or clouds of which only
            some know L.
        MissingExtra: matplotlib is not installed.
    """
    clouds = as_mapping("clouds", clouds, a_cloud)
    distances = as_mapping("distances", distances, _a_distance)
    bundles = None if bundles is None else as_mapping("bundles", bundles, as_name_or_index)
    thickness = None if thickness is None else as_number("thickness", thickness, LENGTH)
    width = as_number("width", width, WIDTH)
    if not clouds or set(clouds) != set(distances):
        raise InvalidInput("distances", sorted(distances), f"of the clouds {sorted(clouds)}")
    units = {title: unit_of(cloud["tip"], unit) for title, cloud in clouds.items()}
    common_unit([*units.values()])
    box = bounding_box(*(drawn_tips(cloud, units[title]) for title, cloud in clouds.items()))
    high = largest_distance(distances.values())
    with figure_style():
        figure, rows = _rows(list(clouds), box, width)
        for title, row in rows.items():
            cloud = clouds[title]
            last = bundle_activations(cloud).shape[1] - 1
            coloring = color_samples(cloud, last if bundles is None else bundles[title])
            rgb = coloring.rgb / 255
            counted = units[title]
            shared = {"box": box * counted.size, "key": False, "unit": counted}
            plot_cloud(cloud, ax=row["cloud"], color=rgb, **shared)
            for view in _SLABS:
                slab = {"view": view, "thickness": thickness, "color": rgb}
                plot_slab(cloud, ax=row[view], **slab, **shared)
            plot_distance(cloud, distances[title], ax=row["distance"], high=high, **shared)
            _label_row(row, title, coloring.key, ScalarKey("D̄", 0.0, high))
    return figure


def _draw_histogram(ax: Any, values: Array, edges: Array) -> None:
    finite = values[np.isfinite(values)]
    share = 100.0 * np.histogram(finite, edges)[0] / max(len(values), 1)
    colors = _colors(edges[:-1], edges[-1]) / 255
    ax.bar(edges[:-1], share, np.diff(edges), align="edge", color=colors)
    ax.set(xlabel=_LABEL, xlim=(0.0, edges[-1]), ylim=(0.0, None))
    ax.spines[["top", "right"]].set_visible(False)
    if len(finite):
        median = float(np.median(finite))
        ax.axvline(median, color="0.15", linewidth=0.8, linestyle="--")
        text = f"median {median:.3f}\nisolated {1 - len(finite) / len(values):.2%}"
        write_note(ax, text, 0.98, 0.98)


def _colors(values: Array, high: float) -> NDArray[np.uint8]:
    from matplotlib import colormaps

    shares = np.nan_to_num(values) / (high or 1.0)
    colors = colormaps[COLORMAP](np.minimum(shares, 1.0), bytes=True)[:, :3]
    return np.where(np.isnan(values)[:, None], np.uint8(_ISOLATED), colors)


def _rows(titles: list[str], box: Array, width: float) -> tuple[Figure, dict[str, dict[str, Axes]]]:
    x, y, z = np.ptp(box, axis=0)
    spans = {"cloud": x, "front": x, "side": y, "distance": x}
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
    return figure, axes


def _label_row(
    row: dict[str, Axes], title: str, magnitude: BundleKey | ScalarKey | None, distance: ScalarKey
) -> None:
    for name, key in (("cloud", magnitude), ("distance", distance)):
        if isinstance(key, ScalarKey):
            _bar_above(row[name], key)
    for name in _COLUMNS[1:]:
        row[name].set(ylabel="", yticklabels=[])
    label = row["cloud"].get_ylabel()
    row["cloud"].set_ylabel(f"{title}\n{label}")


def _bar_above(ax: Axes, key: ScalarKey) -> None:
    from matplotlib.ticker import MaxNLocator

    bar = ax.inset_axes((0.05, 1.05, 0.9, 0.035))
    options: dict[str, Any] = {"orientation": "horizontal", "label": key.label}
    shown = ax.figure.colorbar(color_map(key), cax=bar, **options)
    shown.locator = MaxNLocator(4)
    shown.ax.xaxis.set_ticks_position("top")
    shown.ax.xaxis.set_label_position("top")
