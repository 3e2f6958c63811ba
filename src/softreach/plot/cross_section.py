"""The picture of a cross-section: its layers, and the place of each bundle in it."""

from __future__ import annotations

from collections.abc import Collection
from typing import TYPE_CHECKING

import numpy as np

from softreach.arguments import checked, flag, optional
from softreach.errors import InvalidInput
from softreach.plot.arguments import AX, LENGTH, MANIPULATOR, PLACE, some_bundles
from softreach.plot.lengths import in_lengths
from softreach.plot.section_bundles import draw_bundles, placed_bundles
from softreach.plot.section_key import needs_section_key, section_key
from softreach.plot.section_layers import draw_layers
from softreach.plot.style import figure_style, small_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from softreach.arm.manipulator import Manipulator

__all__ = ["plot_cross_section", "section_reach"]

_SIZE = 2.0  # inches
_MARGIN = 1.08


@checked(arm=MANIPULATOR, z=PLACE, ax=AX, half_width=optional(LENGTH), legend=optional(flag))
def plot_cross_section(
    arm: Manipulator,
    z: float = 0.0,
    *,
    ax: Axes | None = None,
    bundles: Collection[int] | None = None,
    half_width: float | None = None,
    legend: bool | None = None,
) -> Axes:
    """Draw the cross-section at Z, seen from the tip (figure 1c): layers, and the bundles that act.

    Fibers and muscles fill a sector of their ring; strokes show radial and oblique ones. Where
    sectors overlap, the lower shows in stripes. Tendons are dots, dotted circles the disks that
    hold those outside of the arm; chambers are round. What does not act at Z is left out.

    Args:
        arm: The design, at rest.
        z: Station Z [m].
        ax: Axes to draw in; None for a new figure.
        bundles: Which to draw, by index; None for all.
        half_width: Of what is shown [m], to draw several sections at one scale; None for this
            section.
        legend: Whether to name materials and bundles beside it; None where there are several
            materials, or bundles other than fibers.

    Returns:
        The axes, in L.

    Raises:
        InvalidInput: A station off the arm.
        MissingExtra: matplotlib is not installed.
    """
    if not 0 <= z <= arm.length:
        raise InvalidInput("z", z, f"within [0, {arm.length:g}] m")
    unit = in_lengths(arm.length)
    outer = float(unit.of(arm.profile.radius(z)))
    placed = placed_bundles(
        arm, z, range(arm.bundles) if bundles is None else some_bundles("bundles", bundles, arm)
    )
    legend = needs_section_key(arm) if legend is None else legend
    with figure_style(ax):
        key = section_key(arm, placed) if legend else None
        ax = small_axes(_SIZE + (key.width if key else 0.0), _SIZE) if ax is None else ax
        draw_layers(ax, arm.section, outer)
        draw_bundles(ax, placed, outer)
        half = _MARGIN * section_reach(arm, z) if half_width is None else half_width
        half = float(unit.of(half))
        ax.set(aspect="equal", xlim=(-half, half), ylim=(-half, half))
        ax.set(xlabel=unit.label("x"), ylabel=unit.label("y"))
        ax.locator_params(nbins=3)
        if key:
            key.draw(ax)
    return ax


def section_reach(arm: Manipulator, z: float) -> float:
    """Distance from the axis of the surface at Z, or of what lies farther outside [m]."""
    outline = arm.outline(z)
    widest = np.max(outline.outer_ratio[outline.acts], initial=1.0)
    return float(arm.profile.radius(z)) * float(widest)
