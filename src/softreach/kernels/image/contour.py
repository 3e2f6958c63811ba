"""The critical triangles of a mapped box: those that the map does not pass straight through.

Along a line of sight, each mapped tetrahedron is entered through one of its faces and left through
another. Summed over all tetrahedra, a triangle adds to the number of those that cover a place
behind it the tetrahedra on its far side minus those on its near side: nothing where the map passes
straight through. What remains are the images of the box's own boundary and the folds, one dimension
lower than the box, and only that is rasterized.

Next to a fold the map is nearly flat and the linear images of its tetrahedra zigzag: they lie upon
each other up to a hundred times where the map itself reaches a place twice. So a tetrahedron whose
image is turned over where det J > 0, or is not where det J < 0, counts as -1: the layers of a
zigzag cancel, and what is counted is how often each side of the fold covers a place.

Vertices are whole numbers, stored as floats, small enough for every determinant to be exact: mapped
tetrahedra share their faces to the last bit, and flat ones cover nothing.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.box.simplices import chains, corner_bits, corner_steps
from softreach.kernels.compiler import strict
from softreach.kernels.strict_vector import cross, difference, dot, minus, times

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
