"""Pictures of what clouds are asked: activation distance D̄, redundancy, curvature."""

from collections.abc import Iterable, Mapping
from functools import partial
from textwrap import fill
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from softreach.picture.projection import View, project
from softreach.plot import coloring, style
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.reach import drawn_tips, plot_cloud, plot_slab
from softreach.schema import a_cloud
from softreach.support.arguments import as_dataset, as_flag, as_mapping, as_number, as_one_of
from softreach.support.errors import InvalidInput
from softreach.support.lazy import Axes, DataArray, Dataset, Figure

_ISOLATED = 190  # light gray
_LABEL = "mean activation distance D̄"
_AROUND, _GAPS = (0.1, 0.4, 0.55), (0.12, 0.95)  # right, below, above and between panels [inch]
_LEFT, _LINE, _LETTERS = 0.75, 0.14, 24  # inches left of them, for each more line of titles
_a_distance = partial(as_dataset, kind="DataArray")
SIDES = ("#2f6db5", "#e8a020")  # the paper's blue and yellow
_SYMBOLS = {"bending": "κ", "torsion": "u₃", "extension": "ζ"}
_COARSE = 64  # bins of a distribution of curvature


def plot_distance(
    cloud: Dataset,
    distance: DataArray,
    *,
    ax: Axes | None = None,
    view: View = "front",
    high: float | None = None,
    key: bool = True,
    box: ArrayLike | None = None,
    unit: style.Unit = None,
) -> Axes:
    """Draw the evaluated tips, their color D̄; isolated ones are light gray and behind.

    What is not described here is as in `plot_cloud`.

    Args:
        cloud: The cloud that D̄ was computed from.
        distance: D̄ [-] from `activation_distance`; 10,000 points make a clear picture.
        ax: As in `plot_cloud`.
        view: As in `plot_cloud`.
        high: D̄ of the last color; None for the largest here. Give one to compare clouds.
        key: As in `plot_cloud`.
        box: As in `plot_cloud`.
        unit: As in `plot_cloud`.

    Raises:
        InvalidInput: Unknown view, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    cloud, distance = a_cloud("cloud", cloud), _a_distance("distance", distance)
    high = largest_distance([distance]) if high is None else as_number("high", high, style.POSITIVE)
    key, values = as_flag("key", key), distance.values
    counted = style.unit_of(cloud["tip"], unit)
    tips = drawn_tips(cloud, counted)[distance["sample"].values]
    with Panel.opened(tips, counted, ax, view, box) as panel:
        buffer = panel.buffer(oversample=2)
        seen = project(tips, view)
        seen[np.isnan(values), 2] -= 10.0 * np.ptp(panel.box)  # behind all others
        pixels = max(3.0, buffer.shape[1] / np.sqrt(1.2 * max(len(tips), 1)))
        buffer.draw_points(seen, coloring.scale_colors(values, 0.0, high, _ISOLATED), pixels)
        panel.show(buffer)
        coloring.draw_key(panel.ax, coloring.ScalarKey(_LABEL, 0.0, high) if key else None)
    return panel.ax


def largest_distance(distances: Iterable[DataArray]) -> float:
    """The largest finite D̄, 1 if there is none."""
    finite = [d.values[np.isfinite(d.values)] for d in distances]
    return max((float(f.max()) for f in finite if len(f)), default=1.0) or 1.0


def plot_redundancy(
    clouds: Mapping[str, Dataset],
    distances: Mapping[str, DataArray],
    *,
    thickness: float | None = None,
    unit: style.Unit = None,
) -> Figure:
    """Draw clouds, their slabs through the base and D̄ of several designs (figures 4b-d).

    Args:
        clouds: Clouds by title.
        distances: D̄ from `activation_distance` by the same titles.
        thickness: Of the slabs [m]; None as in `plot_slab`.
        unit: As in `plot_cloud`.

    Returns:
        The figure: a row for each title with the cloud from the front, colored by |γ| of the last
        bundle, the slabs from the front and the side, and D̄ from the front, all at one scale.

    Raises:
        InvalidInput: Other titles, no tip in a slab, or clouds of which only some know L.
        MissingExtra: matplotlib is not installed.
    """
    clouds = as_mapping("clouds", clouds, a_cloud)
    distances = as_mapping("distances", distances, _a_distance)
    thickness = None if thickness is None else as_number("thickness", thickness, style.LENGTH)
    if not clouds or set(clouds) != set(distances):
        raise InvalidInput("distances", sorted(distances), f"of the clouds {sorted(clouds)}")
    units = {title: style.unit_of(cloud["tip"], unit) for title, cloud in clouds.items()}
    style.common_unit([*units.values()])
    from matplotlib.ticker import MaxNLocator

    box = bounding_box(*(drawn_tips(cloud, units[title]) for title, cloud in clouds.items()))
    high = largest_distance(distances.values())
    with style.figure_style():
        x, y, z = np.ptp(box, axis=0)
        heights = [z] * len(clouds)
        names = {title: fill(title, _LETTERS) for title in clouds}
        left = _LEFT + _LINE * max(name.count("\n") for name in names.values())
        around = (left, *_AROUND)
        figure, rows = style.place_panels(style.PAGE, (x, x, y, x), heights, around, _GAPS)
        for (title, cloud), row in zip(clouds.items(), rows, strict=True):
            colored = coloring.color_samples(cloud, coloring.bundle_activations(cloud).shape[1] - 1)
            rgb, counted = colored.rgb / 255, units[title]
            shared = {"box": box * counted.size, "key": False, "unit": counted}
            plot_cloud(cloud, ax=row[0], color=rgb, **shared)
            for ax, view in zip(row[1:3], ("front", "side"), strict=True):
                plot_slab(cloud, ax=ax, view=view, thickness=thickness, color=rgb, **shared)
            plot_distance(cloud, distances[title], ax=row[3], high=high, **shared)
            for ax, key in ((row[0], colored.key), (row[3], coloring.ScalarKey("D̄", 0.0, high))):
                if isinstance(key, coloring.ScalarKey):
                    bar = ax.inset_axes((0.05, 1.05, 0.9, 0.035))
                    options = {"location": "top", "label": key.label, "ticks": MaxNLocator(4)}
                    figure.colorbar(coloring.color_map(key), cax=bar, **options)
            for ax in row[1:]:
                ax.set(ylabel="", yticklabels=[])
            row[0].set_ylabel(f"{names[title]}\n{row[0].get_ylabel()}")
    return figure


def plot_curvature(
    statistics: Mapping[str, Dataset],
    *,
    ax: Axes | None = None,
    quantity: str = "bending",
    unit: style.Unit = None,
) -> Axes:
    """Distributions at the stations of one or two designs (figure 3c); dots are medians.

    Each distribution is drawn to the same width. Curvatures are shown times L, or in 1/m if the
    statistics do not know L, unless there is a unit.

    Args:
        statistics: Label -> what `curvature_statistics` returned, left and right of each station.
        ax: Axes to draw in; None for a new figure.
        quantity: "bending", "torsion" or "extension".
        unit: Of lengths: "m", "cm", "mm" or "L"; None for L if the statistics know it, else m.

    Raises:
        InvalidInput: Not one or two designs, an unknown quantity, stations at other places along
            the arm, or designs of which only one knows L.
    """
    variables = "bending_count", "Z"
    statistics = as_mapping("statistics", statistics, lambda *x: as_dataset(*x, *variables))
    if not 1 <= len(statistics) <= 2:
        raise InvalidInput("statistics", f"of {len(statistics)} designs", "of one or two")
    as_one_of("quantity", quantity, _SYMBOLS)
    units = {label: style.unit_of(data, unit) for label, data in statistics.items()}
    counted = style.common_unit([*units.values()])
    places, *others = (units[label].of(data["Z"].values) for label, data in statistics.items())
    for other in others:
        if other.shape != places.shape or not np.allclose(other, places):
            raise InvalidInput("stations", other.tolist(), f"those of the first: {places.tolist()}")
    symbol, per_length = _SYMBOLS[quantity], quantity != "extension"
    symbol += ("L" if counted.relative else f" [1/{counted.name}]") * per_length
    with style.styled_axes(ax) as ax:
        sides = (-1, 1) if len(statistics) == 2 else (0,)
        for (label, data), side, color in zip(statistics.items(), sides, SIDES, strict=False):
            scale = units[label].size if per_length else 1.0
            _draw_side(ax, data, quantity, side, color, label, scale)
        ax.set(xlabel=counted.label("station Z"), ylabel=symbol)
        digits = ".2g" if counted.relative else ".4g"
        ax.set_xticks(range(len(places)), [f"{place:{digits}}" for place in places])
        ax.legend(loc="upper left", title="width: share of samples / its largest")
    return ax


def _draw_side(
    ax: Axes, data: Dataset, quantity: str, side: int, color: str, label: str, scale: float
) -> None:
    medians = data[f"{quantity}_quantile"].sel(quantile=0.5).values * scale
    look: dict[str, Any] = {"color": color, "alpha": 0.75, "lw": 0.3, "ec": "w"}
    for k in range(len(medians)):
        station = data.isel(station=k)
        count, edges = station[f"{quantity}_count"].values, station[f"{quantity}_edge"].values
        used = np.flatnonzero(count)
        first, last = used[0], used[-1] + 1
        # fewer bins, between the smallest and the largest value
        ends = np.unique(np.linspace(first, last, _COARSE + 1).astype(int))
        density = np.add.reduceat(count[:last], ends[:-1]) / np.diff(edges[ends])
        values = (edges[ends[:-1]] + edges[ends[1:]]) / 2
        reach = 0.46 * density / density.max()
        low, high = (k - reach if side <= 0 else k), (k + reach if side >= 0 else k)
        ax.fill_betweenx(values * scale, low, high, label=None if k else label, **look)
    ax.plot(np.arange(len(medians)) + 0.1 * side, medians, ".", color="k", ms=3, zorder=3)
