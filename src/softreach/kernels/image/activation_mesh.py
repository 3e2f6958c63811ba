"""The activation box in cells of six tetrahedra each, whose images are known at their corners.

Tetrahedra are those of Freudenthal and Kuhn, in any dimension: a corner of the unit cube is a bit
mask, bit j its coordinate along axis j. A k-face of the triangulation is a least vertex v of the
grid and a chain of corners 0 = S0 < S1 < ... < Sk, each contained in the next: its vertices are
v + S0, ..., v + Sk.

Within a tetrahedron the map is replaced by its linear interpolant; the second differences of the
Jacobians at the corners tell how far the true image may lie from the linear one.

References:
    Freudenthal (1942), Simplizialzerlegungen von beschränkter Flachheit, Ann. Math. 43, 580-582.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import cross, difference, dot, matrix, minus, row, times

Ints = NDArray[np.int64]


@lru_cache(maxsize=32)
def chains(m: int, k: int) -> Ints:
    """Chains of corners (count, k + 1) that give the k-faces of the m-cube with least vertex 0.

    A face is in a grid if v + Sk is: chains whose last corner leaves out axis j also start at the
    last vertices along j.
    """
    longer = [(0,)]
    for _ in range(k):
        longer = [
            (*chain, corner)
            for chain in longer
            for corner in range(1 << m)
            if corner != chain[-1] and corner & chain[-1] == chain[-1]
        ]
    table = np.array(longer, np.int64).reshape(-1, k + 1)
    table.setflags(write=False)
    return table


def kuhn_simplices(m: int) -> Ints:
    """The simplices (m!, m + 1) from corner 0 to the opposite one, along axes in every order."""
    return chains(m, m)


def corner_bits(m: int) -> Ints:
    """Coordinates 0 or 1 of every corner of the m-cube, shape (2^m, m)."""
    return np.arange(1 << m)[:, None] >> np.arange(m) & 1


def strides(cells: Sequence[int]) -> Ints:
    """Steps in the flat index of the vertices, in C order, of a grid of cells[j] cells along j."""
    vertices = np.array([*cells, 0], np.int64)[1:] + 1
    return np.cumprod(vertices[::-1])[::-1].copy()


def corner_steps(cells: Sequence[int]) -> Ints:
    """Step in the flat index of the vertices from corner 0 of a cell to each corner, (2^m,)."""
    return corner_bits(len(cells)) @ strides(cells)


# Each tetrahedron of a cell walks from corner 0 to corner 7 by these two, along axes in some order.
_PATHS = tuple((int(second), int(third)) for _, second, third, _ in kuhn_simplices(3))
_AXES = tuple(
    (second >> 1, (third ^ second) >> 1, (7 ^ third) >> 1) for second, third in _PATHS
)  # bits 1, 2 and 4 are axes 0, 1 and 2
_EVEN_ORDERS = tuple((b - a) % 3 == 1 for a, b, _ in _AXES)

_EDGES = tuple((a, b) for a in range(8) for b in range(a + 1, 8) if a & b == a)
_SAFETY = 1.25  # for derivatives of higher order
_SHARE = _SAFETY * 3.0 / 16.0  # of a second difference
_PAIRS = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
_CUBIC_SHARE = 0.25  # of the largest cubic difference: twice the worst that was measured
_QUARTIC_SHARE = 0.005  # of the linear error, where cubic differences vanish by chance


class ActivationMesh(NamedTuple):
    """Cells of the activation box and their images."""

    gamma: np.ndarray  # vertices [-], (vertex, 3)
    tip: np.ndarray  # their tips [m], (vertex, 3)
    slope: np.ndarray  # their position Jacobians [m], (vertex, 3, 3)
    corner: np.ndarray  # vertices of each cell, bit j of a corner along axis j, (cell, 8)
    interpolation_error: np.ndarray
    """Largest distance of the true image from the linear one [m], shape (cell,)."""
    remainder: np.ndarray
    """Its largest distance from the quadratic through tips and Jacobians [m], shape (cell,)."""
    slope_change: np.ndarray  # largest change of the Jacobian across the cell [m], (cell,)


@kernel
def interpolation_errors(gamma, tip, slope, corner, error, remainder):
    """Estimate the largest linear and quadratic interpolation errors of every cell.

    On a simplex a quadratic differs from its linear interpolant by ½ Σ λi λj f''[eij, eij], i < j,
    with Σ λi λj <= 3/8, hence by at most 3/16 of the largest |f''[e, e]| = |ΔJ e| of its edges.
    For quadratics the result is a bound, 1.25 times the sharp one; for other maps an estimate that
    fails where f'' changes across one cell by more than its own size (`design/inverse.md`).

    Of cubics the quadratic Σ λi (fi + ½ Ji (x - xi)) is off by Σ λi f'''[di, di, di]/12 with
    di = xi - x; what the trapezoidal rule leaves of an edge, |Δf - ½ (Ja + Jb) e|, is
    |f'''[e, e, e]|/12.
    """
    for c in range(corner.shape[0]):
        worst, cubic = 0.0, 0.0
        for a, b in _EDGES:
            i, j = corner[c, a], corner[c, b]
            bend = _second_difference(gamma, slope, i, j)
            worst = max(worst, dot(bend, bend))
            twist = _cubic_difference(gamma, tip, slope, i, j)
            cubic = max(cubic, dot(twist, twist))
        error[c] = _SHARE * math.sqrt(worst)
        remainder[c] = _CUBIC_SHARE * math.sqrt(cubic) + _QUARTIC_SHARE * error[c]


@kernel
def face_planes(mesh, rounding, planes):
    """Planes round the inflated images: n·p >= d for unit normals n, shape (6 cells, 4, 4).

    Those of the largest faces come first: an image is thinnest across them, so they miss most.
    """
    for c in range(mesh.corner.shape[0]):
        for which in range(6):
            v = tetrahedron(mesh.corner, c, which)
            base, det, normals = image_faces(mesh.tip, v)
            bends = _bends(mesh.gamma, mesh.slope, v)
            for i in range(4):
                n = normals[i]
                size = math.sqrt(dot(n, n))
                scale = 1.0 / size if size > 0 else 0.0
                offset = -det if i == 0 else 0.0
                place = _larger_faces(normals, i)
                for k in range(3):
                    planes[6 * c + which, place, k] = scale * n[k]
                unit = times(scale, n)
                error = _bulge(bends, unit, i, scale * det) + mesh.remainder[c] + rounding
                planes[6 * c + which, place, 3] = dot(base, unit) + scale * offset - error


@inline
def _larger_faces(normals, i):
    """Number of faces that are larger than face i, or as large and before it."""
    size, larger = dot(normals[i], normals[i]), 0
    for j in range(4):
        other = dot(normals[j], normals[j])
        larger += int(other > size or (other == size and j < i))
    return larger


@inline
def _bends(gamma, slope, v):
    """The second differences along the six edges of a tetrahedron."""
    return (
        _second_difference(gamma, slope, v[0], v[1]),
        _second_difference(gamma, slope, v[0], v[2]),
        _second_difference(gamma, slope, v[0], v[3]),
        _second_difference(gamma, slope, v[1], v[2]),
        _second_difference(gamma, slope, v[1], v[3]),
        _second_difference(gamma, slope, v[2], v[3]),
    )


@inline
def _bulge(bends, n, i, height):
    """Largest distance of the quadratic image beyond face i along its inward unit normal n.

    Where λi = t it lies at t height - ½ Σ λj λk n·bend. Only edges along which n·bend > 0 bulge
    outward: of the face by g each, with Σ λj λk g <= (1 - t)² min(max g / 3, Σ g / 4), and those to
    vertex i by at most h.
    """
    most, total, h = 0.0, 0.0, 0.0
    for k in range(6):
        g = max(dot(n, bends[k]), 0.0)
        if _PAIRS[k][0] == i or _PAIRS[k][1] == i:
            h = max(h, g)
        else:
            most, total = max(most, g), total + g
    f = min(most / 3.0, 0.25 * total)
    # The largest f (1 - t)²/2 + h t (1 - t)/2 - height t within 0 <= t <= 1.
    slope = 0.5 * h - f - height
    if slope <= 0.0:
        return 0.5 * f
    t = min(slope / (h - f), 1.0)
    return 0.5 * f + t * (slope - 0.5 * t * (h - f))


@inline
def _second_difference(gamma, slope, i, j):
    """f''[e, e] ≈ ΔJ e along the edge e from vertex i to vertex j."""
    e, at_i, at_j = difference(gamma, j, i), matrix(slope, i), matrix(slope, j)
    return (
        dot(minus(at_j[0], at_i[0]), e),
        dot(minus(at_j[1], at_i[1]), e),
        dot(minus(at_j[2], at_i[2]), e),
    )


@inline
def _cubic_difference(gamma, tip, slope, i, j):
    """-f'''[e, e, e]/12 ≈ Δf - ½ (Ji + Jj) e along the edge e from vertex i to vertex j."""
    e, d, at_i, at_j = (
        difference(gamma, j, i),
        difference(tip, j, i),
        matrix(slope, i),
        matrix(slope, j),
    )
    return (
        d[0] - 0.5 * (dot(at_i[0], e) + dot(at_j[0], e)),
        d[1] - 0.5 * (dot(at_i[1], e) + dot(at_j[1], e)),
        d[2] - 0.5 * (dot(at_i[2], e) + dot(at_j[2], e)),
    )


@inline
def tetrahedron(corner, c, which):
    """The four vertices of one of the tetrahedra of cell c."""
    second, third = _PATHS[which]
    return corner[c, 0], corner[c, second], corner[c, third], corner[c, 7]


@inline
def axes_of(which):
    """The axes of the walk of a tetrahedron from its first vertex to its last."""
    return _AXES[which]


@inline
def orientation(which):
    """The sign of the order of these axes."""
    return 1.0 if _EVEN_ORDERS[which] else -1.0


@inline
def image_faces(tip, v):
    """A tetrahedron's image: a corner, det >= 0, inward normals as long as the faces are large."""
    base = row(tip, v[0])
    d1, d2 = difference(tip, v[1], v[0]), difference(tip, v[2], v[0])
    d3 = difference(tip, v[3], v[0])
    side = 1.0 if dot(d1, cross(d2, d3)) >= 0 else -1.0
    n1, n2, n3 = times(side, cross(d2, d3)), times(side, cross(d3, d1)), times(side, cross(d1, d2))
    n0 = (-n1[0] - n2[0] - n3[0], -n1[1] - n2[1] - n3[1], -n1[2] - n2[2] - n3[2])
    return base, dot(d1, n1), (n0, n1, n2, n3)
