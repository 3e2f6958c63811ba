"""Sheets of an atlas: one small picture for each design, all at one scale."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.cloud.clouds import design_of
from softreach.geometry.surface import SurfaceMesh
from softreach.picture.projection import View, view_angles, view_axes
from softreach.picture.shading import draw_mesh
from softreach.picture.zbuffer import Extent, ZBuffer
from softreach.plot.arm import plot_arm
from softreach.plot.axes import bounding_box, view_extent
from softreach.plot.clouds import drawn_tips, plot_cloud, point_size
from softreach.plot.coloring import bundle_activations, bundle_names, color_samples, draw_figure_key
from softreach.plot.lengths import Unit, unit_of
from softreach.plot.metric_map import SheetAxis
from softreach.plot.style import DPI, WIDTH, as_box, figure_style, pyplot
from softreach.schema import a_cloud
from softreach.support import parallel
from softreach.support.arguments import as_mapping, as_number
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.palette import STEEL, activation_colors

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Grid = NDArray[np.object_]
Content = TypeVar("Content")
_LEFT, _RIGHT, _BOTTOM, _TOP = 0.75, 0.04, 0.62, 0.08  # inches around a sheet


def plot_cloud_sheet(
    cloud_at: Callable[[int, int], xr.Dataset | None],
    across: SheetAxis,
    up: SheetAxis,
    *,
    box_over_length: ArrayLike,
    view: View = "oblique",
    width: float = 6.9,
) -> Figure:
    """A sheet of clouds at one scale, colored by activation (figure 2a).

    Args:
        cloud_at: (column, row) -> cloud, row 0 at the bottom; None leaves a gap. Called once for
            each, on all threads, so that one cloud is held on each.
        across: Parameter along the horizontal edge.
        up: Parameter along the vertical edge.
        box_over_length: What each panel shows, lower and upper corner in L [-], shape (2, 3).
        view: As in `plot_cloud`.
        width: Of the figure [inch].

    Raises:
        InvalidInput: A cloud that does not know L, or an unknown view.
        MissingExtra: matplotlib is not installed.
    """
    box = np.asarray(box_over_length, float)

    def image(cloud: xr.Dataset, columns: int) -> ZBuffer:
        return _cloud_image(cloud, columns, box, view)

    return _filled_sheet(cloud_at, image, across, up, box, view, width)


def plot_hull_sheet(
    hull_at: Callable[[int, int], SurfaceMesh | None],
    across: SheetAxis,
    up: SheetAxis,
    *,
    length: ArrayLike,
    box_over_length: ArrayLike,
    view: View = "oblique",
    width: float = 6.9,
) -> Figure:
    """A sheet of lit hulls at one scale (figure 3a).

    Args:
        hull_at: (column, row) -> surface [m], row 0 at the bottom; None leaves a gap. Called as
            `cloud_at` of `plot_cloud_sheet` is.
        across: As for `plot_cloud_sheet`.
        up: As for `plot_cloud_sheet`.
        length: L [m], one for all or one for each panel, shape (columns, rows).
        box_over_length: As for `plot_cloud_sheet`.
        view: As in `plot_cloud`.
        width: Of the figure [inch].

    Raises:
        InvalidInput: An unknown view.
        MissingExtra: matplotlib is not installed.
    """
    box = np.asarray(box_over_length, float)
    lengths = np.broadcast_to(np.asarray(length, float), (len(across.values), len(up.values)))

    def relative(column: int, row: int) -> tuple[Array, ArrayLike] | None:
        if (hull := hull_at(column, row)) is None:
            return None
        return np.asarray(hull.vertices) / lengths[column, row], hull.faces

    def image(surface: tuple[Array, ArrayLike], columns: int) -> ZBuffer:
        buffer = ZBuffer(panel_extent(box, view), columns, oversample=3, color_step=4)
        draw_mesh(buffer, *surface, STEEL, view)
        return buffer

    return _filled_sheet(relative, image, across, up, box, view, width)


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
    return Extent(
        max(limits.left, x - w),
        min(limits.right, x + w),
        max(limits.bottom, y - h),
        min(limits.top, y + h),
    )


def plot_opposite_sides(
    clouds: Mapping[str, xr.Dataset],
    *,
    view: View = "oblique",
    box_over_length: ArrayLike | None = None,
    width: float = 6.9,
    unit: Unit = None,
) -> Figure:
    """Clouds from two opposing sides, one column each, with their arms at rest (figure 2b).

    Args:
        clouds: Clouds by the title of their column; each says which arm it belongs to.
        view: Of the upper row, as in `plot_cloud`; the lower row is opposite.
        box_over_length: What each panel shows, lower and upper corner in L [-], shape (2, 3); None
            for all points.
        width: Of the figure [inch].
        unit: Of the axes, as in `plot_cloud`.

    Raises:
        InvalidInput: No clouds, clouds of different bundles, an unknown view, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    clouds, width = as_mapping("clouds", clouds, a_cloud), as_number("width", width, WIDTH)
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
        column = width / len(clouds)
        figure = pyplot().figure(figsize=(width, 2 * column + 0.5))
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


def _filled_sheet(
    content_at: Callable[[int, int], Content | None],
    image: Callable[[Content, int], ZBuffer],
    across: SheetAxis,
    up: SheetAxis,
    box: Array,
    view: View,
    width: float,
) -> Figure:
    """A sheet of images; the threads find and draw the contents, the caller places them."""
    with figure_style():
        figure, panels = _sheet(across, up, box, view, width)
        inches = panels[0, 0].get_position().width * figure.get_size_inches()[0]
        columns, extent = max(16, round(inches * DPI)), panel_extent(box, view)

        def pixels(row: int, column: int) -> NDArray[np.uint8] | None:
            content = content_at(column, row)
            return None if content is None else image(content, columns).rgba()

        tasks = (partial(pixels, *place) for place in np.ndindex(panels.shape))
        for ax, rgba in zip(panels.ravel().tolist(), parallel.in_order(tasks), strict=True):
            if rgba is not None:
                # the frame of the axes and their limits stay
                ax.imshow(rgba, extent=extent, interpolation="none", aspect="auto")
        _draw_scale(figure, panels[0, 0], view)
    return figure


def _sheet(
    across: SheetAxis, up: SheetAxis, box: Array, view: View, width: float
) -> tuple[Figure, Grid]:
    extent = panel_extent(box, view)
    aspect = (extent.top - extent.bottom) / (extent.right - extent.left)
    columns, rows = len(across.values), len(up.values)
    size = np.array([1.0, aspect]) * (width - _LEFT - _RIGHT) / columns
    height = _BOTTOM + rows * size[1] + _TOP
    figure = pyplot().figure(figsize=(width, height))
    panels = np.empty((rows, columns), object)
    for row, column in np.ndindex(rows, columns):
        left, bottom = _LEFT + column * size[0], _BOTTOM + row * size[1]
        place = (left / width, bottom / height, size[0] / width, size[1] / height)
        panels[row, column] = _blank(figure, place, extent)
    for ax, value in zip(panels[0], across.values, strict=True):
        ax.set_xlabel(f"{value:.4g}", labelpad=3)
    for ax, value in zip(panels[:, 0], up.values, strict=True):
        ax.set_ylabel(f"{value:.4g}", rotation=0, ha="right", va="center", labelpad=4)
    middle = (_LEFT + columns * size[0] / 2) / width
    figure.text(middle, 0.12 / height, across.label, ha="center", fontsize=9)
    figure.text(
        0.1 / width,
        (_BOTTOM + rows * size[1] / 2) / height,
        up.label,
        va="center",
        rotation=90,
        fontsize=9,
    )
    return figure, panels


def _blank(figure: Figure, place: tuple[float, float, float, float], extent: Extent) -> Axes:
    ax = figure.add_axes(place)
    ax.set(xlim=(extent.left, extent.right), ylim=(extent.bottom, extent.top), xticks=[], yticks=[])
    ax.patch.set_visible(False)
    for spine in ax.spines.values():
        spine.set(color="0.88", linewidth=0.4)
    return ax


def _cloud_image(cloud: xr.Dataset, columns: int, box: Array, view: View) -> ZBuffer:
    extent = panel_extent(box, view)
    unit = unit_of(cloud["tip"])
    if not unit.relative:
        raise InvalidInput("cloud.tip.attrs['length']", None, "L [m], the unit of the sheet")
    tips = drawn_tips(cloud, unit)
    pixels = point_size(len(tips), box) * columns / (extent.right - extent.left)
    buffer = ZBuffer(extent, columns, oversample=2, color_step=8)
    colors = activation_colors(bundle_activations(cloud).values)
    buffer.draw_points(tips, colors, max(1.0, pixels), view=view)
    return buffer


def _draw_scale(figure: Figure, panel: Axes, view: View) -> None:
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
    for name, direction in zip("xyz", view_axes(view)[:2].T, strict=True):
        x, y = center + 0.15 * inch * direction
        arrow = {"arrowstyle": "-|>,head_width=0.1,head_length=0.2", "lw": 0.6, "shrinkA": 0}
        ax.annotate("", (x, y), tuple(center), arrowprops=arrow | {"color": "0.2", "shrinkB": 0})
        x, y = center + 0.22 * inch * direction
        ax.text(x, y, name, fontsize=7, ha="center", va="center")
