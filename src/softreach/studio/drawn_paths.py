"""Paths of a few plain shapes that begin at the tip."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.support.errors import InvalidInput

__all__ = ["PATH_SHAPES", "PLANES", "drawn_path", "straight_path"]

Array = NDArray[np.float64]

PLANES: Mapping[str, tuple[int, int]] = {"x, y": (0, 1), "x, z": (0, 2), "y, z": (1, 2)}
"""The plane of a shape: its first and its second direction."""

_POINTS = 97


def drawn_path(shape: str, plane: str, size: float, tip: ArrayLike) -> Array:
    """A shape through the tip, which is where it begins.

    Args:
        shape: One of `PATH_SHAPES`.
        plane: One of `PLANES`.
        size: Largest extent, in the unit of the tip; negative for the other side.
        tip: Where it begins.

    Returns:
        Points in the unit of the tip, shape (n, 3).

    Raises:
        InvalidInput: An unknown shape or plane, or no size.
    """
    for name, value, known in (("shape", shape, PATH_SHAPES), ("plane", plane, PLANES)):
        if value not in known:
            raise InvalidInput(name, value, f"one of {', '.join(known)}")
    if not (np.isfinite(size) and size != 0):
        raise InvalidInput("size", size, "a finite number other than 0")
    across = PATH_SHAPES[shape](np.linspace(0.0, 1.0, _POINTS))
    points = np.tile(np.asarray(tip, float), (_POINTS, 1))
    points[:, PLANES[plane]] += size * across
    return points


def straight_path(corners: ArrayLike, points: int = _POINTS) -> Array:
    """Even points on the straight lines between corners, which are among them, shape (n, 3)."""
    places = np.asarray(corners, float)
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    pieces = np.maximum(1, np.round(points * lengths / max(lengths.sum(), 1e-300)).astype(int))
    parts = [
        start + np.linspace(0.0, 1.0, count, endpoint=False)[:, None] * (end - start)
        for start, end, count in zip(places[:-1], places[1:], pieces, strict=True)
    ]
    return np.concatenate([*parts, places[-1:]])


def _circle(share: Array) -> Array:
    angle = 2 * np.pi * share
    return np.stack([np.cos(angle) - 1.0, np.sin(angle)], axis=1) / 2


def _figure_eight(share: Array) -> Array:
    angle = 2 * np.pi * share
    return np.stack([np.sin(angle), np.sin(2 * angle)], axis=1) / 2


def _line(share: Array) -> Array:
    return np.stack([share, np.zeros_like(share)], axis=1)


PATH_SHAPES: Mapping[str, Callable[[Array], Array]] = {
    "circle": _circle,
    "figure eight": _figure_eight,
    "line": _line,
}
"""From shares of the way, 0 to 1, to places in the plane."""
