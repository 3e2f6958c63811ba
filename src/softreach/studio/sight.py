"""Which points stand between the eye and what is to be seen: the arm and the target."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["CUTS", "Sight", "in_the_way", "is_behind"]

Array = NDArray[np.float64]

CUTS = {
    "window": "a window to the arm",
    "half": "the half in front of the arm",
    "none": "nothing",
}
"""What is cut away from the cloud: name -> what the menu says."""

_CELLS = 192  # of the picture, along each side
_MARGIN = 0.02  # [L] around what is to be seen
_TOUCHING = 3.0  # radii: what is nearer belongs to the same piece of the arm


@dataclass(frozen=True, eq=False)
class Sight:
    """An eye, and the balls it should see [L]."""

    eye: Array
    look_at: Array
    centers: Array
    """Shape (n, 3)."""
    radii: Array
    """Shape (n,)."""

    def seen(self, points: ArrayLike) -> Array:
        """Places in the picture (right, up) [-] and depth [L], shape (n, 3)."""
        right, up, forward = _axes_of(self.look_at - self.eye)
        offset = np.asarray(points, float) - self.eye
        depth = np.maximum(offset @ forward, 1e-6)
        return np.stack([offset @ right / depth, offset @ up / depth, depth], axis=-1)


def in_the_way(points: Array, sight: Sight, cut: str) -> NDArray[np.bool_]:
    """Which points [L], shape (n, 3), hide one of the balls, or stand before the base.

    Args:
        points: Of a cloud.
        sight: Who looks at what.
        cut: One of `CUTS`.
    """
    if cut == "none" or not len(points):
        return np.zeros(len(points), bool)
    seen = sight.seen(points)
    hides = _hides(seen, sight) if len(sight.centers) else np.zeros(len(points), bool)
    if cut == "half":
        ahead = (sight.look_at - sight.eye) * (1.0, 1.0, 0.0)
        hides |= points @ ahead < 0.0
    return hides


def is_behind(point: Array, eye: Array, centers: Array, radii: Array) -> bool:
    """Whether a ball stands between an eye and a point [L]; balls that touch the point do not.

    Args:
        point: Shape (3,).
        eye: Shape (3,).
        centers: Of the balls, shape (n, 3).
        radii: Shape (n,).
    """
    distance = float(np.linalg.norm(point - eye))
    way = (point - eye) / distance
    ahead = (centers - eye) @ way
    aside = np.linalg.norm(centers - eye - ahead[:, None] * way, axis=1)
    return bool(((aside < radii) & (ahead > 0) & (ahead < distance - _TOUCHING * radii)).any())


def _hides(seen: Array, sight: Sight) -> NDArray[np.bool_]:
    """Looked up in a picture of how far away the farthest ball is."""
    balls = sight.seen(sight.centers)
    sizes = (sight.radii + _MARGIN) / balls[:, 2]
    low = (balls[:, :2] - sizes[:, None]).min(axis=0)
    high = (balls[:, :2] + sizes[:, None]).max(axis=0)
    step = (high - low).max() / _CELLS
    picture = np.zeros((_CELLS + 1, _CELLS + 1))
    across, along = (low[k] + step * np.arange(_CELLS + 1) for k in range(2))
    for (x, y, depth), size in zip(balls, sizes, strict=True):
        disk = (across[:, None] - x) ** 2 + (along - y) ** 2 <= size**2
        picture[disk] = np.maximum(picture[disk], depth)
    cell = np.rint((seen[:, :2] - low) / step)
    inside = ((cell >= 0) & (cell <= _CELLS)).all(axis=1)
    i, j = np.where(inside[:, None], cell, 0).astype(np.intp).T
    return inside & (seen[:, 2] < picture[i, j])


def _axes_of(direction: Array) -> tuple[Array, Array, Array]:
    """Right, up and forward of an eye that keeps z upright."""
    forward = direction / np.linalg.norm(direction)
    upright = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.999 else np.array([0.0, 1.0, 0.0])
    right = np.cross(forward, upright)
    right /= np.linalg.norm(right)
    return right, np.cross(right, forward), forward
