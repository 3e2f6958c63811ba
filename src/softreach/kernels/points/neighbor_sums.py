"""Mean distance of values among neighbors in space, over points sorted by one integer key.

The key of a point is (column, place): space is cut into columns at least a radius wide, and places
count along a column. All neighbors of a query then lie in nine columns, in each of them in one
window of consecutive keys. As the queries are in the order of the keys too, windows only move
forward, and there is no table of cells to outgrow its memory when the radius is small or one point
is far away.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from softreach.kernels.compiler import kernel, strict

PLACE_BITS = 21  # of each of the three parts of a key
_ROW = 1 << 2 * PLACE_BITS
_COLUMN = 1 << PLACE_BITS
_DIGIT_BITS = 11
_DIGIT = 1 << _DIGIT_BITS
SHIFTS = tuple(row * _ROW + column * _COLUMN for row in (-1, 0, 1) for column in (-1, 0, 1))
"""Differences from a key to those of the same place in each of the nine columns around."""


@strict
def _place(x, low, scale):
    """Cell of a coordinate: from 1, as a window may begin one cell below the lowest point."""
    return np.int64((x - low) * scale) + 1


@strict
def sort_keys(points, low, scale, keys):
    """Keys (n,) of points (3, n) above a lower corner, in cells of a scale [1/m]; int64."""
    for i in range(len(keys)):
        y = _place(points[0, i], low[0], scale[0])
        z = _place(points[1, i], low[1], scale[1])
        keys[i] = y * _ROW + z * _COLUMN + _place(points[2, i], low[2], scale[2])


@strict
def stable_order(keys, order):
    """Order (n,) of increasing keys >= 0, equal ones as they come, digit by digit from the last.

    Digits in which no two keys differ are left out: most of the 63 bits, as columns are few.
    """
    n, differ = len(keys), np.int64(0)
    for i in range(n):
        order[i] = i
        differ |= keys[i] ^ keys[0]
    now, after = keys.copy(), np.empty_like(keys)
    numbers, turned = order, np.empty_like(order)
    place = np.empty(_DIGIT + 1, np.int64)
    passes = shift = 0
    while shift < 63 and differ >> shift:
        if not (differ >> shift) & 1:
            shift += 1
            continue
        place[:] = 0
        for i in range(n):
            place[((now[i] >> shift) & (_DIGIT - 1)) + 1] += 1
        for digit in range(_DIGIT):
            place[digit + 1] += place[digit]
        for i in range(n):
            digit = (now[i] >> shift) & (_DIGIT - 1)
            to = place[digit]
            place[digit] = to + 1
            after[to], turned[to] = now[i], numbers[i]
        now, after = after, now
        numbers, turned = turned, numbers
        shift += _DIGIT_BITS
        passes += 1
    if passes % 2:  # the last pass went to the other array
        for i in range(n):
            order[i] = numbers[i]


@strict
def window_keys(along, keys, reach, low, scale, first, last):
    """First and last key (n,) between which neighbors within reach lie in the query's own column.

    Of queries with coordinates `along` the columns above the least one, and places of a scale.
    """
    places = np.int64(_COLUMN - 1)
    for i in range(len(keys)):
        column = keys[i] & ~places
        x = max(along[i] - reach, low)
        first[i] = column + _place(x, low, scale)
        last[i] = column + min(_place(along[i] + reach, low, scale), places)


@strict
def _first_at_least(keys, start, wanted):
    """The first index from `start` on whose key is not below `wanted`, by steps that double."""
    n, step = len(keys), 1
    low = high = start
    while high < n and keys[high] < wanted:
        low, high, step = high + 1, high + step, 2 * step
    high = min(high, n)
    while low < high:
        middle = (low + high) >> 1
        if keys[middle] < wanted:
            low = middle + 1
        else:
            high = middle
    return low


@strict
def find_windows(keys, first, last, start, stop):
    """Points from `start` to `stop` (q,) whose keys lie between first and last; all increase."""
    begin = end = 0
    for i in range(len(first)):
        begin = _first_at_least(keys, begin, first[i])
        end = _first_at_least(keys, max(begin, end), last[i] + 1)
        start[i], stop[i] = begin, end


@cache
def neighbor_sums(m):
    """The kernel that adds up |value difference| over neighbors, for values of m components.

    m is a constant of the machine code, so that the loop over components unrolls inside the one
    over points, which then uses the vector unit.
    """

    @kernel
    def sums(points, values, places, amounts, start, stop, square, total, count):
        """Add |value difference| and 1 to total and count (q,) for each point in window and ball.

        Points (3, n) with values (m, n) are in the order of their keys, windows from `start` to
        `stop`; queries have places (q, 3) and amounts (q, m), the closed ball a squared radius.
        """
        for i in range(len(start)):
            x, y, z = places[i, 0], places[i, 1], places[i, 2]
            apart, others = 0.0, 0.0
            for j in range(np.uint64(start[i]), np.uint64(stop[i])):  # no test for negative ones
                dx, dy, dz = points[0, j] - x, points[1, j] - y, points[2, j] - z
                near = dx * dx + dy * dy + dz * dz <= square
                distance = 0.0
                for k in range(m):
                    difference = values[k, j] - amounts[i, k]
                    distance += difference * difference
                apart += np.sqrt(distance) if near else 0.0
                others += 1.0 if near else 0.0
            total[i] += apart
            count[i] += others

    return sums
