"""What lies inside of something, seen through it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.picture.projection import View, project

__all__ = ["faces_to_eye", "seen_through"]

_SHARE = 0.55  # of what is inside, in the color of a pixel


def seen_through(image: NDArray[np.uint8], within: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """An image through which another shows.

    Args:
        image: What is outside, RGBA from 0 to 255, shape (rows, columns, 4).
        within: What is inside, as large.
    """
    front, back = image.astype(float), within.astype(float)
    cover = front[..., 3:] / 255
    weight = back[..., 3:] / 255 * (1.0 - (1.0 - _SHARE) * cover)
    mixed = np.where(cover > 0, (1.0 - weight) * front + weight * back, back)
    mixed[..., 3:] = np.maximum(front[..., 3:], back[..., 3:])
    return np.rint(mixed).astype(np.uint8)


def faces_to_eye(vertices: ArrayLike, faces: ArrayLike, view: View) -> NDArray[np.int64]:
    """Those of the faces that are seen from outside, shape (n, 3).

    Args:
        vertices: Shape (v, 3).
        faces: Turning outwards, shape (f, 3).
        view: The direction of the eye.
    """
    points, faces = project(vertices, view)[:, :2], np.asarray(faces)
    a, b, c = (points[faces[:, k]] for k in range(3))
    (ux, uy), (vx, vy) = (b - a).T, (c - a).T
    return faces[ux * vy > uy * vx]
