"""Some clouds of an atlas from two opposing sides."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from softreach.arguments import checked, mapping_of
from softreach.cloud import design_of
from softreach.errors import InvalidInput
from softreach.picture.projection import View, view_angles
from softreach.plot.arguments import BOX, POINTS, WIDTH, a_view
from softreach.plot.arm import plot_arm
from softreach.plot.cloud import drawn_tips, plot_cloud
from softreach.plot.coloring import bundle_names, color_samples, draw_figure_key
from softreach.plot.frame import bounding_box
from softreach.plot.style import figure_style, pyplot

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

__all__ = ["plot_opposite_sides"]


@checked(clouds=mapping_of(POINTS), view=a_view, box_over_length=BOX, width=WIDTH)
def plot_opposite_sides(
    clouds: Mapping[str, xr.Dataset],
    *,
    view: View = "oblique",
    box_over_length: ArrayLike | None = None,
    width: float = 6.9,
) -> Figure:
    """Clouds from two opposing sides, one column each, with their arms at rest (figure 2b).

    Args:
        clouds: Clouds by the title of their column; each says which arm it belongs to.
        view: Of the upper row, as in `plot_cloud`; the lower row is opposite.
        box_over_length: What each panel shows, lower and upper corner in L [-], shape (2, 3); None
            for all points.
        width: Of the figure [inch].

    Raises:
        InvalidInput: No clouds, clouds of different bundles, an unknown view, or no finite tip.
        MissingExtra: matplotlib is not installed.
    """
    bundles = {bundle_names(cloud) for cloud in clouds.values()}
    if len(bundles) != 1:
        raise InvalidInput("clouds", f"of bundles {sorted(bundles)}", "one or more of one set")
    azimuth, elevation = view_angles(view)
    sides = ((azimuth, elevation), (azimuth + np.pi, elevation))
    shown = np.asarray(_around(clouds) if box_over_length is None else box_over_length, float)
    with figure_style():
        column = width / len(clouds)
        figure = pyplot().figure(figsize=(width, 2 * column + 0.5))
        panels = figure.subplots(2, len(clouds), squeeze=False)
        figure.subplots_adjust(0.085, 0.11, 0.965, 0.86, wspace=0.45, hspace=0.34)
        for k, (title, cloud) in enumerate(clouds.items()):
            arm = design_of(cloud)
            box = shown * arm.length
            panels[0, k].set_title(f"({k + 1})  {title}", pad=4)
            for ax, side in zip(panels[:, k], sides, strict=True):
                plot_cloud(cloud, ax=ax, view=side, key=False, box=box)
                plot_arm(arm, ax=ax, view=side, box=box)
        draw_figure_key(figure, color_samples(next(iter(clouds.values()))).key, 0.09)
    return figure


def _around(clouds: Mapping[str, xr.Dataset]) -> ArrayLike:
    return bounding_box(*(drawn_tips(cloud) for cloud in clouds.values()))
