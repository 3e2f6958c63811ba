"""Redundancy of several designs on one sheet: clouds, slabs of them, and D̄."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softreach.arguments import checked, dataset, mapping_of, name_or_index, optional
from softreach.errors import InvalidInput
from softreach.plot.arguments import LENGTH, POINTS, WIDTH
from softreach.plot.cloud import drawn_tips, plot_cloud
from softreach.plot.coloring import ScalarKey, bundle_activations, color_map, color_samples
from softreach.plot.distance import largest_distance, plot_distance
from softreach.plot.frame import bounding_box
from softreach.plot.lengths import common_unit, unit_of
from softreach.plot.slab import plot_slab
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softreach.plot.coloring import BundleKey

__all__ = ["plot_redundancy"]

_SLABS = ("front", "side")
_MARGINS = {"left": 0.75, "right": 0.1, "bottom": 0.4, "top": 0.55, "gap": 0.12}  # inches
_COLUMNS = ("cloud", *_SLABS, "distance")


@checked(
    clouds=mapping_of(POINTS),
    distances=mapping_of(dataset(kind="DataArray")),
    bundles=optional(mapping_of(name_or_index)),
    thickness=optional(LENGTH),
    width=WIDTH,
)
def plot_redundancy(
    clouds: Mapping[str, xr.Dataset],
    distances: Mapping[str, xr.DataArray],
    *,
    bundles: Mapping[str, str | int] | None = None,
    thickness: float | None = None,
    width: float = 6.9,
) -> Figure:
    """Draw clouds, their slabs through the base and D̄ of several designs (figures 4b-d).

    Args:
        clouds: Clouds by title.
        distances: D̄ from `activation_distance` by the same titles.
        bundles: Name or index of the bundle whose |γ| colors each cloud; None for the last.
        thickness: Of the slabs [m]; None as in `plot_slab`.
        width: Of the figure [inch].

    Returns:
        The figure: a row for each title with the cloud from the front, the slabs from the front and
        the side, and D̄ from the front, all at one scale.

    Raises:
        InvalidInput: Other titles, an unknown bundle, no tip in a slab, or clouds of which only
            some know L.
        MissingExtra: matplotlib is not installed.
    """
    if not clouds or set(clouds) != set(distances):
        raise InvalidInput("distances", sorted(distances), f"of the clouds {sorted(clouds)}")
    common_unit([unit_of(cloud["tip"]) for cloud in clouds.values()])
    box = bounding_box(*(drawn_tips(cloud) for cloud in clouds.values()))
    high = largest_distance(distances.values())
    with figure_style():
        figure, rows = _rows(list(clouds), box, width)
        for title, row in rows.items():
            cloud = clouds[title]
            last = bundle_activations(cloud).shape[1] - 1
            coloring = color_samples(cloud, last if bundles is None else bundles[title])
            rgb = coloring.rgb / 255
            shared = {"box": box * unit_of(cloud["tip"]).size, "key": False}
            plot_cloud(cloud, ax=row["cloud"], color=rgb, **shared)
            for view in _SLABS:
                slab = {"view": view, "thickness": thickness, "color": rgb}
                plot_slab(cloud, ax=row[view], **slab, **shared)
            plot_distance(cloud, distances[title], ax=row["distance"], high=high, **shared)
            _label_row(row, title, coloring.key, ScalarKey("D̄", 0.0, high))
    return figure


def _rows(
    titles: list[str], box: NDArray[np.float64], width: float
) -> tuple[Figure, dict[str, dict[str, Axes]]]:
    """Axes at one scale: four columns, a row for each title."""
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
    """Bars above the first and the last picture; heights only at the left."""
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
