"""Triangles drawn into a z-buffer, one row of pixels after the other."""

from __future__ import annotations

import numpy as np

from softreach.kernels.compiler import strict

__all__ = ["fill_triangles"]


@strict
def fill_triangles(triangles, work, keys):
    """Keep the larger key at every pixel whose center lies in a triangle.

    Args:
        triangles: Column, row, depth, red, green and blue at each corner, shape (n, 3, 6); pixel
            (i, j) covers rows i to i + 1 and columns j to j + 1.
        work: Room for twelve numbers, shape (2, 6).
        keys: Depth above color (see `pixel_key`), shape (rows, columns); changed.
    """
    left, slope = work
    for t in range(len(triangles)):
        low = min(triangles[t, 0, 1], triangles[t, 1, 1], triangles[t, 2, 1])
        high = max(triangles[t, 0, 1], triangles[t, 1, 1], triangles[t, 2, 1])
        for row in range(next_center(low, keys.shape[0]), next_center(high, keys.shape[0])):
            right = span(triangles, t, row + 0.5, left, slope)
            first = next_center(left[0], keys.shape[1])
            for column in range(first, next_center(np.nextafter(right, np.inf), keys.shape[1])):
                key = pixel_key(column + 0.5 - left[0], left, slope)
                if key > keys[row, column]:
                    keys[row, column] = key


@strict
def next_center(edge, count):
    """The first pixel whose center is at or after an edge, within 0 to count."""
    return np.int64(np.ceil(min(max(edge - 0.5, 0.0), np.float64(count))))


@strict
def span(triangles, t, height, left, slope):
    """Write the values at the left end of a row and their growth; return the right end."""
    enter, leave, first, last = 0, 0, np.inf, -np.inf
    enter_share, leave_share = 0.0, 0.0
    for i in range(3):
        j = (i + 1) % 3
        rise = triangles[t, j, 1] - triangles[t, i, 1]
        if rise == 0.0:
            continue
        share = (height - triangles[t, i, 1]) / rise
        if share < 0.0 or share > 1.0:
            continue
        x = triangles[t, i, 0] + share * (triangles[t, j, 0] - triangles[t, i, 0])
        if x < first:
            enter, enter_share, first = i, share, x
        if x > last:
            leave, leave_share, last = i, share, x
    width = max(last - first, 1e-12)
    left[0] = first
    for k in range(2, 6):
        a, b = triangles[t, enter, k], triangles[t, (enter + 1) % 3, k]
        left[k] = a + enter_share * (b - a)
        a, b = triangles[t, leave, k], triangles[t, (leave + 1) % 3, k]
        slope[k] = (a + leave_share * (b - a) - left[k]) / width
    return last


@strict
def pixel_key(along, left, slope):
    """Depth in the high half, in unsigned order; red, green, blue, 255 in the low."""
    depth = np.float32(along * slope[2] + left[2]).view(np.uint32)
    ordered = ~depth if depth >> np.uint32(31) else depth | np.uint32(0x80000000)
    key = np.uint64(ordered)
    for k in range(3, 6):
        key = key << np.uint64(8) | np.uint64(np.rint(along * slope[k] + left[k]))
    return key << np.uint64(8) | np.uint64(255)
