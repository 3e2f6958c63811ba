"""Triangles on the unit sphere, and their subdivision."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["icosphere", "quartered"]

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def icosphere(levels: int) -> tuple[Array, Indices]:
    """An icosahedron whose triangles are quartered some times.

    Returns:
        Points (n, 3), and triangles (20 · 4^levels, 3), counterclockwise from outside.
    """
    golden = 0.5 * (1.0 + np.sqrt(5.0))
    pairs = np.array([[-1, golden], [1, golden], [-1, -golden], [1, -golden]])
    points = np.zeros((12, 3))
    for axis in range(3):
        points[4 * axis : 4 * axis + 4, axis] = pairs[:, 0]
        points[4 * axis : 4 * axis + 4, (axis + 1) % 3] = pairs[:, 1]
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    triangles = np.array(
        [
            [i, j, k]
            for i in range(12)
            for j in range(i + 1, 12)
            for k in range(j + 1, 12)
            if min(points[i] @ points[j], points[j] @ points[k], points[k] @ points[i]) > 0.4
        ]
    )
    inward = np.linalg.det(points[triangles]) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    for _ in range(levels):
        points, triangles = quartered(points, triangles)
    return points, triangles


def quartered(points: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Every triangle cut in four at the middles of its sides, which are put onto the sphere.

    Returns:
        All points, the old ones first, and the new triangles only.
    """
    sides = np.sort(triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    keys, which = np.unique(sides @ [len(points), 1], return_inverse=True)
    middles = points[keys // len(points)] + points[keys % len(points)]
    middles /= np.linalg.norm(middles, axis=1, keepdims=True)
    a, b, c = triangles.T
    ab, bc, ca = (len(points) + which.reshape(-1, 3)).T
    cut = [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
    return np.concatenate([points, middles]), np.concatenate([np.stack(t, axis=1) for t in cut])
