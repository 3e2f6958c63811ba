"""The axes around an image: labeled coordinates of a named view, or a box in space for another."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.errors import InvalidInput
from softreach.plot.projection import View, plane_of, project, view_axes
from softreach.plot.space_box import draw_box
from softreach.plot.style import DPI, pyplot
from softreach.plot.zbuffer import Extent, ZBuffer

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["bounding_box", "framed_axes", "image_width", "show_buffer", "view_extent"]

Array = NDArray[np.float64]

_MARGIN = 0.04
_ROOM = np.array([2.8, 3.2])  # inches for the image
_AROUND = np.array([0.6, 0.7])  # inches for labels and key
_TICK_ROOM = 0.42  # inches between ticks at least


def bounding_box(*points: ArrayLike) -> Array:
    """Lower and upper corner around all finite points, with a margin, shape (2, 3).

    Raises:
        InvalidInput: No finite point to show.
    """
    corners = [corner for cloud in points for corner in _corners(np.asarray(cloud, float))]
    if not corners:
        raise InvalidInput("points", "none", "one finite point at least")
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    margin = _MARGIN * max((high - low).max(), 1e-9)
    return np.array([low - margin, high + margin])


def view_extent(box: Array, view: View) -> Extent:
    """The part of the projection plane that a box fills."""
    seen = project(box_corners(box), view)
    low, high = seen.min(axis=0), seen.max(axis=0)
    return Extent(low[0], high[0], low[1], high[1])


def box_corners(box: Array) -> Array:
    """The eight corners, shape (8, 3)."""
    return np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)


def framed_axes(box: Array, view: View) -> Axes:
    """Axes in a new figure of the shape of what they show, about a journal's column wide."""
    span = _span(view_extent(box, view))
    inches = span * (_ROOM / span).min() + _AROUND
    return pyplot().subplots(figsize=tuple(inches), layout="constrained")[1]


def image_width(ax: Axes, extent: Extent) -> int:
    """Columns of an image of that extent at print resolution in the axes."""
    return max(16, round(_inches(ax, extent)[0] * DPI))


def show_buffer(ax: Axes, buffer: ZBuffer, box: Array, view: View, unit: str) -> None:
    """Place the image in the axes and label them; what is there already stays in view.

    Args:
        ax: Where to.
        buffer: The finished image.
        box: What the view shows, shape (2, 3).
        view: The view of the image.
        unit: What coordinates are counted in: "/ L" or "[m]".
    """
    first, plane = not ax.images, plane_of(view)
    mirror = -1 if plane and view_axes(view)[0].sum() < 0 else 1
    left, right, bottom, top = buffer.extent
    extent = (mirror * left, mirror * right, bottom, top)
    # "none": vector files get the pixels as they are
    ax.imshow(buffer.rgba(), extent=extent, interpolation="none", zorder=2 + len(ax.images) / 100)
    _widen(ax, extent, first, mirror)
    if plane:
        ax.set(xlabel=f"{plane[0]} {unit}", ylabel=f"{plane[1]} {unit}")
        _set_ticks(ax, _inches(ax, buffer.extent))
    elif first:
        draw_box(ax, box, view, unit)


def _span(extent: Extent) -> Array:
    return np.array([extent.right - extent.left, extent.top - extent.bottom])


def _inches(ax: Axes, extent: Extent) -> Array:
    """Width and height of an extent on paper, as it fits into the axes."""
    figure = ax.get_figure(root=True)
    assert figure is not None
    room = np.array(ax.get_position().size) * figure.get_size_inches()
    span = _span(extent)
    return span * (room / span).min()


def _set_ticks(ax: Axes, inches: Array) -> None:
    from matplotlib.ticker import MaxNLocator

    for axis, length in zip((ax.xaxis, ax.yaxis), inches, strict=True):
        bins = int(np.clip(length / _TICK_ROOM, 1, 6))
        axis.set_major_locator(MaxNLocator(bins, steps=[1, 2, 5, 10], min_n_ticks=1))


def _corners(points: Array) -> list[Array]:
    finite = points.reshape(-1, 3)
    if not np.isfinite(finite).all():
        finite = finite[np.isfinite(finite).all(axis=1)]
    return [finite.min(axis=0), finite.max(axis=0)] if len(finite) else []


def _widen(ax: Axes, extent: tuple[float, float, float, float], first: bool, mirror: int) -> None:
    x, y = sorted(extent[:2]), sorted(extent[2:])
    if not first:
        x = [min(x[0], *ax.get_xlim()), max(x[1], *ax.get_xlim())]
        y = [min(y[0], *ax.get_ylim()), max(y[1], *ax.get_ylim())]
    ax.set_xlim(*x[::mirror])
    ax.set_ylim(*y)
