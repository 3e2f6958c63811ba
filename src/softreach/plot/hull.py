"""The picture of a hull: its boundary as a lit surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

from numpy.typing import ArrayLike

from softreach.arguments import checked, optional
from softreach.arrays import as_floats
from softreach.errors import InvalidInput
from softreach.geometry.surface import SurfaceMesh
from softreach.palette import STEEL
from softreach.picture.projection import View
from softreach.picture.shading import draw_mesh
from softreach.plot.arguments import DRAWN, LENGTH, a_surface
from softreach.plot.frame import Panel
from softreach.plot.lengths import in_lengths
from softreach.plot.style import figure_style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_hull"]


def _rgb(name: str, value: object) -> tuple[float, float, float]:
    """Three shares of red, green and blue."""
    found = as_floats(name, value)
    if found.shape != (3,) or not ((found >= 0) & (found <= 1)).all():
        raise InvalidInput(name, found, "three numbers from 0 to 1: red, green, blue")
    return float(found[0]), float(found[1]), float(found[2])


@checked(**DRAWN, hull=a_surface, length=optional(LENGTH), color=_rgb)
def plot_hull(
    hull: SurfaceMesh,
    *,
    ax: Axes | None = None,
    view: View = "front",
    length: float | None = None,
    color: tuple[float, float, float] = STEEL,
    box: ArrayLike | None = None,
) -> Axes:
    """Draw the boundary of a hull in one view.

    Args:
        hull: A hull, the surface of a reachable set, or anything with vertices [m] and faces.
        ax: Axes to draw in; None for a new figure.
        view: As in `plot_cloud`.
        length: L [m], by which coordinates are divided; None leaves them in meters.
        color: RGB from 0 to 1.
        box: What to show, lower and upper corner [m], shape (2, 3); None for all of it.

    Returns:
        The axes, in L if `length` is given, else in meters.

    Raises:
        InvalidInput: Unknown view, or no vertices.
        MissingExtra: matplotlib is not installed.
    """
    with figure_style(ax):
        unit = in_lengths(length)
        vertices = unit.of(hull.vertices)
        panel = Panel.opened(vertices, unit, ax, view, box)
        buffer = panel.buffer(oversample=3)
        draw_mesh(buffer, vertices, hull.faces, color, view)
        panel.show(buffer)
    return panel.ax
