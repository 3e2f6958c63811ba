"""Lines of sight: what hides a place, which point they pick, how far along an axis they point.

All lengths are in that of the arm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softreach.support.arrays import Array

_TOUCHING = 3.0  # radii: what is nearer belongs to the same piece of the arm
_CLICK = 0.01  # [rad] between the ray of a click and a point that it hits
_STEEPEST = 0.03  # sin² between axis and line of sight, below which a drag tells no distance


def is_behind(point: Array, camera: Array, centers: Array, radii: Array) -> bool:
    """True if one of the balls, (n, 3) and (n,) [L], hides a point that it does not touch."""
    distance = float(np.linalg.norm(point - camera))
    ahead, aside = _beside(centers, camera, (point - camera) / distance)
    return bool(((aside < radii) & (ahead > 0) & (ahead < distance - _TOUCHING * radii)).any())


def _beside(points: Array, origin: Array, way: Array) -> tuple[Array, Array]:
    """Distances of points along a ray whose direction `way` has length 1, and from it."""
    offset = points - origin
    ahead = offset @ way
    return ahead, np.linalg.norm(offset - ahead[:, None] * way, axis=1)


def picked_point(points: Array, origin: ArrayLike, direction: ArrayLike) -> int | None:
    """Number of the first of the points (n, 3) that a ray from the camera hits, if any."""
    direction = np.asarray(direction, float) / np.linalg.norm(direction)
    depth, aside = _beside(points, np.asarray(origin, float), direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        angle = np.where(depth > 0, aside / depth, np.inf)
    near = np.flatnonzero(angle <= _CLICK)
    if not len(near):
        return None
    # A little deeper but under the cursor is better than in front and beside it.
    return int(near[np.argmin(depth[near] * (1.0 + 0.1 * angle[near] / _CLICK))])


def along_axis(origin: Array, axis: Array, eye: Array, seen: Array) -> float:
    """Way along an axis of length 1 to where a line of sight is nearest; 0 if seen end on."""
    sight = (seen - eye) / np.linalg.norm(seen - eye)
    across = axis - (axis @ sight) * sight
    steepness = float(across @ across)
    return float((eye - origin) @ across) / steepness if steepness > _STEEPEST else 0.0
