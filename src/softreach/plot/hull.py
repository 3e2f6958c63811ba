"""The picture of a hull: its boundary as a lit surface."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.plot.frame import bounding_box, framed_axes, image_width, show_buffer, view_extent
from softreach.plot.projection import View
from softreach.plot.shading import draw_mesh
from softreach.plot.style import figure_style
from softreach.plot.zbuffer import ZBuffer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["SurfaceMesh", "plot_hull"]

_STEEL = (0.55, 0.68, 0.82)


class SurfaceMesh(Protocol):
    """Anything with vertices [m] and triangles."""

    @property
    def vertices(self) -> ArrayLike:
        """Shape (v, 3)."""
        ...

    @property
    def faces(self) -> ArrayLike:
        """Shape (f, 3)."""
        ...


def plot_hull(
    hull: SurfaceMesh,
    ax: Axes | None = None,
    *,
    view: View = "front",
    length: float | None = None,
    color: tuple[float, float, float] = _STEEL,
    box: NDArray[np.float64] | None = None,
) -> Axes:
    """Draw the boundary of a hull in one view.

    Args:
        hull: Vertices [m] and faces.
        ax: Axes to draw in; None for a new figure.
        view: A named view, or azimuth and elevation of the eye [rad].
        length: L [m], to count coordinates in L; None counts them in meters.
        color: RGB from 0 to 1.
        box: What to show, lower and upper corner in units of the axes, shape (2, 3).

    Returns:
        The axes.

    Raises:
        InvalidInput: Unknown view, or no vertices.
        MissingExtra: matplotlib is not installed.
    """
    with figure_style(ax):
        vertices = np.asarray(hull.vertices, float) / (length or 1.0)
        box = bounding_box(vertices) if box is None else box
        ax = framed_axes(box, view) if ax is None else ax
        extent = view_extent(box, view)
        buffer = ZBuffer(extent, image_width(ax, extent), oversample=3)
        draw_mesh(buffer, vertices, hull.faces, color, view)
        show_buffer(ax, buffer, box, view, "/ L" if length else "[m]")
    return ax
