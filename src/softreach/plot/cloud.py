"""The picture of a reachability cloud: every tip a point, its color the activation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arguments import checked, flag
from softreach.picture.projection import View
from softreach.picture.zbuffer import ZBuffer
from softreach.plot.arguments import DRAWN, POINTS, SIZE
from softreach.plot.coloring import color_samples, draw_key
from softreach.plot.frame import Panel
from softreach.plot.lengths import unit_of
from softreach.plot.style import figure_style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

__all__ = ["cloud_image", "drawn_tips", "plot_cloud", "point_size"]

_LARGEST = 8.0  # pixels


@checked(**DRAWN, cloud=POINTS, size=SIZE, key=flag)
def plot_cloud(
    cloud: xr.Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    color: str | int | ArrayLike = "rgb",
    size: float | None = None,
    key: bool = True,
    box: ArrayLike | None = None,
) -> Axes:
    """Draw a cloud in one view.

    Args:
        cloud: tip(sample, axis) [m], with the attribute `length` [m] if known, and
            activation(sample, bundle), each in its unit.
        ax: Axes to draw in; None for a new figure.
        view: "front", "side", "top", "oblique", "back", "left", or azimuth and elevation of the eye
            [rad].
        color: "rgb", the name or index of a bundle, or an array; see `color_samples`.
        size: Diameter of a point [pixels at 250 per inch]; None chooses by their number.
        key: Whether to explain the colors.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all points.

    Returns:
        The axes, in L if the cloud knows it, else in meters.

    Raises:
        InvalidInput: Unknown view, bundle or color, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    with figure_style(ax):
        tips = drawn_tips(cloud)
        panel = Panel.opened(tips, unit_of(cloud["tip"]), ax, view, box)
        coloring = color_samples(cloud, color)
        panel.show(cloud_image(panel, tips, coloring.rgb, size))
        if key:
            draw_key(panel.ax, coloring.key)
    return panel.ax


def cloud_image(
    panel: Panel, tips: NDArray[np.float64], rgb: NDArray[np.uint8], size: float | None
) -> ZBuffer:
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


def drawn_tips(cloud: xr.Dataset) -> NDArray[np.float64]:
    """Tip positions in the units of the axes, shape (sample, 3)."""
    tip = cloud["tip"].transpose("sample", "axis")
    return unit_of(tip).of(tip.values)


def point_size(samples: int, box: NDArray[np.float64]) -> float:
    """A diameter that closes the surface of a cloud without blurring it, in units of the box."""
    spacing = np.ptp(box, axis=0).max() / np.cbrt(max(samples, 1))
    return 0.45 * float(spacing)
