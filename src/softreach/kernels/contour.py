"""The critical triangles of a mapped box: those that the map does not pass straight through.

Along a line of sight, each mapped tetrahedron is entered through one of its faces and left through
another. Summed over all tetrahedra, a triangle adds to the number of those that cover a place
behind it the tetrahedra on its far side minus those on its near side: nothing where the map passes
straight through. What remains are the images of the box's own boundary and the folds, one dimension
lower than the box, and only that is rasterized.

Vertices are whole numbers, stored as floats, small enough for every determinant to be exact: mapped
tetrahedra share their faces to the last bit, and flat ones cover nothing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.compiler import strict
from softreach.kernels.simplices import chains, corner_bits, corner_steps
from softreach.kernels.strict_vector import cross, difference, dot

__all__ = ["EXACT_BITS", "Star", "critical_triangles", "stars"]

EXACT_BITS = 16
"""Bits of the largest difference of two vertices of a simplex: 3 · 16 + 3 of a float's 53."""

Ints = NDArray[np.int64]


class Star(NamedTuple):
    """The triangles of a grid of boxes with least vertex 0, and the tetrahedra around each."""

    triangles: Ints
    """Axes along which it needs room above (bits), steps to its 2nd and 3rd vertex; (t, 3)."""
    apexes: Ints
    """For each tetrahedron on it: axes along which it needs room above and below (bits), step to
    its fourth vertex, orientation in the box (0 if m > 3); (k, 4)."""
    ranges: Ints
    """The apexes of triangle i are those from ranges[i] to ranges[i + 1]; (t + 1,)."""


def stars(cells: tuple[int, ...]) -> Star:
    """Triangles of the Freudenthal triangulation of a grid of boxes, in 3 or more dimensions."""
    m, steps = len(cells), corner_steps(cells)
    faces = chains(m, 2)
    around = [_apexes(m, steps, chain) for chain in faces]
    return Star(
        np.column_stack([faces[:, 2], steps[faces[:, 1]], steps[faces[:, 2]]]),
        np.array([apex for group in around for apex in group], np.int64),
        np.cumsum([0] + [len(group) for group in around]),
    )


def _apexes(m: int, steps: Ints, chain: Ints) -> list[tuple[int, int, int, int]]:
    """Every way to make the chain of a triangle longer by one, at its lower end too."""
    first, last, corners = int(chain[1]), int(chain[2]), range(1, 1 << m)
    bits = corner_bits(m)

    def turn(arrow: Ints) -> int:
        if m > 3:
            return 0
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
def critical_triangles(points, cells, first, last, star, out):
    """Triangles with least vertex in first..last around which the mapped tetrahedra do not balance.

    Args:
        points: Mapped vertices, whole numbers, shape (n, 3), in the C order of the grid.
        cells: Number of cells along each axis, shape (m,).
        first: First vertex of this task.
        last: One past its last.
        star: What `stars` says of one vertex.
        out: Result, one row a triangle: its three vertices; tetrahedra on the side of its normal
            (b - a) × (c - a) minus those on the other; the same weighted with orientation (m = 3).

    Returns:
        Number of rows written.
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
            balance, turns = 0, 0
            for k in range(ranges[t], ranges[t + 1]):
                if apexes[k, 0] & ~above or apexes[k, 1] & ~below:
                    continue
                height = dot(normal, difference(points, v + apexes[k, 2], v))
                side = (height > 0) - (height < 0)
                balance += side
                turns += apexes[k, 3] * side * side
            if balance != 0 or turns != 0:
                out[count, 0], out[count, 1], out[count, 2] = v, b, c
                out[count, 3], out[count, 4] = balance, turns
                count += 1
    return count


@strict
def room(cells, v):
    """Axes (as bits) along which vertex v has a cell above it, and one below it."""
    above, below = 0, 0
    for j in range(len(cells) - 1, -1, -1):
        at = v % (cells[j] + 1)
        v //= cells[j] + 1
        above |= (at < cells[j]) << j
        below |= (at > 0) << j
    return above, below
