"""A cloud from the front, the side and the top at one scale, and obliquely in its box."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach import parallel
from softreach.arguments import checked, optional
from softreach.arm_shape import rest_configuration
from softreach.picture.projection import View
from softreach.picture.zbuffer import ZBuffer
from softreach.plot.arguments import MANIPULATOR, POINTS, SHAPE, SIZE, WIDTH, a_view
from softreach.plot.arm import arm_images, arm_points, shapes_of
from softreach.plot.cloud import cloud_image, drawn_tips
from softreach.plot.coloring import color_samples, draw_figure_key
from softreach.plot.frame import Panel, bounding_box
from softreach.plot.lengths import common_unit, in_lengths, unit_of
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softreach.arm.manipulator import Manipulator

__all__ = ["plot_views"]

Images = tuple[ZBuffer, ZBuffer | None]
"""An image, and what shows through it."""

_LEFT, _GAP, _RIGHT, _BOTTOM, _TOP = 0.55, 0.60, 0.12, 0.42, 0.42  # inches


@checked(
    cloud=POINTS,
    arm=optional(MANIPULATOR),
    configuration=optional(SHAPE),
    view=a_view,
    size=SIZE,
    width=WIDTH,
)
def plot_views(
    cloud: xr.Dataset,
    arm: Manipulator | None = None,
    configuration: xr.Dataset | None = None,
    *,
    view: View = "oblique",
    color: str | int | ArrayLike = "rgb",
    size: float | None = None,
    width: float = 6.9,
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

    Returns:
        The figure, with the axes front, side, top and oblique, and those of the color bar if there
        is one.

    Raises:
        InvalidInput: As `plot_cloud`; an arm beside a cloud that does not know L.
        MissingExtra: matplotlib is not installed.
    """
    unit, tips = unit_of(cloud["tip"]), drawn_tips(cloud)
    shown, shapes = [tips], []
    if arm is not None:
        common_unit([unit, in_lengths(arm.length)])
        shapes = shapes_of(configuration) or [rest_configuration(arm)]
        shown += [arm_points(arm, shape) for shape in shapes]
    box = bounding_box(*shown)
    coloring = color_samples(cloud, color)
    with figure_style():
        figure, axes, top = _layout(np.ptp(box, axis=0), width, view)
        panels = [Panel(ax, box, seen, unit) for seen, ax in axes]
        images: list[list[Images]] = [[] for _ in panels]

        def draw(panel: Panel, drawn: list[Images]) -> None:
            drawn.append((cloud_image(panel, tips, coloring.rgb, size), None))
            if arm is not None:
                drawn.append(arm_images(panel, arm, shapes, range(arm.bundles)))

        parallel.run(partial(draw, *each) for each in zip(panels, images, strict=True))
        for panel, drawn in zip(panels, images, strict=True):
            for image, within in drawn:
                panel.show(image, within)
        draw_figure_key(figure, coloring.key, top)
    return figure


def _layout(
    span: NDArray[np.float64], width: float, view: View
) -> tuple[Figure, list[tuple[View, Axes]], float]:
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
