"""The picture of an arm, at rest and deformed: a lit tube with its fibers in color."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arguments import checked, flag, optional
from softreach.arm.skin import inside
from softreach.arm_shape import arm_surface, bundle_skins, rest_configuration
from softreach.palette import BODY, bundle_color
from softreach.picture.projection import View
from softreach.picture.see_through import faces_to_eye
from softreach.picture.shading import draw_mesh
from softreach.picture.zbuffer import ZBuffer
from softreach.plot.arguments import DRAWN, MANIPULATOR, SHAPE, some_bundles
from softreach.plot.frame import Panel
from softreach.plot.lengths import in_lengths
from softreach.plot.style import figure_style

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

    from softreach.arm.manipulator import Manipulator

__all__ = ["arm_images", "arm_points", "draw_arms", "plot_arm", "shapes_of"]

Array = NDArray[np.float64]

_SIDES = 96
_BULGE = 1.01  # of R2, beyond which a bundle makes the picture wider
_FADE = 0.62  # how far the colors of the arm at rest go toward white


@checked(**DRAWN, arm=MANIPULATOR, configuration=optional(SHAPE), rest=flag)
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
        drawn = range(arm.bundles) if bundles is None else some_bundles("bundles", bundles, arm)
        draw_arms(panel, arm, resting, drawn, _FADE if shapes else 0.0)
        draw_arms(panel, arm, shapes, drawn)
    return panel.ax


def shapes_of(configuration: xr.Dataset | None) -> list[xr.Dataset]:
    """The single configurations of a dataset that may hold several."""
    if configuration is None:
        return []
    if "sample" not in configuration.dims:
        return [configuration]
    return [configuration.isel(sample=k) for k in range(configuration.sizes["sample"])]


def arm_points(arm: Manipulator, shape: xr.Dataset) -> Array:
    """Points of one configuration [L]: its surface, and bundles outside of it; shape (n, 3)."""
    outline = arm.outline(shape["Z"].values)
    out = (outline.outer_ratio > _BULGE) & outline.acts
    surfaces = [arm_surface(arm, shape, _SIDES)]
    if out.any():
        skins = bundle_skins(arm, shape)
        surfaces += [skin for k, skin in enumerate(skins) if out[:, k].any()]
    return np.concatenate([surface.vertices for surface in surfaces]) / arm.length


def draw_arms(
    panel: Panel,
    arm: Manipulator,
    shapes: list[xr.Dataset],
    bundles: Collection[int],
    fade: float = 0.0,
) -> None:
    """One image of all shapes, over what the axes hold."""
    if shapes:
        panel.show(*arm_images(panel, arm, shapes, bundles, fade))


def arm_images(
    panel: Panel,
    arm: Manipulator,
    shapes: list[xr.Dataset],
    bundles: Collection[int],
    fade: float = 0.0,
) -> tuple[ZBuffer, ZBuffer | None]:
    """All shapes in a panel, and what shows through them; None for nothing."""
    buffer, within = panel.buffer(oversample=3), panel.buffer(oversample=3)
    hidden = inside(arm)
    clear = any(hidden[index] for index in bundles)
    for shape in shapes:
        _draw_body(buffer, arm, shape, panel.view, fade)
        skins = bundle_skins(arm, shape, lift=0.008)
        for index in bundles:
            color, points, faces = bundle_color(index), skins[index].vertices, skins[index].faces
            draw_mesh(buffer, points / arm.length, faces, color, panel.view, fade)
            if clear:
                faces = faces_to_eye(points, faces, panel.view)
                draw_mesh(within, points / arm.length, faces, color, panel.view, fade)
    return buffer, within if clear else None


def _draw_body(
    buffer: ZBuffer, arm: Manipulator, shape: xr.Dataset, view: View, fade: float
) -> None:
    body = arm_surface(arm, shape, _SIDES)
    caps = 2 * _SIDES  # the last faces; apart, so that light breaks at the rim
    for part in (body.faces[:-caps], body.faces[-caps:]):
        draw_mesh(buffer, body.vertices / arm.length, part, BODY, view, fade)
