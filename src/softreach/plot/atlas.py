"""Pictures of an atlas: maps of its metrics, and sheets of a small picture for each design."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.atlas import over_length
from softreach.cloud.clouds import design_of
from softreach.geometry.surface import SurfaceMesh
from softreach.picture.projection import View, view_angles, view_axes
from softreach.picture.shading import draw_mesh
from softreach.picture.zbuffer import Extent, ZBuffer
from softreach.plot.arm import plot_arm
from softreach.plot.axes import bounding_box, view_extent
from softreach.plot.clouds import drawn_tips, plot_cloud, point_size
from softreach.plot.coloring import (
    COLORMAP,
    bundle_activations,
    bundle_names,
    color_samples,
    draw_figure_key,
)
from softreach.plot.lengths import Unit, unit_of
from softreach.plot.style import (
    DPI,
    PAGE,
    as_box,
    figure_style,
    place_panels,
    pyplot,
    small_axes,
)
from softreach.schema import a_cloud
from softreach.support import parallel
from softreach.support.arguments import as_mapping
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.palette import STEEL, activation_colors

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Content = TypeVar("Content")
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.75, 0.04, 0.62, 0.08  # inches around a sheet
_VIEW = "oblique"  # of sheets
_UNITS = {"rad": "°", "1": ""}
_INDEXED = re.compile(r"(?<![a-z])([ERZaρθ])([0-9tc])")
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


def box_over_length(atlas: xr.Dataset) -> Array:
    """Corners around all clouds, each in its own L [-], shape (2, 3).

    Raises:
        InvalidInput: The atlas has no bounding boxes, or no design is done.
    """
    if "x_min" not in atlas:
        raise InvalidInput("atlas", "without bounding boxes", 'built with the metrics "extent"')
    low = [float(over_length(atlas, f"{axis}_min").min()) for axis in "xyz"]
    high = [float(over_length(atlas, f"{axis}_max").max()) for axis in "xyz"]
    if not np.isfinite([low, high]).all():
        raise InvalidInput("atlas", "no design is done", "at least one design")
    return np.array([low, high])


def plot_metric_map(atlas: xr.Dataset, metric: str, *, ax: Axes | None = None) -> Axes:
    """Contours of a metric over the two parameters of an atlas (figure 3b); its best is marked.

    Volumes and lengths are relative to each design's own L. The best is the largest value, of
    unreachability the smallest. Designs without a value stay white; where there are no contours, as
    in a single row of designs, each design is a cell.

    Args:
        atlas: From `open_atlas`, a grid of two parameters.
        metric: Which one.
        ax: Axes to draw in; None for a new figure.

    Returns:
        The axes.

    Raises:
        InvalidInput: No such metric, or no two parameters.
        MissingExtra: matplotlib is not installed.
    """
    across, up = sheet_axes(atlas)
    if metric not in atlas or atlas[metric].dims != atlas["status"].dims:
        raise InvalidInput("metric", metric, "a metric of the atlas")
    values = over_length(atlas, metric).values.T
    with figure_style(ax):
        ax = small_axes() if ax is None else ax
        filled = _fill(ax, across, up, np.ma.masked_invalid(values))
        if np.isfinite(values).any():
            _mark_best(ax, across, up, values, smallest="unreachability" in metric)
        relative = _RELATIVE.get(atlas[metric].attrs.get("units", "1"), "")
        label = _METRICS.get(metric, _plain(metric) + relative)
        ax.figure.colorbar(filled, ax=ax, label=label)
        ax.set(xlabel=across.label, ylabel=up.label)
    return ax


def plot_cloud_sheet(
    cloud_at: Callable[[int, int], xr.Dataset | None],
    across: SheetAxis,
    up: SheetAxis,
    *,
    box_over_length: ArrayLike,
) -> Figure:
    """A sheet of clouds at one scale, colored by activation (figure 2a).

    Args:
        cloud_at: (column, row) -> cloud, row 0 at the bottom; None leaves a gap. Called once for
            each, on all threads, so that one cloud is held on each.
        across: Parameter along the horizontal edge.
        up: Parameter along the vertical edge.
        box_over_length: What each panel shows, lower and upper corner in L [-], shape (2, 3).

    Raises:
        InvalidInput: A cloud that does not know L.
        MissingExtra: matplotlib is not installed.
    """
    box = np.asarray(box_over_length, float)

    def image(cloud: xr.Dataset, extent: Extent, columns: int) -> ZBuffer:
        unit = unit_of(cloud["tip"])
        if not unit.relative:
            raise InvalidInput("cloud.tip.attrs['length']", None, "L [m], the unit of the sheet")
        tips = drawn_tips(cloud, unit)
        pixels = point_size(len(tips), box) * columns / extent.size[0]
        buffer = ZBuffer(extent, columns, oversample=2, color_step=8)
        colors = activation_colors(bundle_activations(cloud).values)
        buffer.draw_points(tips, colors, max(1.0, pixels), view=_VIEW)
        return buffer

    return _sheet(cloud_at, image, across, up, box)


def plot_hull_sheet(
    hull_at: Callable[[int, int], SurfaceMesh | None],
    across: SheetAxis,
    up: SheetAxis,
    *,
    length: ArrayLike,
    box_over_length: ArrayLike,
) -> Figure:
    """A sheet of lit hulls at one scale (figure 3a).

    Args:
        hull_at: (column, row) -> surface [m], row 0 at the bottom; None leaves a gap. Called as
            `cloud_at` of `plot_cloud_sheet` is.
        across: As for `plot_cloud_sheet`.
        up: As for `plot_cloud_sheet`.
        length: L [m], one for all or one for each panel, shape (columns, rows).
        box_over_length: As for `plot_cloud_sheet`.

    Raises:
        MissingExtra: matplotlib is not installed.
    """
    box = np.asarray(box_over_length, float)
    lengths = np.broadcast_to(np.asarray(length, float), (len(across.values), len(up.values)))

    def relative(column: int, row: int) -> tuple[Array, ArrayLike] | None:
        if (hull := hull_at(column, row)) is None:
            return None
        return np.asarray(hull.vertices) / lengths[column, row], hull.faces

    def image(surface: tuple[Array, ArrayLike], extent: Extent, columns: int) -> ZBuffer:
        buffer = ZBuffer(extent, columns, oversample=3, color_step=4)
        draw_mesh(buffer, *surface, STEEL, _VIEW)
        return buffer

    return _sheet(relative, image, across, up, box)


def panel_extent(box: Array, view: View) -> Extent:
    """Extent of a panel: tighter than a box in space, whose corners are empty.

    The ellipsoid in the box reaches √Σ(hᵢ eᵢ)² along a unit vector e; a fifth more leaves room for
    clouds that bulge beyond it.
    """
    middle, half = box.mean(axis=0), np.ptp(box, axis=0) / 2
    limits = view_extent(box, view)
    axes = view_axes(view)[:2]
    x, y = axes @ middle
    w, h = 1.2 * np.linalg.norm(axes * half, axis=1)
    left, right = max(limits.left, x - w), min(limits.right, x + w)
    return Extent(left, right, max(limits.bottom, y - h), min(limits.top, y + h))


def plot_opposite_sides(
    clouds: Mapping[str, xr.Dataset],
    *,
    view: View = "oblique",
    box_over_length: ArrayLike | None = None,
    unit: Unit = None,
) -> Figure:
    """Clouds from two opposing sides, one column each, with their arms at rest (figure 2b).

    Args:
        clouds: Clouds by the title of their column; each says which arm it belongs to.
        view: Of the upper row, as in `plot_cloud`; the lower row is opposite.
        box_over_length: What each panel shows, lower and upper corner in L [-], shape (2, 3); None
            for all points.
        unit: Of the axes, as in `plot_cloud`.

    Raises:
        InvalidInput: No clouds, clouds of different bundles, an unknown view, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    clouds = as_mapping("clouds", clouds, a_cloud)
    around = None if box_over_length is None else as_box("box_over_length", box_over_length)
    bundles = {bundle_names(cloud) for cloud in clouds.values()}
    if len(bundles) != 1:
        raise InvalidInput("clouds", f"of bundles {sorted(bundles)}", "one or more of one set")
    azimuth, elevation = view_angles(view)
    sides = ((azimuth, elevation), (azimuth + np.pi, elevation))
    if around is None:
        tips = (drawn_tips(cloud, unit_of(cloud["tip"])) for cloud in clouds.values())
        around = bounding_box(*tips)
    with figure_style():
        figure = pyplot().figure(figsize=(PAGE, 2 * PAGE / len(clouds) + 0.5))
        panels = figure.subplots(2, len(clouds), squeeze=False)
        figure.subplots_adjust(0.085, 0.11, 0.965, 0.86, wspace=0.45, hspace=0.34)
        for k, (title, cloud) in enumerate(clouds.items()):
            arm = design_of(cloud)
            box = np.asarray(around) * arm.length
            panels[0, k].set_title(f"({k + 1})  {title}", pad=4)
            for ax, side in zip(panels[:, k], sides, strict=True):
                plot_cloud(cloud, ax=ax, view=side, color="rgb", key=False, box=box, unit=unit)
                plot_arm(arm, ax=ax, view=side, box=box, unit=unit)
        draw_figure_key(figure, color_samples(next(iter(clouds.values())), "rgb").key, 0.09)
    return figure


def _axis(values: xr.DataArray) -> SheetAxis:
    si_unit = values.attrs.get("units", "1")
    unit = _UNITS.get(si_unit, si_unit)
    shown = np.degrees(values.values) if si_unit == "rad" else values.values
    name = values.attrs.get("symbol", _plain(str(values.name)))
    if "symbol" in values.attrs and _INDEXED.search(name):
        name = "$" + _INDEXED.sub(r"\1_\2", name) + "$"
    if "symbol" in values.attrs and (part := values.attrs.get("part")):
        name += f" of {_plain(part)}"
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


def _sheet(
    content_at: Callable[[int, int], Content | None],
    image: Callable[[Content, Extent, int], ZBuffer],
    across: SheetAxis,
    up: SheetAxis,
    box: Array,
) -> Figure:
    """A sheet of images; the threads find and draw the contents, the caller places them."""
    with figure_style():
        extent = panel_extent(box, _VIEW)
        wide, high = extent.size.tolist()
        columns, rows = [wide] * len(across.values), [high] * len(up.values)
        figure, panels = place_panels(PAGE, columns, rows, (_LEFT, _RIGHT, _BOTTOM, _TOP))
        panels = panels[::-1]  # row 0 at the bottom
        for ax in panels.ravel().tolist():
            ax.set(xlim=extent[:2], ylim=extent[2:], xticks=[], yticks=[])
            ax.patch.set_visible(False)
            ax.spines[:].set(color="0.88", linewidth=0.4)
        for ax, value in zip(panels[0], across.values, strict=True):
            ax.set_xlabel(f"{value:.4g}", labelpad=3)
        for ax, value in zip(panels[:, 0], up.values, strict=True):
            ax.set_ylabel(f"{value:.4g}", rotation=0, ha="right", va="center", labelpad=4)
        width, height = figure.get_size_inches()
        middle = (_LEFT + width - _RIGHT) / 2 / width, (_BOTTOM + height - _TOP) / 2 / height
        figure.text(middle[0], 0.12 / height, across.label, ha="center", fontsize=9)
        figure.text(0.1 / width, middle[1], up.label, va="center", rotation=90, fontsize=9)
        across_each = max(16, round(panels[0, 0].get_position().width * width * DPI))

        def pixels(row: int, column: int) -> NDArray[np.uint8] | None:
            content = content_at(column, row)
            return None if content is None else image(content, extent, across_each).rgba()

        tasks = (partial(pixels, *place) for place in np.ndindex(panels.shape))
        for ax, rgba in zip(panels.ravel().tolist(), parallel.in_order(tasks), strict=True):
            if rgba is not None:
                # the frame of the axes and their limits stay
                ax.imshow(rgba, extent=extent, interpolation="none", aspect="auto")
        _draw_scale(figure, panels[0, 0])
    return figure


def _draw_scale(figure: Figure, panel: Axes) -> None:
    width, height = figure.get_size_inches()
    ax = figure.add_axes((0.04 / width, 0.02 / height, _LEFT / width, (_BOTTOM - 0.1) / height))
    left, right = panel.get_xlim()
    inch = (right - left) / (panel.get_position().width * width)  # in L
    ax.set(xlim=(0, _LEFT * inch), ylim=(0, (_BOTTOM - 0.1) * inch))
    ax.set_axis_off()
    start, center = 0.08 * inch, np.array([0.22, 0.27]) * inch
    # of a sheet of few columns it is longer than the margin is wide
    style = {"color": "0.2", "lw": 1.2, "solid_capstyle": "butt", "clip_on": False}
    ax.plot([start, start + 0.5], [start] * 2, **style)
    ax.text(start + 0.5 + 0.04 * inch, start, "L/2", fontsize=7, va="center")
    for name, direction in zip("xyz", view_axes(_VIEW)[:2].T, strict=True):
        x, y = center + 0.15 * inch * direction
        arrow = {"arrowstyle": "-|>,head_width=0.1,head_length=0.2", "lw": 0.6, "shrinkA": 0}
        ax.annotate("", (x, y), tuple(center), arrowprops=arrow | {"color": "0.2", "shrinkB": 0})
        x, y = center + 0.22 * inch * direction
        ax.text(x, y, name, fontsize=7, ha="center", va="center")
