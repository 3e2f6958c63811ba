"""Pictures of a reachability cloud: whole, in a slab, and in four views."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.picture.projection import View, sight_axis, view_angles
from softreach.picture.zbuffer import ZBuffer
from softreach.plot.arm import arm_images, arm_points, draw_markers, shapes_of
from softreach.plot.axes import Panel, bounding_box
from softreach.plot.coloring import color_samples, draw_figure_key, draw_key
from softreach.plot.lengths import Unit, common_unit, unit_for, unit_of
from softreach.plot.style import (
    LENGTH,
    PLACE,
    SIZE,
    WIDTH,
    figure_style,
    panel_arguments,
    pyplot,
    write_note,
)
from softreach.rod.arm_shape import rest_configuration
from softreach.schema import a_cloud, base_of
from softreach.support import parallel
from softreach.support.arguments import as_flag, as_number
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


_LARGEST = 8.0  # pixels
_THICKNESS = 1 / 50  # of L, or of the cloud's extent
Images = tuple[ZBuffer, ZBuffer | None]
"""An image, and what shows through it."""

_LEFT, _GAP, _RIGHT, _BOTTOM, _TOP = 0.55, 0.60, 0.12, 0.42, 0.42  # inches


def plot_cloud(
    cloud: xr.Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    color: str | int | ArrayLike | None = None,
    size: float | None = None,
    key: bool = True,
    box: ArrayLike | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw a cloud in one view.

    Args:
        cloud: tip(sample, axis) [m], with the attribute `length` [m] if known, and
            activation(sample, bundle), each in its unit.
        ax: Axes to draw in; None for a new figure.
        view: "front", "side", "top", "oblique", "back", "left", or azimuth and elevation of the
            camera [rad].
        color: "rgb", "strongest" (bundle), "effort", the name or index of a bundle, or an array;
            None for "rgb" of up to three bundles and "strongest" of more; see `color_samples`.
        size: Diameter of a point [pixels at 250 per inch]; None chooses by their number.
        key: Whether to explain the colors.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all points.
        unit: Of the axes: "m", "cm", "mm" or "L"; None for L if the cloud knows it, else m.

    Returns:
        The axes, in that unit.

    Raises:
        InvalidInput: Unknown view, bundle, color or unit, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    cloud, key = a_cloud("cloud", cloud), as_flag("key", key)
    size = None if size is None else as_number("size", size, SIZE)
    ax, box = panel_arguments(ax, view, box)
    with figure_style(ax):
        counted = unit_of(cloud["tip"], unit)
        tips = drawn_tips(cloud, counted)
        panel = Panel.opened(tips, counted, ax, view, box)
        coloring = color_samples(cloud, color)
        panel.show(cloud_image(panel, tips, coloring.rgb, size))
        if key:
            draw_key(panel.ax, coloring.key)
    return panel.ax


def cloud_image(panel: Panel, tips: Array, rgb: NDArray[np.uint8], size: float | None) -> ZBuffer:
    """The image of points in a panel.

    Args:
        panel: Where it will be shown.
        tips: In the units of the axes, shape (n, 3).
        rgb: From 0 to 255, shape (n, 3).
        size: As in `plot_cloud`.
    """
    spread = point_size(len(tips), panel.box) * panel.pixels_per_unit
    pixels = size or min(_LARGEST, spread)
    # small points gain nothing from smoothing; fine steps of color drown in their noise
    buffer = panel.buffer(oversample=1 if pixels < 3.5 else 2, color_step=8)
    buffer.draw_points(tips, rgb, pixels, view=panel.view)
    return buffer


def drawn_tips(cloud: xr.Dataset, unit: LengthUnit) -> Array:
    """Tip positions in the unit of the axes, shape (sample, 3)."""
    return unit.of(cloud["tip"].transpose("sample", "axis").values)


def point_size(samples: int, box: Array) -> float:
    """A diameter that closes the surface of a cloud without blurring it, in units of the box."""
    spacing = np.ptp(box, axis=0).max() / np.cbrt(max(samples, 1))
    return 0.45 * float(spacing)


def plot_slab(
    cloud: xr.Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    at: float | None = None,
    thickness: float | None = None,
    color: str | int | ArrayLike | None = None,
    size: float | None = None,
    key: bool = True,
    box: ArrayLike | None = None,
    unit: Unit = None,
) -> Axes:
    """Draw the tips in a slab across the line of sight; a note in the axes says which.

    What is not described here is as in `plot_cloud`.

    Args:
        cloud: As in `plot_cloud`.
        ax: As in `plot_cloud`.
        view: A view along an axis: "front" for a slab in y, "side" in x, "top" in z.
        at: Where the middle of the slab is on that axis [m]; None for the base of the arm.
        thickness: Of the whole slab [m]; None for a fiftieth of L, or where the cloud does not know
            L, of its largest extent.
        color: As in `plot_cloud`, for all samples of the cloud.
        size: As in `plot_cloud`.
        key: As in `plot_cloud`.
        box: As in `plot_cloud`.
        unit: As in `plot_cloud`.

    Returns:
        The axes, in that unit.

    Raises:
        InvalidInput: Not a view along an axis, unknown color, or no tip in the slab.
        MissingExtra: matplotlib is not installed.
    """
    cloud, key = a_cloud("cloud", cloud), as_flag("key", key)
    at = None if at is None else as_number("at", at, PLACE)
    thickness = None if thickness is None else as_number("thickness", thickness, LENGTH)
    size = None if size is None else as_number("size", size, SIZE)
    ax, box = panel_arguments(ax, view, box)
    counted, axis = unit_of(cloud["tip"], unit), sight_axis(view)
    tips = drawn_tips(cloud, counted)
    at = float(base_of(cloud)["xyz".index(axis)]) if at is None else at
    middle, half = float(counted.of(at)), _half(thickness, tips, counted)
    depth = tips[:, "xyz".index(axis)] - middle
    inside = np.abs(depth) <= half
    if not inside.any():
        allowed = f"such that a tip lies in the slab about {axis} = {at:.4g} m"
        raise InvalidInput("thickness", f"{2 * half * counted.size:.4g} m", allowed)
    coloring = color_samples(cloud, color)
    with figure_style(ax):
        panel = Panel.opened(tips, counted, ax, view, box)
        slab, rgb = cloud.isel(sample=np.flatnonzero(inside)), coloring.rgb[inside] / 255
        pixels = size or _point_size(len(rgb), panel)
        shown = {"box": panel.box * counted.size, "key": False, "unit": counted}
        plot_cloud(slab, ax=panel.ax, view=view, color=rgb, size=pixels, **shown)
        write_note(panel.ax, _place(axis, middle, half, counted), 0.03, 0.02)
        if key:
            draw_key(panel.ax, coloring.key)
    return panel.ax


def plot_views(
    cloud: xr.Dataset,
    arm: Manipulator | None = None,
    configuration: xr.Dataset | None = None,
    *,
    view: View = "oblique",
    color: str | int | ArrayLike | None = None,
    size: float | None = None,
    width: float = 6.9,
    unit: Unit = None,
) -> Figure:
    """Draw a cloud in three orthogonal views at one scale and an oblique one.

    Args:
        cloud: As in `plot_cloud`.
        arm: Drawn over the cloud; None for the cloud alone.
        configuration: Configurations of that arm to draw; None for the arm at rest.
        view: Of the fourth panel; the first three are "front", "side" and "top".
        color: As in `plot_cloud`.
        size: As in `plot_cloud`.
        width: Of the figure [inch].
        unit: As in `plot_cloud`.

    Returns:
        The figure, with the axes front, side, top and oblique, and those of the color bar if there
        is one.

    Raises:
        InvalidInput: As `plot_cloud`; an arm beside a cloud that does not know L, without a unit.
        MissingExtra: matplotlib is not installed.
    """
    cloud, width = a_cloud("cloud", cloud), as_number("width", width, WIDTH)
    size = None if size is None else as_number("size", size, SIZE)
    view_angles(view)
    counted = unit_of(cloud["tip"], unit)
    tips = drawn_tips(cloud, counted)
    shown, shapes = [tips], shapes_of(configuration)
    if arm is not None:
        arm = a_manipulator("arm", arm)
        common_unit([counted, unit_for(arm.length, unit)])
        shapes = shapes or [rest_configuration(arm)]
        shown += [arm_points(arm, shape, counted) for shape in shapes]
    box = _not_too_slim(bounding_box(*shown))
    coloring = color_samples(cloud, color)
    with figure_style():
        figure, axes, top = _layout(np.ptp(box, axis=0), width, view)
        panels = [Panel(ax, box, seen, counted) for seen, ax in axes]
        images: list[list[Images]] = [[] for _ in panels]

        def draw(panel: Panel, drawn: list[Images]) -> None:
            drawn.append((cloud_image(panel, tips, coloring.rgb, size), None))
            if arm is not None:
                drawn.append(arm_images(panel, arm, shapes, range(arm.bundles)))

        parallel.run(partial(draw, *each) for each in zip(panels, images, strict=True))
        for panel, drawn in zip(panels, images, strict=True):
            for image, within in drawn:
                panel.show(image, within)
            if arm is not None:
                draw_markers(panel, arm, shapes)
        draw_figure_key(figure, coloring.key, top)
    return figure


def _not_too_slim(box: Array) -> Array:
    """The box with sides of half the longest one at least, so that a thin arm fits a page."""
    span = np.ptp(box, axis=0)
    margin = np.maximum(0.5 * span.max() - span, 0.0) / 2
    return box + np.array([-margin, margin])


def _half(thickness: float | None, tips: Array, unit: LengthUnit) -> float:
    if thickness is not None:
        return float(unit.of(thickness)) / 2
    return _THICKNESS / 2 * (1.0 if unit.relative else float(np.nanmax(np.ptp(tips, axis=0))))


def _place(axis: str, middle: float, half: float, unit: LengthUnit) -> str:
    distance = f"{axis} - {middle:.3g} {unit.name}" if middle else axis
    return f"|{distance}| ≤ {half:.3g} {unit.name}"


def _point_size(count: int, panel: Panel) -> float:
    """A diameter [pixels] that closes a slice: about the mean spacing in the plane."""
    extent = panel.extent
    area = (extent.right - extent.left) * (extent.top - extent.bottom)
    return float(np.clip(1.2 * np.sqrt(area / count) * panel.pixels_per_unit, 2.0, 8.0))


def _layout(span: Array, width: float, view: View) -> tuple[Figure, list[tuple[View, Axes]], float]:
    """Views and axes whose sizes are the spans at one scale, and the share of height above them."""
    x, y, z = span * (width - _LEFT - _GAP - _RIGHT) / (span[0] + span[1])
    height = _BOTTOM + y + _GAP + z + _TOP
    figure = pyplot().figure(figsize=(width, height))
    column, row = _LEFT + x + _GAP, _BOTTOM + y + _GAP
    places = [
        ("front", (_LEFT, row, x, z)),
        ("side", (column, row, y, z)),
        ("top", (_LEFT, _BOTTOM, x, y)),
        # its tick labels stand outside the box, so it gets the margins too
        (view, (column, 0.7 * _BOTTOM, y, y)),
    ]
    share = np.array([width, height, width, height])
    panels = [(seen, figure.add_axes(tuple(place / share))) for seen, place in places]
    return figure, panels, _TOP / height
