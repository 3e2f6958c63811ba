"""The reachable set in the plane of the slice: its boundary, and how many activations reach it."""

from __future__ import annotations

from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from softreach.geometry.surface import plane_cut
from softreach.picture.projection import View, is_mirrored, plane_of
from softreach.plot.slice import plot_slice
from softreach.studio.plots.image import Picture, blank_figure, pixels
from softreach.studio.plots.plane_counts import plane_counts
from softreach.studio.reach import Reach
from softreach.studio.state import Slice
from softreach.studio.work import StaleCheck, all_cores
from softreach.support.errors import InvalidInput
from softreach.workspace import ReachableSolid, ReachableSurface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["enclosed_area", "section_curves", "section_picture"]

Array = NDArray[np.float64]

_VIEWS: dict[str, View] = {"x": "side", "y": "front", "z": "top"}
_BOUNDARY = "#16324f"


def section_curves(reach: Reach, cut: Slice) -> list[Array]:
    """The boundary of the reachable set in the plane [L], as curves of shape (n, 3).

    Raises:
        InvalidInput: There is no exact set with a surface.
    """
    if not isinstance(reach.exact, ReachableSolid | ReachableSurface):
        raise InvalidInput("section", reach.refusal or "no volume", "a set with a surface to cut")
    surface, length = reach.exact.surface(), reach.arm.length
    curves = plane_cut(surface, "xyz".index(_plane(cut).axis), _plane(cut).center * length)
    return [curve / length for curve in curves]


def section_picture(
    reach: Reach, cut: Slice, check: StaleCheck = lambda: None, *, dark: bool = False
) -> Picture:
    """Draw the section, in L; without a slice that of the plane y = 0.

    Args:
        reach: Of the design.
        cut: The slice, of which the middle plane is cut.
        check: Called all the time; raises to stop.
        dark: Whether the page is.

    Raises:
        InvalidInput: As `section_curves`.
    """
    plane = _plane(cut)
    axis = "xyz".index(plane.axis)
    with all_cores:
        curves = section_curves(reach, cut)
    closed = isinstance(reach.exact, ReachableSolid) and bool(curves)
    grid = plane_counts(reach, curves, axis, check) if closed else None
    figure = blank_figure(4.6)
    ax = figure.subplots()
    view = _VIEWS[plane.axis]
    if grid is not None:
        plot_slice(grid, ax=ax, view=view, at=plane.center * reach.arm.length)
    _draw_boundary(ax, curves, view)
    where = f"{plane.axis} = {plane.center:.3g} L"
    ax.set_title(f"section {where}")
    return Picture(reach.arm, pixels(figure, dark=dark), _described(curves, plane, where))


def enclosed_area(curves: list[Array], axis: int) -> float:
    """Area within closed curves in a plane across an axis, holes left out.

    Curves of a closed surface wind around what is inside all in one sense and around holes in the
    other, up to where each begins: whether one is a hole is found from how many surround it.
    """
    from matplotlib.path import Path

    flat = [np.delete(curve, axis, axis=1) for curve in curves]
    total = 0.0
    for k, curve in enumerate(flat):
        others = (Path(other) for j, other in enumerate(flat) if j != k)
        around = sum(other.contains_point(curve[0]) for other in others)
        total += (-1.0 if around % 2 else 1.0) * abs(_shoelace(curve))
    return total


def _shoelace(curve: Array) -> float:
    x, y = curve.T
    return float(x[:-1] @ y[1:] - x[1:] @ y[:-1]) / 2


def _plane(cut: Slice) -> Slice:
    return Slice(axis="y", center=0.0) if cut.axis == "none" else cut


def _draw_boundary(ax: Axes, curves: list[Array], view: View) -> None:
    across, up = ("xyz".index(name) for name in cast(str, plane_of(view)))
    for curve in curves:
        ax.plot(curve[:, across], curve[:, up], color=_BOUNDARY, lw=1.4, zorder=4)
    ax.set(xlabel=f"{'xyz'[across]} / L", ylabel=f"{'xyz'[up]} / L", aspect="equal")
    if curves:
        points = np.concatenate(curves)
        low, high = points.min(axis=0), points.max(axis=0)
        room = 0.06 * max(high - low)
        left, right = low[across] - room, high[across] + room
        ax.set_xlim(*((right, left) if is_mirrored(view) else (left, right)))
        ax.set_ylim(low[up] - room, high[up] + room)


def _described(curves: list[Array], plane: Slice, where: str) -> str:
    if not curves:
        return f"Nothing is reached at {where}."
    area = enclosed_area(curves, "xyz".index(plane.axis))
    parts = "one closed curve" if len(curves) == 1 else f"{len(curves)} closed curves"
    closed = all(np.array_equal(curve[0], curve[-1]) for curve in curves)
    return f"{where}: {parts}, {area:.4f} L²" if closed else f"{where}: {len(curves)} curves"
