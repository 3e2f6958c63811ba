"""A cloud from the front, the side and the top at one scale, and obliquely in its box."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm_shape import rest_configuration
from softreach.picture.projection import View
from softreach.plot.arm import arm_points, plot_arm, shapes_of
from softreach.plot.cloud import drawn_tips, plot_cloud
from softreach.plot.coloring import color_samples, draw_figure_key
from softreach.plot.frame import bounding_box
from softreach.plot.lengths import common_unit, in_lengths, unit_of
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from softreach.arm.manipulator import Manipulator

__all__ = ["plot_views"]

_LEFT, _GAP, _RIGHT, _BOTTOM, _TOP = 0.55, 0.60, 0.12, 0.42, 0.42  # inches


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
    unit, shown = unit_of(cloud["tip"]), [drawn_tips(cloud)]
    if arm is not None:
        common_unit([unit, in_lengths(arm.length)])
        shapes = shapes_of(configuration) or [rest_configuration(arm)]
        shown += [arm_points(arm, shape) for shape in shapes]
    box = bounding_box(*shown)
    coloring = color_samples(cloud, color)
    points = {"color": coloring.rgb / 255, "size": size, "key": False, "box": box * unit.size}
    with figure_style():
        figure, panels, top = _layout(np.ptp(box, axis=0), width, view)
        for seen, ax in panels:
            plot_cloud(cloud, ax=ax, view=seen, **points)
            if arm is not None:
                inside = box * arm.length
                plot_arm(arm, configuration, ax=ax, view=seen, rest=False, box=inside)
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
