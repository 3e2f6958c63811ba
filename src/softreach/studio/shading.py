"""Light on a cloud: points at its surface are as bright as the surface would be."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

__all__ = ["lit"]

Array = NDArray[np.float64]

_CELLS = 48  # along the longest side
_BLUR = 1.2  # [cells]
_LIGHT = np.array([0.35, -0.55, 0.76])  # from the front, the right and above
_DARKEST, _BRIGHTEST = 0.62, 1.0


def lit(colors: NDArray[np.uint8], points: Array) -> NDArray[np.uint8]:
    """Colors, shape (n, 3), as a lamp beside the reader lights them; those inside are bright.

    Args:
        colors: RGB from 0 to 255.
        points: Where they are, any unit, shape (n, 3).
    """
    if len(points) < 2:
        return colors
    outward = _outward(points)
    facing = np.clip(outward @ _LIGHT, -1.0, 1.0)
    shade = _BRIGHTEST - (_BRIGHTEST - _DARKEST) * 0.5 * (1.0 - facing)
    # Inside there is no surface that could turn away from the lamp.
    surface = np.minimum(np.linalg.norm(outward, axis=1), 1.0)
    shade = surface * shade + (1.0 - surface) * (_DARKEST + _BRIGHTEST) / 2
    return np.rint(colors * shade[:, None]).astype(np.uint8)


def _outward(points: Array) -> Array:
    """Towards where there are fewer points: of length 1 at the surface, 0 deep inside."""
    low, high = points.min(axis=0), points.max(axis=0)
    step = max(float((high - low).max()) / _CELLS, 1e-12)
    places = (points - low) / step + 3.0
    shape = tuple(np.ceil((high - low) / step).astype(int) + 7)
    full = np.zeros(shape)
    i, j, k = np.rint(places).astype(np.intp).T
    full[i, j, k] = 1.0  # whether a cell has points, not how many: the activations decide that
    slopes = np.gradient(gaussian_filter(full, _BLUR, truncate=2.5))
    found = [map_coordinates(slope, places.T, order=1) for slope in slopes]
    outward = -np.stack(found, axis=1)
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    return outward / np.maximum(length, 0.08)
