"""Number of tetrahedra that cover any given point: from the critical triangles below it."""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import strict
from softreach.kernels.image.raster import extent, left_of_edge, twice_area, upward

__all__ = ["bin_triangles", "cover_at"]


@strict
def bin_triangles(points, triangles, unit, shape):
    """Triangles over each square of a grid in x and y.

    Args:
        points: Mapped vertices, whole numbers, shape (n, 3).
        triangles: Rows of `contour.critical_triangles`.
        unit: Edge of a square.
        shape: Number of squares along x and y.

    Returns:
        Triangles of square 0, of square 1, ..., and where each square's begin.
    """
    starts = np.zeros(shape[0] * shape[1] + 1, np.int64)
    for t in range(len(triangles)):
        low_x, high_x = squares(points, triangles, t, unit, 0)
        low_y, high_y = squares(points, triangles, t, unit, 1)
        for i in range(low_x, high_x):
            for j in range(low_y, high_y):
                starts[i * shape[1] + j + 1] += 1
    starts = np.cumsum(starts)
    filled = starts[:-1].copy()
    members = np.empty(starts[-1], np.int64)
    for t in range(len(triangles)):
        low_x, high_x = squares(points, triangles, t, unit, 0)
        low_y, high_y = squares(points, triangles, t, unit, 1)
        for i in range(low_x, high_x):
            for j in range(low_y, high_y):
                members[filled[i * shape[1] + j]] = t
                filled[i * shape[1] + j] += 1
    return members, starts


@strict
def squares(points, triangles, t, unit, axis):
    """Squares from the first to one past the last that a triangle touches along an axis."""
    low, high = extent(points, triangles, t, axis)
    return int(np.floor(low / unit)), int(np.floor(high / unit)) + 1


@strict
def cover_at(points, triangles, unit, shape, members, starts, where, out):
    """Number of tetrahedra that cover each point.

    Args:
        points: Mapped vertices, whole numbers, shape (n, 3).
        triangles: Rows of `contour.critical_triangles`.
        unit: Edge of a square.
        shape: Number of squares along x and y.
        members: From `bin_triangles`.
        starts: From `bin_triangles`.
        where: Points, whole numbers, shape (k, 3).
        out: Result, shape (k,).
    """
    for n in range(len(where)):
        x, y, z = where[n, 0], where[n, 1], where[n, 2]
        i, j = int(np.floor(x / unit)), int(np.floor(y / unit))
        out[n] = 0
        if i < 0 or j < 0 or i >= shape[0] or j >= shape[1]:
            continue
        for e in range(starts[i * shape[1] + j], starts[i * shape[1] + j + 1]):
            t = members[e]
            out[n] += triangles[t, 3] * side_below(points, triangles, t, x, y, z)


@strict
def side_below(points, triangles, t, x, y, z):
    """0 unless a triangle lies below (x, y, z) or holds it; 1 if its normal points up, else -1."""
    a, b, c, side = upward(points, triangles, t, 0, 1)
    if side == 0:
        return 0
    at_c, at_a = twice_area(points, a, b, x, y, 0, 1), twice_area(points, b, c, x, y, 0, 1)
    area = twice_area(points, a, b, points[c, 0], points[c, 1], 0, 1)
    at_b = area - at_a - at_c
    inside = left_of_edge(points, a, b, at_c, 0, 1) and left_of_edge(points, b, c, at_a, 0, 1)
    if not inside or not left_of_edge(points, c, a, at_b, 0, 1):
        return 0
    base = points[a, 2]
    rise = at_b * (points[b, 2] - base) + at_c * (points[c, 2] - base)
    return side if (z - base) * area >= rise else 0
