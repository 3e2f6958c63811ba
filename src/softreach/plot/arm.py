"""The picture of an arm, at rest and deformed: a lit tube with its fibers in color."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.arm_shape import arm_surface, bundle_bands, rest_configuration
from softreach.geometry.tube import grid_faces
from softreach.palette import BODY, bundle_color
from softreach.plot.frame import bounding_box, framed_axes, image_width, show_buffer, view_extent
from softreach.plot.projection import View
from softreach.plot.shading import draw_mesh
from softreach.plot.style import figure_style
from softreach.plot.zbuffer import ZBuffer

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from softreach.arm.manipulator import Manipulator

__all__ = ["arm_points", "plot_arm", "shapes_of"]

Array = NDArray[np.float64]

_SIDES = 96
_FADE = 0.62  # how far the colors of the arm at rest go toward white


def plot_arm(
    arm: Manipulator,
    configuration: xr.Dataset | None = None,
    ax: Axes | None = None,
    *,
    view: View = "front",
    rest: bool = True,
    bundles: Collection[int] | None = None,
    box: Array | None = None,
) -> Axes:
    """Draw an arm; where both are shown, the arm at rest is pale and behind.

    Args:
        arm: The design.
        configuration: One configuration of that arm or several along `sample`; None for the arm at
            rest alone.
        ax: Axes to draw in; None for a new figure.
        view: A named view, or azimuth and elevation of the eye [rad].
        rest: Whether to draw the arm at rest beside its configurations.
        bundles: Which to draw, by index; None for all.
        box: What to show, lower and upper corner [L], shape (2, 3).

    Returns:
        The axes, in units of L.

    Raises:
        InvalidInput: Unknown view.
        MissingExtra: matplotlib is not installed.
    """
    shapes = shapes_of(configuration)
    resting = [rest_configuration(arm)] if rest or not shapes else []
    with figure_style(ax):
        box = bounding_box(*(arm_points(arm, s) for s in shapes + resting)) if box is None else box
        ax = framed_axes(box, view) if ax is None else ax
        drawn = range(arm.bundles) if bundles is None else bundles
        _show(ax, arm, resting, view, box, drawn, _FADE if shapes else 0.0)
        _show(ax, arm, shapes, view, box, drawn)
    return ax


def shapes_of(configuration: xr.Dataset | None) -> list[xr.Dataset]:
    """The single configurations of a dataset that may hold several."""
    if configuration is None:
        return []
    if "sample" not in configuration.dims:
        return [configuration]
    return [configuration.isel(sample=k) for k in range(configuration.sizes["sample"])]


def arm_points(arm: Manipulator, shape: xr.Dataset) -> Array:
    """Points of the surface of one configuration [L], shape (n, 3)."""
    return arm_surface(shape, _SIDES).vertices / arm.length


def _show(
    ax: Axes,
    arm: Manipulator,
    shapes: list[xr.Dataset],
    view: View,
    box: Array,
    bundles: Collection[int],
    fade: float = 0.0,
) -> None:
    """One image of all shapes, over what the axes hold."""
    if shapes:
        extent = view_extent(box, view)
        buffer = ZBuffer(extent, image_width(ax, extent), oversample=3)
        for shape in shapes:
            _draw(buffer, arm, shape, view, bundles, fade)
        show_buffer(ax, buffer, box, view, "/ L")


def _draw(
    buffer: ZBuffer,
    arm: Manipulator,
    shape: xr.Dataset,
    view: View,
    bundles: Collection[int],
    fade: float,
) -> None:
    body = arm_surface(shape, _SIDES)
    caps = 2 * _SIDES  # the last faces; apart, so that light breaks at the rim
    for part in (body.faces[:-caps], body.faces[-caps:]):
        draw_mesh(buffer, body.vertices / arm.length, part, BODY, view, fade)
    bands = bundle_bands(arm, shape, lift=0.008)
    for index in bundles:
        band = bands[index]
        skin = grid_faces(*band.shape[:2])
        draw_mesh(buffer, band.reshape(-1, 3) / arm.length, skin, bundle_color(index), view, fade)
