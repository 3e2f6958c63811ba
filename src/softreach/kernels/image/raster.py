"""Counting what covers the cell centers of a grid: lines of sight through critical triangles.

Vertices are whole numbers, stored as floats, small enough for every comparison here to be exact
(see `contour`). A line that meets an edge or a vertex counts as shifted by (ε, ε²), the same for
every triangle, so that one of those around it is hit and not two or none. A center on a triangle
counts as behind it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.compiler import kernel, strict

Ints = NDArray[np.int64]


class Crossings(NamedTuple):
    """Crossings of lines of sight and critical triangles, one row each."""

    column: Ints  # number of the line, (i, j) as i · width + j
    center: Ints  # number of the first cell center behind it, or on it
    height: NDArray[np.float64]  # position along the line, in cells
    cover: Ints  # by how much the number of covering tetrahedra grows there
    degree: Ints  # by how much the sum of their orientations grows there
    triangle: Ints  # number of the triangle


def empty_crossings(size: int) -> Crossings:
    """Room for as many crossings."""
    column, center, cover, degree, triangle = np.empty((5, size), np.int64)
    return Crossings(column, center, np.empty(size), cover, degree, triangle)


@strict
def most_crossings(points, triangles, unit, p, q):
    """An upper bound of the number of crossings, from the triangles' bounding boxes."""
    count = 0
    for t in range(len(triangles)):
        low_p, high_p = centers_within(points, triangles, t, unit, p)
        low_q, high_q = centers_within(points, triangles, t, unit, q)
        count += max(0, high_p - low_p) * max(0, high_q - low_q)
    return count


@strict
def crossings(points, triangles, unit, axis, width, out):
    """Cross all triangles with lines of sight through cell centers along an axis; return how many.

    Points (n, 3) are whole numbers, of which cell centers are multiples of `unit`, a power of two;
    triangles are rows of `critical_triangles`; `width` cells lie along the axis before, cyclically.
    """
    p, q = (axis + 1) % 3, (axis + 2) % 3
    count = 0
    for t in range(len(triangles)):
        a, b, c, side = upward(points, triangles, t, p, q)
        if side == 0:
            continue
        low, high = centers_within(points, triangles, t, unit, q)
        area = twice_area(points, a, b, points[c, p], points[c, q], p, q)
        rise_b, rise_c = points[b, axis] - points[a, axis], points[c, axis] - points[a, axis]
        for i in range(*centers_within(points, triangles, t, unit, p)):
            for j in range(low, high):
                x, y = i * unit, j * unit
                at_c = twice_area(points, a, b, x, y, p, q)
                at_a = twice_area(points, b, c, x, y, p, q)
                at_b = area - at_a - at_c
                if (
                    left_of_edge(points, a, b, at_c, p, q)
                    and left_of_edge(points, b, c, at_a, p, q)
                    and left_of_edge(points, c, a, at_b, p, q)
                ):
                    rise = at_b * rise_b + at_c * rise_c
                    out.column[count] = i * width + j
                    out.height[count] = (points[a, axis] + rise / area) / unit
                    out.center[count] = center_behind(points[a, axis], rise, area, unit)
                    out.cover[count] = side * triangles[t, 3]
                    out.degree[count] = side * triangles[t, 4]
                    out.triangle[count] = t
                    count += 1
    return count


@strict
def centers_within(points, triangles, t, unit, axis):
    """Centers from the first to one past the last within a triangle's extent along an axis."""
    low, high = extent(points, triangles, t, axis)
    return int(np.ceil(low / unit)), int(np.floor(high / unit)) + 1


@strict
def extent(points, triangles, t, axis):
    """Least and largest coordinate of a triangle along an axis."""
    a = points[triangles[t, 0], axis]
    b = points[triangles[t, 1], axis]
    c = points[triangles[t, 2], axis]
    return min(a, b, c), max(a, b, c)


@strict
def upward(points, triangles, t, p, q):
    """Vertices, counterclockwise along the line; 1, -1 if turned over, 0 if the line grazes it."""
    a, b, c = triangles[t, 0], triangles[t, 1], triangles[t, 2]
    area = twice_area(points, a, b, points[c, p], points[c, q], p, q)
    if area < 0:
        return a, c, b, -1
    return a, b, c, int(area > 0)


@strict
def twice_area(points, a, b, x, y, p, q):
    """Twice the area of the triangle of vertices a, b and (x, y), positive if counterclockwise."""
    along, across = points[b, p] - points[a, p], points[b, q] - points[a, q]
    return along * (y - points[a, q]) - across * (x - points[a, p])


@strict
def left_of_edge(points, a, b, area, p, q):
    """True if (x + ε, y + ε²) is on the left of edge ab, given twice the area at ε = 0."""
    if area != 0:
        return area > 0
    across = points[b, q] - points[a, q]
    return across < 0 or (across == 0 and points[b, p] > points[a, p])


@strict
def center_behind(base, rise, area, unit):
    """The smallest k with k · unit >= base + rise / area, exactly."""
    k = int(np.ceil((base + rise / area) / unit))
    if (k * unit - base) * area < rise:
        return k + 1
    if ((k - 1) * unit - base) * area >= rise:
        return k - 1
    return k


@strict
def add_counts(crossing, counts, degrees):
    """Count cover and degrees (columns, centers), 0 before, of crossings along the last axis."""
    for e in range(len(crossing.column)):
        counts[crossing.column[e], crossing.center[e]] += crossing.cover[e]
        degrees[crossing.column[e], crossing.center[e]] += crossing.degree[e]
    for column in range(len(counts)):
        for k in range(1, counts.shape[1]):
            counts[column, k] += counts[column, k - 1]
            degrees[column, k] += degrees[column, k - 1]


@strict
def bin_triangles(points, triangles, unit, shape):
    """Triangles over each of shape[0] x shape[1] squares in x and y, of an edge `unit`.

    Returned are those of square 0, of square 1, ..., and where each square's begin.
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
    """Number (k,) of tetrahedra that cover points `where` (k, 3), by what `bin_triangles` made."""
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


@kernel
def claim_corners(points, number, steps, closest, owner):
    """Let each point claim the corners of its cube that none before it is as close to.

    Points (n, 3) are in cells within the lattice. Where one is closer than `closest`, it is lowered
    and its number goes to `owner`: flat arrays, in which the next centers are `steps` (3,) away.
    """
    for n in range(len(points)):
        x, y, z = points[n, 0], points[n, 1], points[n, 2]
        i, j, k = np.int64(x), np.int64(y), np.int64(z)
        for corner in range(8):
            a, b, c = i + (corner >> 2), j + (corner >> 1 & 1), k + (corner & 1)
            away = math.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2)
            cell = a * steps[0] + b * steps[1] + c * steps[2]
            if away < closest[cell]:
                closest[cell], owner[cell] = away, number[n]
