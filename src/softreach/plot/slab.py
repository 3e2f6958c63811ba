"""The tips of a cloud near a plane, so that what lies inside can be seen."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arguments import checked, flag, optional
from softreach.errors import InvalidInput
from softreach.picture.projection import View, sight_axis
from softreach.plot.arguments import DRAWN, LENGTH, PLACE, POINTS, SIZE
from softreach.plot.cloud import drawn_tips, plot_cloud
from softreach.plot.coloring import color_samples, draw_key
from softreach.plot.frame import Panel
from softreach.plot.lengths import LengthUnit, unit_of
from softreach.plot.style import figure_style, write_note

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes

__all__ = ["plot_slab"]

_THICKNESS = 1 / 50  # of L, or of the cloud's extent


@checked(**DRAWN, cloud=POINTS, at=PLACE, thickness=optional(LENGTH), size=SIZE, key=flag)
def plot_slab(
    cloud: xr.Dataset,
    *,
    ax: Axes | None = None,
    view: View = "front",
    at: float = 0.0,
    thickness: float | None = None,
    color: str | int | ArrayLike = "rgb",
    size: float | None = None,
    key: bool = True,
    box: ArrayLike | None = None,
) -> Axes:
    """Draw the tips in a slab across the line of sight; a note in the axes says which.

    What is not described here is as in `plot_cloud`.

    Args:
        cloud: As in `plot_cloud`.
        ax: As in `plot_cloud`.
        view: A view along an axis: "front" for a slab in y, "side" in x, "top" in z.
        at: Where the middle of the slab is on that axis [m].
        thickness: Of the whole slab [m]; None for a fiftieth of L, or where the cloud does not know
            L, of its largest extent.
        color: As in `plot_cloud`, for all samples of the cloud.
        size: As in `plot_cloud`.
        key: As in `plot_cloud`.
        box: As in `plot_cloud`.

    Returns:
        The axes, in L if the cloud knows it, else in meters.

    Raises:
        InvalidInput: Not a view along an axis, unknown color, or no tip in the slab.
        MissingExtra: matplotlib is not installed.
    """
    tips, unit, axis = drawn_tips(cloud), unit_of(cloud["tip"]), sight_axis(view)
    middle, half = float(unit.of(at)), _half(thickness, tips, unit)
    depth = tips[:, "xyz".index(axis)] - middle
    inside = np.abs(depth) <= half
    if not inside.any():
        allowed = f"such that a tip lies in the slab about {axis} = {at:.4g} m"
        raise InvalidInput("thickness", f"{2 * half * unit.size:.4g} m", allowed)
    coloring = color_samples(cloud, color)
    with figure_style(ax):
        panel = Panel.opened(tips, unit, ax, view, box)
        slab, rgb = cloud.isel(sample=np.flatnonzero(inside)), coloring.rgb[inside] / 255
        pixels = size or _point_size(len(rgb), panel)
        shown = {"box": panel.box * unit.size, "key": False}
        plot_cloud(slab, ax=panel.ax, view=view, color=rgb, size=pixels, **shown)
        write_note(panel.ax, _place(axis, middle, half, unit), 0.03, 0.02)
        if key:
            draw_key(panel.ax, coloring.key)
    return panel.ax


def _half(thickness: float | None, tips: NDArray[np.float64], unit: LengthUnit) -> float:
    """Half the thickness in the units of the axes."""
    if thickness is not None:
        return float(unit.of(thickness)) / 2
    return _THICKNESS / 2 * (1.0 if unit.relative else float(np.nanmax(np.ptp(tips, axis=0))))


def _place(axis: str, middle: float, half: float, unit: LengthUnit) -> str:
    """Which slab it is, such as |x| ≤ 0.01 L."""
    distance = f"{axis} - {middle:.3g} {unit.symbol}" if middle else axis
    return f"|{distance}| ≤ {half:.3g} {unit.symbol}"


def _point_size(count: int, panel: Panel) -> float:
    """A diameter [pixels] that closes a slice: about the mean spacing in the plane."""
    extent = panel.extent
    area = (extent.right - extent.left) * (extent.top - extent.bottom)
    return float(np.clip(1.2 * np.sqrt(area / count) * panel.pixels_per_unit, 2.0, 8.0))
