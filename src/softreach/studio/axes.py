"""A box around everything, with numbers along three of its edges."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["AxesBox", "axes_box"]

Array = NDArray[np.float64]

_TICK = 0.02  # length of a tick, of the largest side
_MOST = 8  # ticks along the longest edge
_OUTWARD = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]])  # of each edge's ticks


class AxesBox(NamedTuple):
    """Lines and texts [L]."""

    lines: Array
    """Shape (n, 2, 3)."""
    labels: list[tuple[str, Array]]
    """Text and where it stands."""


def axes_box(*points: Array) -> AxesBox:
    """The box around points, shapes (n, 3), its sides at round numbers."""
    low, high = _round_sides(np.concatenate(points))
    step = _round_step(float((high - low).max()))
    lines, labels = list(_edges(low, high)), []
    size = _TICK * float((high - low).max())
    for axis, (corner, away) in enumerate(zip(_corners(low, high), size * _OUTWARD, strict=True)):
        for value in _ticks(low[axis], high[axis], step):
            at = np.where(np.arange(3) == axis, value, corner)
            lines.append(np.stack([at, at + away]))
            labels.append((_number(value), at + 2.5 * away))
        middle = np.where(np.arange(3) == axis, (low[axis] + high[axis]) / 2, corner)
        labels.append((f"{'xyz'[axis]} / L", middle + 7 * away))
    return AxesBox(np.array(lines), labels)


def _corners(low: Array, high: Array) -> Array:
    """Where the three edges with numbers meet the others: in front, seen from +x and -y."""
    return np.array([low, [high[0], low[1], low[2]], low])


def _ticks(low: float, high: float, step: float) -> Array:
    """Multiples of the step, 0 without a sign."""
    return np.arange(np.ceil(low / step), np.floor(high / step) + 1) * step + 0.0


def _number(value: float) -> str:
    return f"{value:.10g}".replace("-", "\N{MINUS SIGN}")


def _round_sides(points: Array) -> tuple[Array, Array]:
    low, high = points.min(axis=0), points.max(axis=0)
    unit = _round_step(float((high - low).max())) / 2
    low, high = np.floor(low / unit) * unit, np.ceil(high / unit) * unit
    return low, np.maximum(high, low + unit)


def _round_step(span: float) -> float:
    """A round number of which few fit into the span."""
    power = 10.0 ** np.floor(np.log10(max(span, 1e-9) / _MOST))
    return float(next(f * power for f in (1, 2, 5, 10) if span / (f * power) <= _MOST))


def _edges(low: Array, high: Array) -> Array:
    """The twelve edges, shape (12, 2, 3)."""
    corners = np.array([[low[0], high[0]], [low[1], high[1]], [low[2], high[2]]])
    edges = []
    for axis in range(3):
        for pick in np.ndindex(2, 2):
            ends = np.empty((2, 3))
            ends[:, axis] = corners[axis]
            others = [k for k in range(3) if k != axis]
            ends[:, others] = [corners[k][p] for k, p in zip(others, pick, strict=True)]
            edges.append(ends)
    return np.array(edges)
