"""A box around everything, with numbers along its outer edges as a camera sees it."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softreach.support.arrays import Array
from softreach.support.quantity import round_above

_TICK = 0.02  # length of a tick, of the largest side
_MOST = 8  # ticks along the longest edge
_WIDE, _HIGH = 32.0, 16.0  # pixels from one number to the next, beside or above each other
_END_ON = 0.97  # cosine of the angle to an axis below which its numbers would hide each other
# From an edge to its numbers, to the name of its axis, and to that at most, in ticks.
_NUMBERS_AT, _NAME_AT, _FARTHEST = 2.5, 7.0, 20.0
_BESIDE, _ABOVE = 20.0, 12.0  # pixels from the name of an axis to a number at the same place
_FLAT = 0.25  # of its length, that a tick along the floor has at least in the picture


class Edge(NamedTuple):
    """The edge that carries the numbers of an axis."""

    high: tuple[bool, ...]  # True where it is at the high side, along x, y and z
    outward: int  # The axis along which its ticks lead out of the box


class Side(NamedTuple):
    """Side from which a box is seen: all that its drawing depends on."""

    visible: tuple[int, ...]  # Face across x, y and z seen from outside: 1 the high one, -1 the low
    edges: tuple[Edge | None, ...]  # With the numbers of x, y and z; None if it is seen end on
    steps: tuple[float, ...]  # From one number to the next [L]
    names: tuple[float, ...]  # From an edge to the name of its axis, in ticks


class AxesBox(NamedTuple):
    """Lines and texts [L]."""

    lines: Array  # Shape (n, 2, 3)
    labels: list[tuple[str, Array]]  # Text and where it stands


def seen_from(camera: ArrayLike, low: Array, high: Array, focal: float = np.inf) -> Side:
    """The side of a box [L] that a camera sees; numbers keep apart by its focal length [pixel]."""
    place = np.asarray(camera, float)
    visible = tuple(((place > high).astype(int) - (place < low)).tolist())
    toward = place - (low + high) / 2
    toward /= max(float(np.linalg.norm(toward)), 1e-12)
    right = np.array([-toward[1], toward[0], 0.0])
    right = right / np.linalg.norm(right) if right.any() else np.array([1.0, 0.0, 0.0])
    picture = np.stack([right, np.cross(toward, right)])  # right and up, shape (2, 3)
    edges = [_outer_edge(axis, visible, toward, picture) for axis in range(3)]
    usual = _round_step(float((high - low).max()))
    steps, names = [usual] * 3, [_NAME_AT] * 3
    for axis, edge in enumerate(edges):
        if edge is not None:
            ends = np.tile(np.where(edge.high, high, low), (2, 1))
            ends[:, axis] = low[axis], high[axis]
            seen = _seen(ends - place, toward, picture) / (high - low)[axis]
            steps[axis] = max(usual, round_above(_room(seen, focal, (_WIDE, _HIGH))))
            ends[:] = ends.mean(axis=0)
            ends[1, edge.outward] += _TICK * float((high - low).max())
            tick = _seen(ends - place, toward, picture)
            away = np.ceil(_NUMBERS_AT + _room(tick, focal, (_BESIDE, _ABOVE)))
            names[axis] = float(np.clip(away, _NAME_AT, _FARTHEST))
    return Side(visible, tuple(edges), tuple(steps), tuple(names))


def _seen(ends: Array, toward: Array, picture: Array) -> Array:
    """Distances of two points to the right and up, in focal lengths, shape (2,)."""
    first, last = ends @ picture.T / np.maximum(-ends @ toward, 1e-3)[:, None]
    return np.abs(last - first)


def _room(seen: Array, focal: float, apart: tuple[float, float]) -> float:
    """The least step of texts some pixels apart, in units of a length seen in focal lengths."""
    return float((np.array(apart) / ((seen + 1e-9) * focal)).min())


def _outer_edge(axis: int, visible: tuple[int, ...], toward: Array, picture: Array) -> Edge | None:
    """The lowest edge in the outline, the leftmost of upright ones: one of its faces is seen."""
    if abs(toward[axis]) > _END_ON:
        return None
    b, c = (k for k in range(3) if k != axis)
    sides = [(p, q) for p in (-1, 1) for q in (-1, 1) if (p == visible[b]) != (q == visible[c])]
    aims = -picture[0] if axis == 2 else -picture[1]
    p, q = max(sides or [(-1, -1)], key=lambda at: at[0] * aims[b] + at[1] * aims[c])
    # Out of the box along the floor, unless that leads towards the camera.
    reach = np.linalg.norm(picture, axis=0)
    first = p * aims[b] > q * aims[c] if axis == 2 else reach[b] > _FLAT
    high = [False, False, False]
    high[b], high[c] = p > 0, q > 0
    return Edge(tuple(high), b if first else c)


def axes_box(
    *points: Array,
    camera: ArrayLike = (50.0, -80.0, 30.0),
    focal: float = np.inf,
    label: Callable[[str], str] = "{} / L".format,
) -> AxesBox:
    """The box around points [L], shapes (n, 3), without the edges that would run across them."""
    low, high = round_box(*points)
    side = seen_from(camera, low, high, focal)
    lines, labels = [*_edges(low, high, side)], []
    size = _TICK * float((high - low).max())
    for axis, edge in enumerate(side.edges):
        if edge is None:
            continue
        corner, away = np.where(edge.high, high, low), np.zeros(3)
        away[edge.outward] = size if edge.high[edge.outward] else -size
        step = side.steps[axis]
        for number in np.arange(np.ceil(low[axis] / step), np.floor(high[axis] / step) + 1):
            value = number * step + 0.0  # no -0
            at = np.where(np.arange(3) == axis, value, corner)
            lines.append(np.stack([at, at + away]))
            text = f"{value:.10g}".replace("-", "\N{MINUS SIGN}")
            labels.append((text, at + _NUMBERS_AT * away))
        middle = np.where(np.arange(3) == axis, (low[axis] + high[axis]) / 2, corner)
        labels.append((label("xyz"[axis]), middle + side.names[axis] * away))
    return AxesBox(np.array(lines), labels)


def round_box(*points: Array) -> tuple[Array, Array]:
    """Lowest and highest corner of a box around points, shapes (n, 3), at round numbers."""
    every = np.concatenate(points)
    low, high = every.min(axis=0), every.max(axis=0)
    unit = _round_step(float((high - low).max())) / 2
    low, high = np.floor(low / unit) * unit, np.ceil(high / unit) * unit
    return low, np.maximum(high, low + unit)


def _round_step(span: float) -> float:
    return round_above(max(span, 1e-9) / _MOST)


def _edges(low: Array, high: Array, side: Side) -> list[Array]:
    """The edges, shape (2, 3) each, but those between two faces that the camera sees."""
    corners, edges = np.stack([low, high]), []
    for axis in range(3):
        others = [k for k in range(3) if k != axis]
        for pick in np.ndindex(2, 2):
            if tuple(2 * p - 1 for p in pick) != tuple(side.visible[k] for k in others):
                ends = corners.copy()
                ends[:, others] = corners[pick, others]
                edges.append(ends)
    return edges
