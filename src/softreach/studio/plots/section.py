"""Section of the reachable set: its boundary in a plane, and how many activations reach each place.

They are counted as the inverse finds them: the grid of the exact set counts as well, but not near
its folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.geometry.surface import plane_cut
from softreach.picture.projection import View, is_mirrored, plane_of
from softreach.plot.sets import plot_slice
from softreach.studio.multiplicity import counts_at
from softreach.studio.reach import Reach
from softreach.studio.state import Slice, solvable_rod
from softreach.studio.work import StaleCheck, all_cores
from softreach.support.errors import InvalidInput
from softreach.workspace import ReachableSolid, ReachableSurface

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


Array = NDArray[np.float64]

_VIEWS: dict[str, View] = {"x": "side", "y": "front", "z": "top"}
_BOUNDARY = "#16324f"
_SIZE = 4.3, 4.6  # [inch], about as wide as a panel
_PAPER, _INK = "#242424", "#c9c9c9"  # of a dark page
_DPI = 200  # sharp where a page has two pixels per point
_CELLS, _CELLS_LOADED = 120, 40  # along the longer side: under loads each place costs much


def within(curves: Sequence[Array], points: Array, axis: int) -> NDArray[np.bool_]:
    """Mask of points in a plane across an axis that an odd number of closed curves surround."""
    from matplotlib.path import Path

    flat = np.delete(points, axis, axis=1)
    inside = np.zeros(len(points), bool)
    for curve in curves:
        inside ^= Path(np.delete(curve, axis, axis=1)).contains_points(flat)
    return inside


def plane_counts(
    reach: Reach, curves: Sequence[Array], axis: int, check: StaleCheck = lambda: None
) -> xr.Dataset:
    """Cells of a plane, as `ReachableSolid.grid` has them: `count`, or `occupied`.

    Args:
        reach: Of a design with a solid.
        curves: Where its boundary meets the plane [L], closed, at least one.
        axis: Across the plane.
        check: Called between blocks of targets; raises to stop.
    """
    import xarray as xr

    around, length = np.concatenate(curves), reach.arm.length
    low, high = around.min(axis=0), around.max(axis=0)
    loaded = reach.arm.loads is not None
    cell = float((high - low).max()) / (_CELLS_LOADED if loaded else _CELLS)
    middles = [np.arange(a + cell / 2, b + cell / 2, cell) for a, b in zip(low, high, strict=True)]
    middles[axis] = low[axis : axis + 1]
    places = np.stack(np.meshgrid(*middles, indexing="ij"), axis=-1)
    inside = within(curves, places.reshape(-1, 3), axis).reshape(places.shape[:3])
    name, values = "occupied", inside
    if solvable_rod(reach.arm).box.dimension == 3:
        name, values = "count", inside.astype(np.int64)
        values[inside] = counts_at(reach, places[inside] * length, check)
    coordinates = {
        each: (each, at * length, {"units": "m"}) for each, at in zip("xyz", middles, strict=True)
    }
    attrs = {"cell": cell * length, "length": length}
    return xr.Dataset({name: (tuple("xyz"), values)}, coordinates, attrs)


def section_curves(reach: Reach, cut: Slice) -> list[Array]:
    """The boundary of the reachable set in the plane [L], as curves of shape (n, 3).

    Raises:
        InvalidInput: There is no exact set with a surface.
    """
    if not isinstance(reach.exact, ReachableSolid | ReachableSurface):
        raise InvalidInput("section", reach.refusal or "no volume", "a set with a surface to cut")
    surface, length = reach.exact.surface(), reach.arm.length
    plane = _plane(cut, reach)
    curves = plane_cut(surface, "xyz".index(plane.axis), plane.center * length)
    return [curve / length for curve in curves]


def section_picture(
    reach: Reach, cut: Slice, check: StaleCheck = lambda: None, *, dark: bool = False
) -> Picture:
    """Draw the section, in the unit of the arm; without a slice that across y through the base.

    Args:
        reach: Of the design.
        cut: The slice, of which the middle plane is cut.
        check: Called all the time; raises to stop.
        dark: Whether the page is.

    Raises:
        InvalidInput: As `section_curves`.
    """
    plane = _plane(cut, reach)
    axis = "xyz".index(plane.axis)
    with all_cores:
        curves = section_curves(reach, cut)
    closed = isinstance(reach.exact, ReachableSolid) and bool(curves)
    grid = plane_counts(reach, curves, axis, check) if closed else None
    from matplotlib.figure import Figure  # away from pyplot, which belongs to one thread

    figure = Figure(figsize=_SIZE, dpi=_DPI, layout="constrained")
    ax = figure.subplots()
    view = _VIEWS[plane.axis]
    if grid is not None:
        at, unit = plane.center * reach.arm.length, reach.arm.length_unit
        plot_slice(grid, ax=ax, view=view, at=at, unit=unit)
    _draw_boundary(ax, curves, view, reach.arm)
    center = plane.center * reach.arm.length
    where = f"{plane.axis} = {reach.arm.length_unit.rounded(center, digits='.3g')}"
    ax.set_title(f"section {where}")
    described = _described(curves, plane, where, reach.arm)
    return Picture(reach.arm, pixels(figure, dark=dark), described)


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


def _plane(cut: Slice, reach: Reach) -> Slice:
    """The plane of a slice; without one that across y through the base."""
    base = reach.arm.base.position[1] / reach.arm.length
    return Slice(axis="y", center=base) if cut.axis == "none" else cut


def _draw_boundary(ax: Axes, curves: list[Array], view: View, arm: Manipulator) -> None:
    across, up = ("xyz".index(name) for name in cast(str, plane_of(view)))
    unit = arm.length_unit
    curves = [unit.of(curve * arm.length) for curve in curves]
    for curve in curves:
        ax.plot(curve[:, across], curve[:, up], color=_BOUNDARY, lw=1.4, zorder=4)
    ax.set(xlabel=unit.label("xyz"[across]), ylabel=unit.label("xyz"[up]), aspect="equal")
    if curves:
        points = np.concatenate(curves)
        low, high = points.min(axis=0), points.max(axis=0)
        room = 0.06 * max(high - low)
        left, right = low[across] - room, high[across] + room
        ax.set_xlim(*((right, left) if is_mirrored(view) else (left, right)))
        ax.set_ylim(low[up] - room, high[up] + room)


def _described(curves: list[Array], plane: Slice, where: str, arm: Manipulator) -> str:
    if not curves:
        return f"Nothing is reached at {where}."
    area = enclosed_area(curves, "xyz".index(plane.axis))
    parts = "one closed curve" if len(curves) == 1 else f"{len(curves)} closed curves"
    closed = all(np.array_equal(curve[0], curve[-1]) for curve in curves)
    shown = arm.length_unit.rounded(area * arm.length**2, 2)
    return f"{where}: {parts}, {shown}" if closed else f"{where}: {len(curves)} curves"


class Picture(NamedTuple):
    """Picture of a design."""

    arm: Manipulator
    image: NDArray[np.uint8]
    """RGB, shape (rows, columns, 3)."""
    text: str = ""
    """Its content in words."""


def pixels(figure: Figure, *, dark: bool = False) -> NDArray[np.uint8]:
    """The figure as RGB; for a dark page its paper is dark, and what is written and drawn light."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    if dark:
        _darken(figure)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    image = np.asarray(canvas.buffer_rgba())[..., :3].copy()
    if dark:
        white = (image == 255).all(axis=-1)  # of pictures within the figure
        image[white] = list(bytes.fromhex(_PAPER[1:]))
    return image


def _darken(figure: Figure) -> None:
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D
    from matplotlib.spines import Spine
    from matplotlib.text import Text

    figure.set_facecolor(_PAPER)
    for ax in figure.axes:
        ax.set_facecolor(_PAPER)
        ax.tick_params(which="both", colors=_INK)
    for legend in figure.findobj(Legend):
        legend.get_frame().set(facecolor=_PAPER, edgecolor=_INK)
    for spine in figure.findobj(Spine):
        spine.set_edgecolor(_INK)
    for kind in (Text, Line2D):
        for artist in figure.findobj(kind):
            artist.set_color(_INK)
