"""The axes around an image: labeled coordinates of a view along an axis, or a box in space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.errors import InvalidInput
from softreach.picture.projection import View, is_mirrored, plane_of, project
from softreach.picture.see_through import seen_through
from softreach.picture.zbuffer import Extent, ZBuffer
from softreach.plot.lengths import LengthUnit
from softreach.plot.space_box import draw_box
from softreach.plot.style import DPI, pyplot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Panel", "bounding_box", "view_extent"]

Array = NDArray[np.float64]

_MARGIN = 0.04
_ROOM = np.array([2.8, 3.2])  # inches for the image
_AROUND = np.array([0.6, 0.7])  # inches for labels and key
_TICK_ROOM = 0.42  # inches between ticks at least
_UNIT_MARK = "_counted in "  # the label of an image, which no legend shows


@dataclass(frozen=True)
class Panel:
    """Axes that show a box in space from one side, at print resolution."""

    ax: Axes
    box: Array
    """What they show: lower and upper corner in the units of the axes, shape (2, 3)."""
    view: View
    unit: LengthUnit

    @classmethod
    def opened(
        cls, points: ArrayLike, unit: LengthUnit, ax: Axes | None, view: View, box: ArrayLike | None
    ) -> Self:
        """Axes for points.

        Args:
            points: What is going to be shown, in the units of the axes, shape (..., 3).
            unit: The units of the axes.
            ax: Axes to draw in; None for a new figure.
            view: The direction of sight.
            box: What to show, lower and upper corner [m], shape (2, 3); None for all points.

        Raises:
            InvalidInput: Unknown view, a box of another shape, or no finite point to show.
        """
        shown = bounding_box(points) if box is None else unit.of(box)
        return cls(_framed_axes(shown, view) if ax is None else ax, shown, view, unit)

    @property
    def extent(self) -> Extent:
        """The part of the projection plane that the box fills."""
        return view_extent(self.box, self.view)

    @property
    def pixels_per_unit(self) -> float:
        """At print resolution."""
        return self._columns() / (self.extent.right - self.extent.left)

    def buffer(self, oversample: int, color_step: int = 1) -> ZBuffer:
        """An empty image of the panel; see `ZBuffer`."""
        return ZBuffer(self.extent, self._columns(), oversample, color_step)

    def show(self, buffer: ZBuffer, within: ZBuffer | None = None) -> None:
        """Place the finished image in the axes and label them; what is there stays in view.

        Args:
            buffer: The image.
            within: What shows through it; None for nothing.

        Raises:
            InvalidInput: What is there is counted in another unit.
        """
        _check_unit(self.ax, self.unit)
        ax, first, plane = self.ax, not self.ax.images, plane_of(self.view)
        mirror = -1 if is_mirrored(self.view) else 1
        left, right, bottom, top = buffer.extent
        extent, order = (mirror * left, mirror * right, bottom, top), 2 + len(ax.images) / 100
        pixels = buffer.rgba() if within is None else seen_through(buffer.rgba(), within.rgba())
        # "none": vector files get the pixels as they are
        image = ax.imshow(pixels, extent=extent, interpolation="none", zorder=order)
        image.set_label(_UNIT_MARK + self.unit.symbol)
        _widen(ax, extent, first, mirror)
        if plane:
            ax.set(xlabel=self.unit.label(plane[0]), ylabel=self.unit.label(plane[1]))
            _set_ticks(ax, _inches(ax, buffer.extent))
        elif first:
            draw_box(ax, self.box, self.view, self.unit)

    def _columns(self) -> int:
        return max(16, round(_inches(self.ax, self.extent)[0] * DPI))


def bounding_box(*points: ArrayLike) -> Array:
    """Lower and upper corner around all finite points, with a margin, shape (2, 3).

    Raises:
        InvalidInput: No finite point to show.
    """
    corners = [corner for cloud in points for corner in _corners(np.asarray(cloud, float))]
    if not corners:
        raise InvalidInput("points", "none", "at least one finite point")
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    margin = _MARGIN * max((high - low).max(), 1e-9)
    return np.array([low - margin, high + margin])


def view_extent(box: Array, view: View) -> Extent:
    """The part of the projection plane that a box fills."""
    seen = project(_box_corners(box), view)
    low, high = seen.min(axis=0), seen.max(axis=0)
    return Extent(low[0], high[0], low[1], high[1])


def _box_corners(box: Array) -> Array:
    """The eight corners, shape (8, 3)."""
    return np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)


def _framed_axes(box: Array, view: View) -> Axes:
    """Axes in a new figure of the shape of what they show, about a journal's column wide."""
    span = _span(view_extent(box, view))
    inches = span * (_ROOM / span).min() + _AROUND
    return pyplot().subplots(figsize=tuple(inches), layout="constrained")[1]


def _check_unit(ax: Axes, unit: LengthUnit) -> None:
    marks = (str(image.get_label()) for image in ax.images)
    found = {mark.removeprefix(_UNIT_MARK) for mark in marks if mark.startswith(_UNIT_MARK)}
    if found - {unit.symbol}:
        hint = "give length= or data with attrs['length'] to all that shares axes, or to none"
        raise InvalidInput("ax", f"counted in {', '.join(found)}", f"in {unit.symbol}", hint)


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
