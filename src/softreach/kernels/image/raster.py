"""How often a mapped box covers the cell centers of a grid: lines of sight through triangles.

Along a line of sight, each mapped tetrahedron is entered through one of its faces and left through
another. Summed over all tetrahedra, a triangle adds to the number of those that cover a place
behind it the tetrahedra on its far side minus those on its near side: nothing where the map passes
straight through. What remains, the critical triangles, are the images of the box's own boundary and
the folds, one dimension lower than the box, and only that is rasterized.

Next to a fold the map is nearly flat and the linear images of its tetrahedra zigzag: they lie upon
each other up to a hundred times where the map itself reaches a place twice. So a tetrahedron whose
image is turned over where det J > 0, or is not where det J < 0, counts as -1: the layers of a
zigzag cancel, and what is counted is how often each side of the fold covers a place.

Vertices are whole numbers, stored as floats, small enough for every determinant and comparison to
be exact: mapped tetrahedra share their faces to the last bit, and flat ones cover nothing. A line
that meets an edge or a vertex counts as shifted by (ε, ε²), the same for every triangle, so that
one of those around it is hit and not two or none. A center on a triangle counts as behind it.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.compiler import kernel, strict
from softreach.kernels.image.activation_mesh import chains, corner_bits, corner_steps
from softreach.kernels.vector import strict_cross as cross
from softreach.kernels.vector import strict_difference as difference
from softreach.kernels.vector import strict_dot as dot
from softreach.kernels.vector import strict_minus as minus
from softreach.kernels.vector import strict_times as times

EXACT_BITS = 16
"""Bits of the largest difference of two vertices of a simplex: 3 · 16 + 3 of a float's 53."""

Ints = NDArray[np.int64]


class Star(NamedTuple):
    """The triangles of a grid of boxes with least vertex 0, and the tetrahedra around each."""

    triangles: Ints
    """Axes along which it needs room above (bits), steps to its 2nd and 3rd vertex; (t, 3)."""
    apexes: Ints
    """For each tetrahedron on it: axes along which it needs room above and below (bits), step to
    its fourth vertex, orientation in the box; (k, 4)."""
    ranges: Ints  # the apexes of triangle i are those from ranges[i] to ranges[i + 1]; (t + 1,)


@lru_cache(maxsize=16)
def stars(cells: tuple[int, int, int]) -> Star:
    """Triangles of the Freudenthal triangulation of a grid of boxes."""
    steps, faces = corner_steps(cells), chains(3, 2)
    around = [_apexes(steps, chain) for chain in faces]
    return Star(
        np.column_stack([faces[:, 2], steps[faces[:, 1]], steps[faces[:, 2]]]),
        np.array([apex for group in around for apex in group], np.int64),
        np.cumsum([0] + [len(group) for group in around]),
    )


def _apexes(steps: Ints, chain: Ints) -> list[tuple[int, int, int, int]]:
    """Every way to make the chain of a triangle longer by one, at its lower end too."""
    first, last, corners = int(chain[1]), int(chain[2]), range(1, 8)
    bits = corner_bits(3)

    def turn(arrow: Ints) -> int:
        return round(np.linalg.det(np.array([bits[first], bits[last], arrow])))

    between = [c for c in corners if _inside(c, first) or (_inside(first, c) and _inside(c, last))]
    beyond = [c for c in corners if _inside(last, c)]
    before = [c for c in corners if c & last == 0]
    return [(c | last, 0, int(steps[c]), turn(bits[c])) for c in between + beyond] + [
        (last, c, -int(steps[c]), turn(-bits[c])) for c in before
    ]


def _inside(small: int, large: int) -> bool:
    return small & large == small and small != large


@strict
def stretches(points, cells):
    """Eight times det J at mapped vertices (n, 3), per cell, from differences of neighbors."""
    rows, layer = cells[2] + 1, (cells[1] + 1) * (cells[2] + 1)
    out = np.empty(len(points))
    for v in range(len(points)):
        first = slope(points, v, v // layer, cells[0], layer)
        second = slope(points, v, v % layer // rows, cells[1], rows)
        third = slope(points, v, v % rows, cells[2], np.intp(1))  # typed: compiled once
        out[v] = dot(cross(first, second), third)
    return out


@strict
def slope(points, v, at, cells, step):
    """Twice the derivative along an axis, at its vertex number `at`."""
    if 0 < at < cells:
        return difference(points, v + step, v - step)
    inward, sign = (step, 1.0) if at == 0 else (-step, -1.0)
    near = difference(points, v + inward, v)
    if cells == 1:
        return times(2.0 * sign, near)
    far = difference(points, v + 2 * inward, v)
    return minus(times(4.0 * sign, near), times(sign, far))


@strict
def critical_triangles(points, stretches, cells, left_out, first, last, star, out):
    """Number of triangles with least vertex in first..last around which the images do not balance.

    Points are mapped vertices (n, 3) in whole numbers and the C order of the grid; the sum of their
    stretches, det J in whole numbers, says which orientation a tetrahedron should have; cells with
    least vertex in `left_out` (n,) have no image. Rows of `out` hold the three vertices; tetrahedra
    on the side of its normal (b - a) × (c - a) minus those on the other, each 1 if oriented as it
    should be, else -1; the same with 1 if it keeps the orientation, else -1.
    """
    triangles, apexes, ranges = star
    count = 0
    for v in range(first, last):
        above, below = room(cells, v)
        for t in range(len(triangles)):
            if triangles[t, 0] & ~above:
                continue
            b, c = v + triangles[t, 1], v + triangles[t, 2]
            normal = cross(difference(points, b, v), difference(points, c, v))
            stretch = stretches[v] + stretches[b] + stretches[c]
            balance, turns = 0, 0
            for k in range(ranges[t], ranges[t + 1]):
                if apexes[k, 0] & ~above or apexes[k, 1] & ~below:
                    continue
                apex = v + apexes[k, 2]
                if left_out[min(v, apex)]:  # the least vertex tells whose cell it is
                    continue
                # side times orientation, which is side · turn
                turn = apexes[k, 3] * (dot(normal, difference(points, apex, v)) != 0)
                balance += turn if stretch + stretches[apex] > 0 else -turn
                turns += turn
            if balance != 0 or turns != 0:
                out[count, 0], out[count, 1], out[count, 2] = v, b, c
                out[count, 3], out[count, 4] = balance, turns
                count += 1
    return count


@strict
def room(cells, v):
    """Axes (as bits) along which vertex v has a cell above it, and one below it."""
    above, below = 0, 0
    for j in (2, 1, 0):
        at = v % (cells[j] + 1)
        v //= cells[j] + 1
        above |= (at < cells[j]) << j
        below |= (at > 0) << j
    return above, below


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
