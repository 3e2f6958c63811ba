"""Distance between the values of neighbors: a mean over a ball around each of many points."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.kernels.points import neighbor_sums as kernels
from softreach.support import parallel
from softreach.support.arrays import Array, Index, as_points, check_finite

BLOCK = 1 << 14  # queries that one thread takes at a time
_CELLS = 2.0 ** (kernels.PLACE_BITS - 1)  # along an axis; the other half of keys is for windows
_SLACK = 2.0**-20  # of a cell or a radius, far above the rounding of a key
_SMALLEST = 1e-290  # width of a cell


def mean_value_distance(
    points: Array, values: Array, radius: float, queries: Index | None = None
) -> tuple[Array, Index]:
    """Mean ‖v_j - v_i‖₂ over the other points j within a radius of point i, and how many they are.

    The ball is closed, and holds other points at the same place. Points (n, 3) are all neighbors,
    whatever the queries i (q,). Means (q,) of values (n, m) are NaN where there is no neighbor; the
    result does not depend on blocks and threads.
    """
    points, values = as_points("points", points, any_scale=True), check_finite("values", values)
    if len(points) == 0:
        return np.empty(0), np.empty(0, np.intp)
    columns = _Columns(points, float(radius))
    order, cloud = columns.sorted_sample(points, values)
    if queries is None:
        return _means(cloud, columns, cloud, order)
    order, chosen = columns.sorted_sample(points[queries], values[queries])
    return _means(cloud, columns, chosen, order)


class _Sample(NamedTuple):
    """Points sorted by key, each component contiguous."""

    keys: Index  # Shape (n,)
    points: Array  # Shape (3, n); the last axis runs along the columns
    values: Array  # Shape (m, n)


class _Columns:
    """Space cut into columns along the longest side of a cloud, and these into places."""

    def __init__(self, points: Array, radius: float) -> None:
        """Cut columns at least a radius wide for all points, shape (n, 3)."""
        # NumPy is slow along the short axis, so one axis at a time.
        low, high = np.array([[x.min(), x.max()] for x in points.T]).T
        extent = high - low
        self.axes = np.argsort(extent, kind="stable")
        self.low = low[self.axes]
        self.reach = min(radius, 2.0 * float(extent.sum()))  # all points are nearer than that
        wide = self.reach * (1.0 + _SLACK)
        rounding = 2.0**-50 * float(np.abs([low, high]).max())
        self.margin = wide + rounding
        widths = np.maximum(extent[self.axes] / _CELLS, [wide, wide, 0.0])
        self.widths = np.maximum(widths, rounding / _CELLS + _SMALLEST)

    def sorted_sample(self, points: Array, values: Array) -> tuple[Index, _Sample]:
        """Points (n, 3) and values (n, m) in the order of their keys, and that order."""
        points = np.ascontiguousarray(points.T[self.axes])
        keys = np.empty(points.shape[1], np.int64)
        kernels.sort_keys(points, self.low, 1.0 / self.widths, keys)
        order = np.empty(len(keys), np.int64)
        kernels.stable_order(keys, order)
        return order, _Sample(keys[order], _taken(points, order), _taken(values.T, order))


def _means(
    cloud: _Sample, columns: _Columns, queries: _Sample, order: Index
) -> tuple[Array, Index]:
    """Means and numbers of neighbors of sorted queries; results go to the places `order`."""
    mean, others = np.empty(len(order)), np.empty(len(order), np.intp)

    def task(part: slice) -> None:
        total, count = _sums(cloud, columns, queries, part)
        count -= 1.0  # the query itself, at distance zero
        others[order[part]] = count
        total[count == 0] = np.nan
        mean[order[part]] = total / np.maximum(count, 1.0)

    parallel.run(partial(task, part) for part in parallel.blocks(len(order), BLOCK))
    return mean, others


def _sums(cloud: _Sample, columns: _Columns, queries: _Sample, part: slice) -> tuple[Array, Array]:
    """Sum of ‖v_j - v_i‖ over each query's ball, itself included, and the number of points."""
    keys, scale = queries.keys[part], 1.0 / columns.widths[2]
    first, last = np.empty((2, len(keys)), np.int64)  # keys of what each can reach in its column
    along = queries.points[2, part]
    kernels.window_keys(along, keys, columns.margin, columns.low[2], scale, first, last)
    places, amounts = queries.points[:, part].T.copy(), queries.values[:, part].T.copy()
    start, stop = np.empty((2, len(first)), np.int64)
    total, count = np.zeros((2, len(first)))
    add, square = kernels.neighbor_sums(len(cloud.values)), columns.reach**2
    for shift in kernels.SHIFTS:
        kernels.find_windows(cloud.keys, first + shift, last + shift, start, stop)
        add(cloud.points, cloud.values, places, amounts, start, stop, square, total, count)
    return total, count


def _taken(components: Array, order: Index) -> Array:
    """Each component in another order, contiguous."""
    taken = np.empty((len(components), len(order)))
    for source, target in zip(components, taken, strict=True):
        np.take(source, order, out=target, mode="clip")  # "raise" would buffer the output
    return taken
