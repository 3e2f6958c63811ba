"""Designs at rest side by side: the arm, and below it some of its cross-sections."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arguments import checked, each_of, instance, optional
from softreach.arm_shape import rest_configuration
from softreach.arrays import as_stations
from softreach.errors import InvalidInput
from softreach.picture.projection import View
from softreach.plot.arguments import WIDTH
from softreach.plot.arm import arm_points, plot_arm
from softreach.plot.cross_section import plot_cross_section, section_reach
from softreach.plot.frame import bounding_box
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from softreach.arm.manipulator import Manipulator

__all__ = ["DesignPanel", "plot_designs"]


class DesignPanel(NamedTuple):
    """One arm in a row of arms."""

    title: str
    arm: Manipulator
    view: View = "front"
    bundles: Collection[int] | None = None
    """Which to draw, by index; None for all."""


def _panels(name: str, value: object) -> list[DesignPanel]:
    """One panel or more."""
    panels = each_of(instance(DesignPanel, "a DesignPanel"))(name, value)
    if panels:
        return panels
    raise InvalidInput(name, "none", "at least one DesignPanel")


@checked(panels=_panels, stations_over_length=as_stations, width=optional(WIDTH))
def plot_designs(
    panels: Sequence[DesignPanel],
    *,
    stations_over_length: Sequence[float] = (0.0,),
    width: float | None = None,
) -> Figure:
    """Draw arms at rest, and under each its cross-sections, all at one scale (figures 1b-d, 4a).

    Args:
        panels: The arms, from left to right.
        stations_over_length: Z / L of the cross-sections [-], from 0 to 1; none for the arms alone.
        width: Of the figure [inch]; None for 1.5 a panel.

    Raises:
        InvalidInput: A station off an arm, or an unknown view.
        MissingExtra: matplotlib is not installed.
    """
    box = bounding_box(*(arm_points(p.arm, rest_configuration(p.arm)) for p in panels))
    reach = 1.08 * max(
        section_reach(p.arm, s * p.arm.length) / p.arm.length
        for p in panels
        for s in (*stations_over_length, 0.0)
    )
    width = 1.5 * len(panels) if width is None else width
    rows = 1 + len(stations_over_length)
    with figure_style():
        heights = [2.6, *[width / len(panels)] * len(stations_over_length)]
        shape = {"height_ratios": heights, "layout": "constrained", "squeeze": False}
        figure, axes = pyplot().subplots(
            rows, len(panels), figsize=(width, sum(heights) + 0.1), **shape
        )
        for k, panel in enumerate(panels):
            arm, length = panel.arm, panel.arm.length
            drawn, shown = panel.bundles, length * box
            plot_arm(arm, ax=axes[0, k], view=panel.view, bundles=drawn, box=shown)
            axes[0, k].set_title(panel.title)
            for ax, station in zip(axes[1:, k], stations_over_length, strict=True):
                z, half = station * length, reach * length
                plot_cross_section(arm, z, ax=ax, bundles=drawn, half_width=half, legend=False)
                ax.set_title(f"Z = {station:.2g} L" if station else "Z = 0")
        for ax in np.ravel(axes[:, 1:]):
            ax.set(ylabel="", yticklabels=[])
    return figure
