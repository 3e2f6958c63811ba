"""A cloud from the front, the right and the top at one scale, and obliquely in its box."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm_shape import rest_configuration
from softreach.plot.arm import arm_points, plot_arm, shapes_of
from softreach.plot.cloud import plot_cloud, tips_in_lengths
from softreach.plot.coloring import color_samples, draw_figure_key
from softreach.plot.frame import bounding_box
from softreach.plot.projection import OBLIQUE, View
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from softreach.arm.manipulator import Manipulator

__all__ = ["plot_views"]

_LEFT, _GAP, _RIGHT, _BOTTOM, _TOP = 0.55, 0.60, 0.12, 0.42, 0.42  # inches


def plot_views(
    cloud: xr.Dataset,
    arm: Manipulator | None = None,
    configuration: xr.Dataset | None = None,
    *,
    color: str | int | ArrayLike = "rgb",
    size: float | None = None,
    oblique: View = OBLIQUE,
    width: float = 6.9,
) -> dict[str, Axes]:
    """Draw a cloud in three orthogonal views at one scale and an oblique one, in a new figure.

    Args:
        cloud: tip(sample, axis) [m] and activation(sample, fiber) [-].
        arm: Drawn over the cloud; None for the cloud alone.
        configuration: Configurations of that arm to draw; None for the arm at rest.
        color: As `plot_cloud` has it.
        size: Diameter of a point [pixels at 250 per inch]; None chooses.
        oblique: Azimuth and elevation of the eye in the fourth view [rad].
        width: Of the figure [inch].

    Returns:
        The axes by name: "front", "right", "top" and "oblique".

    Raises:
        InvalidInput: As `plot_cloud`.
        MissingExtra: matplotlib is not installed.
    """
    shown = [tips_in_lengths(cloud)]
    if arm is not None:
        shapes = shapes_of(configuration) or [rest_configuration(arm)]
        shown += [arm_points(arm, shape) for shape in shapes]
    box = bounding_box(*shown)
    coloring = color_samples(cloud, color)
    with figure_style():
        axes, top = _layout(np.ptp(box, axis=0), width)
        for name, ax in axes.items():
            view = oblique if name == "oblique" else name
            plot_cloud(
                cloud, ax, view=view, color=coloring.rgb / 255, size=size, key=False, box=box
            )
            if arm is not None:
                plot_arm(arm, configuration, ax, view=view, rest=False, box=box)
        figure = axes["front"].get_figure(root=True)
        assert figure is not None
        draw_figure_key(figure, coloring.key, top)
    return axes


def _layout(span: NDArray[np.float64], width: float) -> tuple[dict[str, Axes], float]:
    """Axes whose sizes are the spans at one scale, and the share of the height above them."""
    x, y, z = span * (width - _LEFT - _GAP - _RIGHT) / (span[0] + span[1])
    height = _BOTTOM + y + _GAP + z + _TOP
    figure = pyplot().figure(figsize=(width, height))
    column, row = _LEFT + x + _GAP, _BOTTOM + y + _GAP
    places = {
        "front": (_LEFT, row, x, z),
        "right": (column, row, y, z),
        "top": (_LEFT, _BOTTOM, x, y),
        # its tick labels stand outside the box, so it gets the margins too
        "oblique": (column, 0.7 * _BOTTOM, y, y),
    }
    share = np.array([width, height, width, height])
    return {n: figure.add_axes(tuple(p / share)) for n, p in places.items()}, _TOP / height
