"""How differently the neighbors in a cloud are activated: D̄ over space, and its distribution."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arguments import (
    POSITIVE,
    checked,
    dataset,
    flag,
    mapping_of,
    optional,
    whole,
    within,
)
from softreach.errors import InvalidInput
from softreach.picture.projection import View, project
from softreach.plot.arguments import DRAWN, POINTS, SIZE, WIDTH
from softreach.plot.cloud import drawn_tips
from softreach.plot.coloring import COLORMAP, ScalarKey, draw_key
from softreach.plot.frame import Panel
from softreach.plot.lengths import unit_of
from softreach.plot.style import figure_style, pyplot, write_note

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["largest_distance", "plot_distance", "plot_distance_histograms"]

_ISOLATED = 190  # light gray
_LABEL = "mean activation distance D̄"


@checked(
    **DRAWN,
    cloud=POINTS,
    distance=dataset(kind="DataArray"),
    high=optional(within(POSITIVE)),
    size=SIZE,
    key=flag,
)
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

    Returns:
        The axes, in L if the cloud knows it, else in meters.

    Raises:
        InvalidInput: Unknown view, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    values = distance.values
    high = largest_distance([distance]) if high is None else high
    tips = drawn_tips(cloud)[distance["sample"].values]
    with figure_style(ax):
        panel = Panel.opened(tips, unit_of(cloud["tip"]), ax, view, box)
        buffer = panel.buffer(oversample=2)
        seen = project(tips, view)
        seen[np.isnan(values), 2] -= 10.0 * np.ptp(panel.box)  # behind all others
        pixels = size or max(3.0, buffer.shape[1] / np.sqrt(1.2 * max(len(tips), 1)))
        buffer.draw_points(seen, _colors(values, high), pixels)
        panel.show(buffer)
        if key:
            draw_key(panel.ax, ScalarKey(_LABEL, 0.0, high))
    return panel.ax


@checked(distances=mapping_of(dataset(kind="DataArray")), bins=whole(1, 10_000), width=WIDTH)
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


def _draw_histogram(ax: Any, values: NDArray[np.float64], edges: NDArray[np.float64]) -> None:
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


def _colors(values: NDArray[np.float64], high: float) -> NDArray[np.uint8]:
    from matplotlib import colormaps

    shares = np.nan_to_num(values) / (high or 1.0)
    colors = colormaps[COLORMAP](np.minimum(shares, 1.0), bytes=True)[:, :3]
    return np.where(np.isnan(values)[:, None], np.uint8(_ISOLATED), colors)
