"""Triangles to pixels, row by row: only pixels that are covered are ever computed."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

__all__ = ["filled_pixels"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PIXELS = 1 << 17  # at a time: temporary arrays stay in the MB


def filled_pixels(triangles: Array, shape: tuple[int, int]) -> Iterator[tuple[Index, Index, Array]]:
    """The pixels whose centers lie in triangles, with what the corners carry, blended linearly.

    Args:
        triangles: Column, row and any number of values at each corner, shape (n, 3, 2 + values);
            pixel (i, j) covers rows i to i + 1 and columns j to j + 1.
        shape: Rows and columns of the image; what lies outside is left out.

    Yields:
        Rows, columns and values, shape (p,), (p,), (p, values), a bounded number at a time.
    """
    count = 1 + _PIXELS // 16
    for start in range(0, len(triangles), count):
        chunk = triangles[start : start + count]
        first = _next_center(chunk[..., 1].min(axis=1), shape[0])
        last = _next_center(chunk[..., 1].max(axis=1), shape[0])
        owner, row = _ranges(first, last - first)
        for part in _bounded(np.full(len(row), 16)):
            yield from _fill_spans(chunk[owner[part]], row[part], shape[1])


def _fill_spans(triangles: Array, row: Index, columns: int) -> Iterator[tuple[Index, Index, Array]]:
    """Fill one row of each triangle."""
    left, right = _span_ends(triangles, row.astype(float) + 0.5)
    first = _next_center(left[:, 0], columns)
    length = _next_center(np.nextafter(right[:, 0], np.inf), columns) - first
    # one row for each value, since NumPy is slow along an axis of four
    starts, slopes = left[:, 1:].T.copy(), (right[:, 1:] - left[:, 1:]).T.copy()
    slopes /= np.maximum(right[:, 0] - left[:, 0], 1e-12)
    for part in _bounded(length):
        owner, column = _ranges(first[part], length[part])
        along = column + 0.5 - left[part, 0][owner]
        values = np.empty((len(starts), len(owner)))
        for value, start, slope in zip(values, starts[:, part], slopes[:, part], strict=True):
            np.multiply(along, slope[owner], out=value)
            value += start[owner]
        yield row[part][owner], column, values.T


def _span_ends(triangles: Array, height: Array) -> tuple[Array, Array]:
    """Where a horizontal line enters and leaves each triangle: column and values."""
    start, stop = triangles, np.roll(triangles, -1, axis=1)
    rise = stop[..., 1] - start[..., 1]
    above = height[:, None] - start[..., 1]
    share = np.divide(above, rise, out=np.full_like(above, -1.0), where=rise != 0)
    crossed = (share >= 0) & (share <= 1)
    # at least two sides are crossed, since the line lies between the highest and lowest corner
    share = np.where(crossed, share, 0.0)[..., None]
    points = np.delete(start + share * (stop - start), 1, axis=2)
    every = np.arange(len(triangles))
    enter = np.where(crossed, points[..., 0], np.inf).argmin(axis=1)
    leave = np.where(crossed, points[..., 0], -np.inf).argmax(axis=1)
    return points[every, enter], points[every, leave]


def _next_center(edge: Array, count: int) -> Index:
    """The first pixel whose center is at or after an edge, within 0 to count."""
    return np.ceil(np.clip(edge - 0.5, 0, count)).astype(np.int64)


def _ranges(first: Index, length: Index) -> tuple[Index, Index]:
    """first[k], first[k] + 1, ... for length[k] numbers, one after another, each with its k."""
    length = np.maximum(length, 0)
    owner = np.repeat(np.arange(len(first)), length)
    before = np.cumsum(length) - length
    return owner, np.arange(len(owner)) - before[owner] + first[owner]


def _bounded(sizes: Index) -> Iterator[slice]:
    """Slices of consecutive items whose sizes add up to about `_PIXELS`."""
    bins = np.cumsum(np.maximum(sizes, 0)) // _PIXELS
    edges = np.flatnonzero(np.diff(bins, prepend=-1, append=-1))
    for start, stop in itertools.pairwise(edges):
        yield slice(start, stop)
