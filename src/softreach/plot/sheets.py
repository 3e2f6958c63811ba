"""Sheets of an atlas, a small picture for each design, and all figures that it has numbers for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.atlas import DamagedStore, atlas_cloud, over_length
from softreach.atlas.store import DONE
from softreach.cloud.clouds import design_of
from softreach.cloud.curvature import curvature_statistics
from softreach.cloud.volume import concave_hull
from softreach.geometry.hull import Hull
from softreach.picture.projection import View, view_angles, view_axes
from softreach.picture.shading import draw_mesh
from softreach.picture.zbuffer import Extent, ZBuffer
from softreach.plot.arm import plot_arm
from softreach.plot.atlas import SheetAxis, plot_metric_map, sheet_axes
from softreach.plot.axes import bounding_box, view_extent
from softreach.plot.clouds import drawn_tips, plot_cloud, point_size
from softreach.plot.coloring import (
    bundle_activations,
    bundle_names,
    color_samples,
    draw_figure_key,
    key_height,
)
from softreach.plot.lengths import Unit, unit_of
from softreach.plot.statistics import SIDES, plot_curvature
from softreach.plot.style import DPI, PAGE, as_box, figure_style, place_panels
from softreach.schema import a_cloud, is_stable
from softreach.support import parallel
from softreach.support.arguments import as_integer, as_mapping
from softreach.support.arrays import Array, Index
from softreach.support.errors import InvalidInput, warn
from softreach.support.palette import STEEL, activation_colors

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_LEFT, _RIGHT, _BOTTOM, _TOP = 0.75, 0.04, 0.62, 0.08  # inches around a sheet
_KEY = 0.45  # inches for the key of colors at least
_LETTERS = 90  # of titles side by side
_VIEW = "oblique"  # of sheets
_METRICS = ("volume", "exact_volume", "unreachability", "exact_unreachability")


def atlas_figures(atlas: xr.Dataset, panels: int = 7) -> Iterator[tuple[str, Any]]:
    """Name and figure (or axes) of each figure that an atlas has the numbers for.

    They are drawn one after the other, so that few clouds are held at once.

    Args:
        atlas: A grid of two parameters, from `open_atlas`.
        panels: Columns and rows of the sheets at most.
    """
    for metric in _METRICS:
        if metric in atlas and np.isfinite(atlas[metric].values).any():
            yield f"map_{metric}", plot_metric_map(atlas, metric)
    if "x_min" not in atlas:
        return
    yield "clouds", plot_cloud_sheet(atlas, panels=panels)
    ends = _thinned(atlas, 2)
    across, up = sheet_axes(ends)
    places = np.ndindex(len(across.values), len(up.values))  # in the paper's order
    clouds = {at: cloud for at in places if (cloud := _cloud_at(ends, *at)) is not None}
    named = {f"{across.text(j)}, {up.text(k)}": cloud for (j, k), cloud in clouds.items()}
    yield "corners", plot_opposite_sides(named, box_over_length=box_over_length(atlas))
    last = len(across.values) - 1
    those = {up.text(k): cloud for (j, k), cloud in clouds.items() if j == last}
    if those:
        ax = plot_curvature({label: curvature_statistics(x) for label, x in those.items()})
        ax.set_title(across.text(last), fontsize=9)
        yield "curvature", ax
    hulls = plot_hull_sheet(atlas, panels=panels)
    if len(those) == len(SIDES):
        _frame_compared(hulls)
    yield "hulls", hulls


def _frame_compared(hulls: Figure) -> None:
    """Frame the two designs that figure 3c compares, the ends of the last column, in its colors."""
    grid = hulls.axes[0].get_gridspec()
    assert grid is not None
    rows, columns = grid.get_geometry()
    for row, color in zip((rows - 1, 0), SIDES, strict=True):
        hulls.axes[(row + 1) * columns - 1].spines[:].set(color=color, linewidth=1.6)


def plot_cloud_sheet(atlas: xr.Dataset, *, panels: int = 7) -> Figure:
    """A sheet of the clouds of an atlas at one scale, colored by activation (figure 2a).

    Each is drawn in its own L. Designs that are not done leave a gap.

    Args:
        atlas: A grid of two parameters with the metrics "extent", from `open_atlas`.
        panels: Columns and rows at most; the designs at the ends are always among them.

    Raises:
        InvalidInput: No grid of two parameters, no bounding boxes, or no design is done.
        MissingExtra: matplotlib is not installed.
    """
    box = box_over_length(atlas)

    def image(cloud: xr.Dataset, extent: Extent, columns: int) -> ZBuffer:
        tips = drawn_tips(cloud, unit_of(cloud["tip"]))
        pixels = point_size(len(tips), box) * columns / extent.size[0]
        buffer = ZBuffer(extent, columns, oversample=2, color_step=8)
        colors = activation_colors(bundle_activations(cloud).values)
        buffer.draw_points(tips, colors, max(1.0, pixels), view=_VIEW)
        return buffer

    return _sheet(atlas, panels, box, image, keyed=True)


def plot_hull_sheet(atlas: xr.Dataset, *, panels: int = 7) -> Figure:
    """A sheet of the lit α-shapes of an atlas at one scale (figure 3a).

    Their radius is that of the metric `volume` of the atlas, 0.05 L without it. What is not
    described here is as in `plot_cloud_sheet`.

    Args:
        atlas: As in `plot_cloud_sheet`.
        panels: As in `plot_cloud_sheet`.

    Raises:
        InvalidInput: As `plot_cloud_sheet`.
        MissingExtra: matplotlib is not installed.
    """
    alpha = float(atlas["volume"].attrs["alpha_over_length"]) if "volume" in atlas else 0.05

    def image(cloud: xr.Dataset, extent: Extent, columns: int) -> ZBuffer:
        hull = hull_over_length(cloud, alpha)
        buffer = ZBuffer(extent, columns, oversample=3, color_step=4)
        draw_mesh(buffer, hull.vertices, hull.faces, STEEL, _VIEW)
        return buffer

    return _sheet(atlas, panels, box_over_length(atlas), image)


def hull_over_length(cloud: xr.Dataset, alpha: float) -> Hull:
    """The α-shape of the stable tips of a cloud; it, its radius and its volume in L of the arm."""
    tips = cloud.tip.values[is_stable(cloud.tip)]
    return concave_hull(tips / cloud.tip.attrs["length"], alpha)


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
    key = color_samples(next(iter(clouds.values())), "rgb").key
    room, columns = max(_KEY, key_height(key)), [1.0] * len(clouds)
    beside, right = (0.58, 0.26) if unit in (None, "L") else (0.75, 0.48)
    titles = [f"({k + 1})  {title}" for k, title in enumerate(clouds)]
    titles = [fill(title, round(_LETTERS / len(clouds))) for title in titles]
    top = room + 0.16 * max(1 + title.count("\n") for title in titles)
    with figure_style():
        edges = (beside + 0.07, right, 0.45, top)
        figure, panels = place_panels(PAGE, columns, [1.1, 1.1], edges, (beside, 0.45))
        for k, cloud in enumerate(clouds.values()):
            arm = design_of(cloud)
            box = np.asarray(around) * arm.length
            panels[0, k].set_title(titles[k], pad=4)
            for ax, side in zip(panels[:, k], sides, strict=True):
                plot_cloud(cloud, ax=ax, view=side, color="rgb", key=False, box=box, unit=unit)
                plot_arm(arm, ax=ax, view=side, box=box, unit=unit)
        draw_figure_key(figure, key, room)
    return figure


def _sheet(
    atlas: xr.Dataset,
    panels: int,
    box: Array,
    image: Callable[[xr.Dataset, Extent, int], ZBuffer],
    *,
    keyed: bool = False,
) -> Figure:
    """A sheet of images of clouds; the threads read and draw them, the caller places them."""
    picked = _thinned(atlas, as_integer("panels", panels, 1))
    across, up = sheet_axes(picked)
    with figure_style():
        first = _first_cloud(picked) if keyed else None
        key = None if first is None else color_samples(first.isel(sample=slice(1)), "rgb").key
        extent = panel_extent(box, _VIEW)
        wide, high = extent.size.tolist()
        columns, rows = [wide] * len(across.values), [high] * len(up.values)
        top = max(_KEY, key_height(key)) if keyed else _TOP
        figure, grid = place_panels(PAGE, columns, rows, (_LEFT, _RIGHT, _BOTTOM, top))
        grid = grid[::-1]  # row 0 at the bottom
        _label_sheet(grid, across, up)
        _name_axes(figure, (across, up), atlas, top)
        across_each = max(16, round(grid[0, 0].get_position().width * PAGE * DPI))

        def pixels(row: int, column: int) -> NDArray[np.uint8] | None:
            cloud = _cloud_at(picked, column, row)
            return None if cloud is None else image(cloud, extent, across_each).rgba()

        tasks = (partial(pixels, *place) for place in np.ndindex(grid.shape))
        for ax, rgba in zip(grid.ravel().tolist(), parallel.in_order(tasks), strict=True):
            if rgba is not None:
                ax.imshow(rgba, extent=extent, interpolation="none", aspect="auto")
            ax.set(xlim=extent[:2], ylim=extent[2:], xticks=[], yticks=[])
        _draw_scale(figure, grid[0, 0])
        draw_figure_key(figure, key, top)
    return figure


def _label_sheet(grid: NDArray[Any], across: SheetAxis, up: SheetAxis) -> None:
    for ax in grid.ravel().tolist():
        ax.patch.set_visible(False)
        ax.spines[:].set(color="0.88", linewidth=0.4)
    for ax, value in zip(grid[0], across.values, strict=True):
        ax.set_xlabel(f"{value:.4g}", labelpad=3)
    for ax, value in zip(grid[:, 0], up.values, strict=True):
        ax.set_ylabel(f"{value:.4g}", rotation=0, ha="right", va="center", labelpad=4)


def _name_axes(
    figure: Figure, axes: tuple[SheetAxis, SheetAxis], atlas: xr.Dataset, top: float
) -> None:
    """Symbols of both parameters, and how many of their values are shown."""
    width, height = figure.get_size_inches()
    middle = (_LEFT + width - _RIGHT) / 2 / width, (_BOTTOM + height - top) / 2 / height
    sizes = zip(axes, (len(axis.values) for axis in axes), atlas["status"].shape, strict=True)
    across, up = (
        axis.label if shown == size else f"{axis.label}, {shown} of {size} values"
        for axis, shown, size in sizes
    )
    figure.text(middle[0], 0.12 / height, across, ha="center", fontsize=9)
    figure.text(0.1 / width, middle[1], up, va="center", rotation=90, fontsize=9)


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


def _thinned(atlas: xr.Dataset, panels: int) -> xr.Dataset:
    """As many designs along each parameter as there are panels at most, the ends among them."""
    sizes = {str(dim): atlas.sizes[dim] for dim in atlas["status"].dims}
    return atlas.isel({dim: evenly(size, panels) for dim, size in sizes.items()})


def evenly(size: int, most: int) -> Index:
    """Numbers from 0 to size - 1, both among them; at equal steps if that leaves half of `most`."""
    shown = min(size, most)
    steps = (n for n in range(shown, shown // 2, -1) if n > 1 and (size - 1) % (n - 1) == 0)
    return np.rint(np.linspace(0, size - 1, next(steps, shown))).astype(int)


def _first_cloud(atlas: xr.Dataset) -> xr.Dataset | None:
    places = np.ndindex(atlas["status"].shape)
    return next((cloud for at in places if (cloud := _cloud_at(atlas, *at)) is not None), None)


def _cloud_at(atlas: xr.Dataset, column: int, row: int) -> xr.Dataset | None:
    """The cloud of the design there, if it is done and not damaged."""
    if int(atlas["status"][column, row]) != DONE:
        return None
    across, up = map(str, atlas["status"].dims)
    try:
        at = {across: float(atlas[across][column]), up: float(atlas[up][row])}
        return atlas_cloud(atlas, **at)
    except DamagedStore as error:
        warn(f"a cloud is left out: {error}")
        return None
