"""The picture of an arm, at rest and deformed: a lit tube with its fibers in color."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm_shape import arm_surface, bundle_bands, rest_configuration
from softreach.geometry.tube import grid_faces
from softreach.palette import BODY, bundle_color
from softreach.picture.projection import View
from softreach.picture.shading import draw_mesh
from softreach.picture.zbuffer import ZBuffer
from softreach.plot.frame import Panel
from softreach.plot.lengths import in_lengths
from softreach.plot.style import figure_style

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
    *,
    ax: Axes | None = None,
    view: View = "front",
    rest: bool = True,
    bundles: Collection[int] | None = None,
    box: ArrayLike | None = None,
) -> Axes:
    """Draw an arm; where both are shown, the arm at rest is pale and behind.

    Args:
        arm: The design.
        configuration: One configuration of that arm or several along `sample`; None for the arm at
            rest alone.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        rest: Whether to draw the arm at rest beside its configurations.
        bundles: Which to draw, by index; None for all.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all that is drawn.

    Returns:
        The axes, in L.

    Raises:
        InvalidInput: Unknown view.
        MissingExtra: matplotlib is not installed.
    """
    shapes = shapes_of(configuration)
    resting = [rest_configuration(arm)] if rest or not shapes else []
    with figure_style(ax):
        points = np.concatenate([arm_points(arm, shape) for shape in shapes + resting])
        panel = Panel.opened(points, in_lengths(arm.length), ax, view, box)
        drawn = range(arm.bundles) if bundles is None else bundles
        _show(panel, arm, resting, drawn, _FADE if shapes else 0.0)
        _show(panel, arm, shapes, drawn)
    return panel.ax


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
    panel: Panel,
    arm: Manipulator,
    shapes: list[xr.Dataset],
    bundles: Collection[int],
    fade: float = 0.0,
) -> None:
    """One image of all shapes, over what the axes hold."""
    if shapes:
        buffer = panel.buffer(oversample=3)
        for shape in shapes:
            _draw(buffer, arm, shape, panel.view, bundles, fade)
        panel.show(buffer)


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
