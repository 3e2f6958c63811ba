"""A box in space behind an oblique view: three far walls with a grid, and coordinates on edges."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from softreach.picture.projection import View, project, view_axes
from softreach.plot.lengths import LengthUnit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_box"]

Array = NDArray[np.float64]

_TICK_GAP = 4.0  # points between an edge and its numbers
_LABEL_GAP = np.array([23.0, 15.0])  # points between an edge beside or above its label and that


def draw_box(ax: Axes, box: Array, view: View, unit: LengthUnit) -> None:
    """Draw the walls of a box that lie behind what it holds, and label its edges.

    Args:
        ax: Axes with an orthographic image of the inside; their own frame is hidden.
        box: Lower and upper corner, shape (2, 3).
        view: The direction of the eye.
        unit: What coordinates are counted in.
    """
    from matplotlib.collections import LineCollection

    edges = [_outer_edge(box, view, axis) for axis in range(3)]
    ticks = _ticks(box, [project(edge, view)[:, :2] for edge in edges])
    eye = view_axes(view)[2]
    far = np.where(eye > 0, box[0], box[1])
    lines = [project(line, view)[:, :2] for line in _wall_lines(box, ticks, far)]
    walls = LineCollection(lines, colors="0.85", linewidths=0.5, zorder=1, clip_on=False)
    ax.add_collection(walls)
    for axis in range(3):
        _label_edge(ax, box, view, edges[axis], ticks[axis], unit.label("xyz"[axis]))
    ax.set_axis_off()


def _ticks(box: Array, edges: list[Array]) -> list[Array]:
    """Round numbers along each axis, as many as its edge has room for on paper."""
    from matplotlib.ticker import MaxNLocator

    lengths = np.array([np.linalg.norm(edge[1] - edge[0]) for edge in edges])
    counts = np.maximum(2, np.rint(6 * lengths / lengths.max())).astype(int)
    ticks = []
    for (low, high), count in zip(box.T, counts.tolist(), strict=True):
        locator = MaxNLocator(count, steps=[1, 2, 5, 10], min_n_ticks=1)
        values = np.asarray(locator.tick_values(low, high))
        ticks.append(values[(values >= low) & (values <= high)])
    return ticks


def _wall_lines(box: Array, ticks: list[Array], far: Array) -> Iterator[Array]:
    """Grid lines and edges: for each pair of axes, lines along one at the ticks of the other."""
    for along in range(3):
        for across in {0, 1, 2} - {along}:
            for value in (*ticks[across], *box[:, across]):
                line = np.tile(far, (2, 1))
                line[:, along] = box[:, along]
                line[:, across] = value
                yield line


def _label_edge(ax: Axes, box: Array, view: View, edge: Array, ticks: Array, label: str) -> None:
    ends = project(edge, view)[:, :2]
    outward = _outward(ends, project(box.mean(axis=0), view)[:2])
    axis = int(np.argmax(np.ptp(edge, axis=0)))
    low, high = edge[:, axis]
    for value in ticks:
        place = ends[0] + (value - low) / (high - low) * (ends[1] - ends[0])
        _text(ax, place, f"{value:g}".replace("-", "\N{MINUS SIGN}"), outward, _TICK_GAP, 7)
    gap = float(np.abs(outward) @ _LABEL_GAP)
    _text(ax, ends.mean(axis=0), label, outward, gap, 8)


def _outer_edge(box: Array, view: View, axis: int) -> Array:
    """The edge along an axis on the outline of the box, lowest on paper (z: farthest left)."""
    others = [k for k in range(3) if k != axis]
    edges = []
    for pick in np.ndindex(2, 2):
        edge = np.zeros((2, 3))
        edge[:, axis] = box[:, axis]
        edge[:, others] = box[pick, others]
        edges.append(edge)
    place = 0 if axis == 2 else 1
    return min(edges, key=lambda edge: project(edge, view)[:, place].mean())


def _outward(ends: Array, center: Array) -> Array:
    along = ends[1] - ends[0]
    normal = np.array([-along[1], along[0]])
    size = np.linalg.norm(normal)
    if size == 0:  # the edge points at the eye
        return np.array([0.0, -1.0])
    return normal / size * np.sign((ends.mean(axis=0) - center) @ normal or 1.0)


def _text(ax: Axes, place: Array, text: str, outward: Array, gap: float, size: float) -> None:
    """Write beside an edge, on the side away from the box."""
    sideways, upward = (np.sign(outward) * (np.abs(outward) > 0.4)).astype(int)
    ax.annotate(
        text,
        tuple(place),
        xytext=tuple(gap * outward),
        textcoords="offset points",
        ha={-1: "right", 0: "center", 1: "left"}[sideways],
        va={-1: "top", 0: "center", 1: "bottom"}[upward],
        fontsize=size,
        color="0.25",
    )
