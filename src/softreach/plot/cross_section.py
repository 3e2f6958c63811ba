"""The picture of a cross-section: its ring, and the sector that each bundle fills."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from softreach.errors import InvalidInput
from softreach.palette import BODY, bundle_color
from softreach.plot.lengths import in_lengths
from softreach.plot.style import figure_style, small_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softreach.arm.manipulator import Manipulator

__all__ = ["plot_cross_section"]


def plot_cross_section(
    arm: Manipulator,
    z: float = 0.0,
    *,
    ax: Axes | None = None,
    bundles: Collection[int] | None = None,
    half_width: float | None = None,
) -> Axes:
    """Draw where the bundles lie in the cross-section at Z, seen from the tip (figure 1c).

    Args:
        arm: The design, at rest.
        z: Station Z [m].
        ax: Axes to draw in; None for a new figure.
        bundles: Which to draw, by index; None for all.
        half_width: Of what is shown [m], to draw several sections at one scale; None for this
            section.

    Returns:
        The axes, in L.

    Raises:
        InvalidInput: A station off the arm.
        MissingExtra: matplotlib is not installed.
    """
    if not 0 <= z <= arm.length:
        raise InvalidInput("z", z, f"within [0, {arm.length:g}] m")
    unit = in_lengths(arm.length)
    outer, outline = float(unit.of(arm.profile.radius(z))), arm.outline(z)
    with figure_style(ax):
        ax = small_axes(2.0, 2.0) if ax is None else ax
        _draw_ring(ax, outer, float(outline.inner_ratio.min()))
        angles, extents = np.degrees(outline.center[0]), np.degrees(outline.extent)
        for k in range(arm.bundles) if bundles is None else bundles:
            _draw_sector(ax, outer, float(outline.inner_ratio[k]), angles[k], extents[k], k)
        half = 1.08 * outer if half_width is None else float(unit.of(half_width))
        ax.set(aspect="equal", xlim=(-half, half), ylim=(-half, half))
        ax.set(xlabel=unit.label("x"), ylabel=unit.label("y"))
        ax.locator_params(nbins=3)
    return ax


def _draw_ring(ax: Axes, outer: float, ratio: float) -> None:
    from matplotlib.patches import Annulus, Circle

    ax.add_patch(Circle((0, 0), outer, facecolor="0.97", edgecolor="0.4", linewidth=0.6))
    ring = {"facecolor": BODY, "edgecolor": "0.4", "linewidth": 0.4}
    ax.add_patch(Annulus((0, 0), outer, outer * (1 - ratio), **ring))


def _draw_sector(
    ax: Axes, outer: float, ratio: float, angle: float, extent: float, bundle: int
) -> None:
    """A bundle from angle - extent/2 to angle + extent/2 [degrees]."""
    from matplotlib.patches import Wedge

    ends = angle - extent / 2, angle + extent / 2
    width = outer * (1 - ratio)
    ax.add_patch(Wedge((0, 0), outer, *ends, width=width, color=bundle_color(bundle), linewidth=0))
