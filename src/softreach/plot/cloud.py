"""The picture of a reachability cloud: every tip a point, its color the activation."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.plot.coloring import color_samples, draw_key
from softreach.plot.frame import bounding_box, framed_axes, image_width, show_buffer, view_extent
from softreach.plot.projection import View, project
from softreach.plot.style import figure_style
from softreach.plot.zbuffer import ZBuffer

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

__all__ = ["plot_cloud", "point_size", "tips_in_lengths"]

_LARGEST = 8.0  # pixels


def plot_cloud(
    cloud: xr.Dataset,
    ax: Axes | None = None,
    *,
    view: View = "front",
    color: str | int | ArrayLike = "rgb",
    size: float | None = None,
    key: bool = True,
    box: NDArray[np.float64] | None = None,
) -> Axes:
    """Draw a cloud in one view; the nearest point shows in each pixel.

    Args:
        cloud: tip(sample, axis) [m] with attribute `length` [m], activation(sample, fiber) [-].
        ax: Axes to draw in; None for a new figure.
        view: "front", "back", "right", "left", "top", or azimuth and elevation of the eye [rad].
        color: "rgb", the name or index of a bundle, or an array; see `color_samples`.
        size: Diameter of a point [pixels at 250 per inch]; None chooses by their number.
        key: Whether to explain the colors.
        box: What to show, lower and upper corner [L], shape (2, 3); None for all points.

    Returns:
        The axes, in units of L.

    Raises:
        InvalidInput: Unknown view, bundle or color, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    with figure_style(ax):
        tips = tips_in_lengths(cloud)
        box = bounding_box(tips) if box is None else box
        ax = framed_axes(box, view) if ax is None else ax
        coloring = color_samples(cloud, color)
        extent = view_extent(box, view)
        width = image_width(ax, extent)
        scale = width / (extent.right - extent.left)
        pixels = size or min(_LARGEST, point_size(len(tips), box) * scale)
        # small points gain nothing from smoothing; fine steps of color drown in their noise
        buffer = ZBuffer(extent, width, oversample=1 if pixels < 3.5 else 2, color_step=8)
        buffer.draw_points(project(tips, view), coloring.rgb, pixels)
        show_buffer(ax, buffer, box, view, "/ L")
        if key:
            draw_key(ax, coloring.key)
    return ax


def tips_in_lengths(cloud: xr.Dataset) -> NDArray[np.float64]:
    """Tip positions [L], shape (sample, 3)."""
    tip = cloud["tip"].transpose("sample", "axis")
    return tip.values / float(tip.attrs.get("length", 1.0))


def point_size(samples: int, box: NDArray[np.float64]) -> float:
    """A diameter that closes the surface of a cloud without blurring it, in units of the box."""
    spacing = np.ptp(box, axis=0).max() / np.cbrt(max(samples, 1))
    return 0.45 * float(spacing)
