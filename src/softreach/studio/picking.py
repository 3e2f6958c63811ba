"""Which point of a cloud a click means."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["picked_point", "plane_crossing"]

Array = NDArray[np.float64]


def picked_point(
    points: Array, origin: ArrayLike, direction: ArrayLike, tolerance: float = 0.01
) -> int | None:
    """The point that a ray through a pixel hits: of those close to it, the nearest to the eye.

    Args:
        points: Shape (n, 3), any unit.
        origin: The eye.
        direction: Of the ray, any length.
        tolerance: Largest angle between the ray and the point [rad].

    Returns:
        The point's number, or None if the ray passes all of them by.
    """
    ray = np.asarray(direction, float) / np.linalg.norm(direction)
    offset = points - np.asarray(origin, float)
    depth = offset @ ray
    aside = np.sqrt(np.maximum(np.einsum("ni,ni->n", offset, offset) - depth**2, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(depth > 0, aside / depth, np.inf)
    near = np.flatnonzero(angle <= tolerance)
    if not len(near):
        return None
    # A little deeper but under the cursor is better than in front and beside it.
    return int(near[np.argmin(depth[near] * (1.0 + 0.1 * angle[near] / tolerance))])


def plane_crossing(
    origin: ArrayLike, direction: ArrayLike, point: ArrayLike, normal: ArrayLike
) -> Array | None:
    """Where a ray meets a plane, or None if it does not."""
    start, ray, n = (np.asarray(v, float) for v in (origin, direction, normal))
    slope = ray @ n
    if slope == 0.0:
        return None
    far = (np.asarray(point, float) - start) @ n / slope
    return start + far * ray if far > 0 else None
