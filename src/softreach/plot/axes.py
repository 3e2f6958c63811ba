"""The axes around an image: labeled coordinates of a view along an axis, or a box in space."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import permutations
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from softreach.picture.projection import View, is_mirrored, on_paper, plane_of, project, view_axes
from softreach.picture.zbuffer import Extent, ZBuffer, seen_through
from softreach.plot.style import DPI, as_axes, as_box, figure_style, small_axes
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput
from softreach.support.lazy import Axes
from softreach.support.units import LengthUnit

_TICK_GAP = 4.0  # points between an edge and its numbers
_LABEL_GAP = np.array([23.0, 15.0])  # points between an edge beside or above its label and that
_MARGIN = 0.04
_OVER = 4  # the order of lines over images
_ROOM = np.array([2.8, 3.2])  # inches for the image
_AROUND = np.array([0.6, 0.7])  # inches for labels and key
_LEAST = {True: 1.6, False: 2.5}  # inches for a view along an axis or a box in space, labeled
_TICK_ROOM = 0.42  # inches between ticks at least
_BOX_TICK_ROOM = 0.17  # and along the edges of a box in space
_UNIT_MARK = "_counted in "  # the label of an image, which no legend shows


def draw_box(ax: Axes, box: Array, view: View, unit: LengthUnit) -> None:
    """Draw the walls of a box, shape (2, 3), behind the image of its inside; label its edges."""
    from matplotlib.collections import LineCollection

    edges = [_outer_edge(box, view, axis) for axis in range(3)]
    ticks = _ticks(ax, box, view, edges)
    far, lines = np.where(view_axes(view)[2] > 0, box[0], box[1]), []
    for along, across in permutations(range(3), 2):
        for value in (*ticks[across], *box[:, across]):
            line = np.tile(far, (2, 1))
            line[:, along], line[:, across] = box[:, along], value
            lines.append(project(line, view)[:, :2])
    ax.add_collection(LineCollection(lines, colors="0.85", linewidths=0.5, zorder=1, clip_on=False))
    for axis in range(3):
        _label_edge(ax, box, view, edges[axis], ticks[axis], unit.label("xyz"[axis]))
    ax.set_axis_off()


@dataclass(frozen=True)
class Panel:
    """Axes that show a box in space from one side, at print resolution."""

    ax: Axes
    box: Array  # Space shown: lower and upper corner in the units of the axes, shape (2, 3)
    view: View
    unit: LengthUnit

    @classmethod
    @contextmanager
    def opened(
        cls, points: ArrayLike, unit: LengthUnit, ax: Axes | None, view: View, box: object = None
    ) -> Iterator[Self]:
        """Axes in our style for points in their unit, shape (..., 3), or a box [m], (2, 3)."""
        with figure_style(as_axes(ax)):
            shown = bounding_box(points) if box is None else unit.of(as_box("box", box))
            if ax is None:
                span = view_extent(shown, view).size
                width, height = span * (_ROOM / span).min() + _AROUND
                ax = small_axes(max(width, _LEAST[plane_of(view) is not None]), height)
            yield cls(ax, shown, view, unit)

    @property
    def extent(self) -> Extent:
        """The part of the projection plane that the box fills."""
        return view_extent(self.box, self.view)

    @property
    def pixels_per_unit(self) -> float:
        """At print resolution."""
        return self._columns() / self.extent.size[0]

    def buffer(self, oversample: int, color_step: int = 1) -> ZBuffer:
        """An empty image of the panel; see `ZBuffer`."""
        return ZBuffer(self.extent, self._columns(), oversample, color_step)

    def show(self, buffer: ZBuffer, within: ZBuffer | None = None) -> None:
        """Place the image, and what shows through it, beside what is there, and label the axes."""
        ax, first = self.ax, not self.ax.images
        marks = [str(image.get_label()).partition(_UNIT_MARK) for image in ax.images]
        if others := {name for _, mark, name in marks if mark} - {self.unit.name}:
            hint = "give one unit= to all that shares axes, or length= to all of it or to none"
            counted = f"counted in {', '.join(others)}"
            raise InvalidInput("ax", counted, f"in {self.unit.name}", hint)
        extent, order = self.frame(first), 2 + len(ax.images) / 100
        pixels = buffer.rgba() if within is None else seen_through(buffer.rgba(), within.rgba())
        # "none": vector files get the pixels as they are
        image = ax.imshow(pixels, extent=extent, interpolation="none", zorder=order)
        image.set_label(_UNIT_MARK + self.unit.name)

    def frame(self, first: bool = True) -> tuple[float, float, float, float]:
        """Show all of the panel, beside what is there unless first, and label it; its extent."""
        mirror, plane = (-1 if is_mirrored(self.view) else 1), plane_of(self.view)
        ax, (left, right, bottom, top) = self.ax, self.extent
        x, y = sorted((mirror * left, mirror * right)), [bottom, top]
        if not first:
            x = [min(x[0], *ax.get_xlim()), max(x[1], *ax.get_xlim())]
            y = [min(y[0], *ax.get_ylim()), max(y[1], *ax.get_ylim())]
        ax.set(xlim=x[::mirror], ylim=y)
        if plane:
            ax.set(xlabel=self.unit.label(plane[0]), ylabel=self.unit.label(plane[1]))
            for axis, length in zip((ax.xaxis, ax.yaxis), _inches(ax, self.extent), strict=True):
                axis.set_major_locator(_round_numbers(int(np.clip(length / _TICK_ROOM, 1, 6))))
        elif first:
            draw_box(ax, self.box, self.view, self.unit)
        return mirror * left, mirror * right, bottom, top

    def plot(self, points: Array, *marks: str, **style: Any) -> None:
        """Draw a line or marks over the image, in the units of the axes, shape (n, 3)."""
        self.ax.plot(*on_paper(points, self.view).T, *marks, **{"zorder": _OVER, **style})

    def _columns(self) -> int:
        return max(16, round(_inches(self.ax, self.extent)[0] * DPI))


def bounding_box(*points: ArrayLike) -> Array:
    """Lower and upper corner around all finite points, with a margin, shape (2, 3)."""
    corners: list[Array] = []
    for cloud in points:
        finite = np.asarray(cloud, float).reshape(-1, 3)
        if not np.isfinite(finite).all():
            finite = finite[np.isfinite(finite).all(axis=1)]
        corners += [finite.min(axis=0), finite.max(axis=0)] if len(finite) else []
    if not corners:
        raise InvalidInput("points", "none", "at least one finite point")
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    margin = _MARGIN * max((high - low).max(), 1e-9)
    return np.array([low - margin, high + margin])


def view_extent(box: Array, view: View) -> Extent:
    """The part of the projection plane that a box fills."""
    corners = np.stack(np.meshgrid(*box.T, indexing="ij"), axis=-1).reshape(-1, 3)
    right, up, _ = project(corners, view).T
    return Extent(right.min(), right.max(), up.min(), up.max())


def _ticks(ax: Axes, box: Array, view: View, edges: list[Array]) -> list[Array]:
    extent, ticks = view_extent(box, view), []
    lengths = np.linalg.norm(project(np.ptp(edges, axis=1), view)[:, :2], axis=1)
    inches = lengths * (_inches(ax, extent) / extent.size).min()
    counts = np.minimum(np.rint(6 * lengths / lengths.max()), inches // _BOX_TICK_ROOM)
    for (low, high), count in zip(box.T, np.maximum(2, counts).astype(int).tolist(), strict=True):
        values = np.asarray(_round_numbers(count).tick_values(low, high))
        ticks.append(values[(values >= low) & (values <= high)])
    return ticks


def _label_edge(ax: Axes, box: Array, view: View, edge: Array, ticks: Array, label: str) -> None:
    ends, center = project(edge, view)[:, :2], project(box.mean(axis=0), view)[:2]
    right, up = ends[1] - ends[0]
    outward = np.array([0.0, -1.0])  # where the edge points at the camera
    if size := np.hypot(right, up):
        normal = np.array([-up, right])
        outward = normal / size * np.sign((ends.mean(axis=0) - center) @ normal or 1.0)
    axis = int(np.argmax(np.ptp(edge, axis=0)))
    low, high = edge[:, axis]
    texts = []
    for value in ticks:
        place = ends[0] + (value - low) / (high - low) * (ends[1] - ends[0])
        texts.append((place, f"{value:g}".replace("-", "\N{MINUS SIGN}"), _TICK_GAP, 7))
    texts.append((ends.mean(axis=0), label, float(np.abs(outward) @ _LABEL_GAP), 8))
    sideways, upward = (np.sign(outward) * (np.abs(outward) > 0.4)).astype(int)
    across = {-1: "right", 0: "center", 1: "left"}[sideways]
    along = {-1: "top", 0: "center", 1: "bottom"}[upward]
    for place, text, gap, size in texts:
        look = {"ha": across, "va": along, "fontsize": size, "color": "0.25"}
        at = {"xytext": tuple(gap * outward), "textcoords": "offset points"}
        ax.annotate(text, tuple(place), **at, **look)


def _outer_edge(box: Array, view: View, axis: int) -> Array:
    """The edge along an axis on the outline of the box, lowest on paper (z: farthest left)."""
    others = [k for k in range(3) if k != axis]
    edges = np.tile(box, (4, 1, 1))
    for edge, pick in zip(edges, np.ndindex(2, 2), strict=True):
        edge[:, others] = box[pick, others]
    places = project(edges, view)[..., 0 if axis == 2 else 1].mean(axis=1)
    return edges[places.argmin()]


def _inches(ax: Axes, extent: Extent) -> Array:
    figure = ax.get_figure(root=True)
    assert figure is not None
    room = np.array(ax.get_position().size) * figure.get_size_inches()
    return extent.size * (room / extent.size).min()


def _round_numbers(count: int) -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(count, steps=[1, 2, 5, 10], min_n_ticks=1)
