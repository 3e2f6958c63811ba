"""The activation box in cells of six tetrahedra each, whose images are known at their corners.

Within a tetrahedron the map is replaced by its linear interpolant; the second differences of the
Jacobians at the corners tell how far the true image may lie from the linear one.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.simplices import kuhn_simplices
from softreach.kernels.vector import cross, difference, dot, matrix, minus, row, times

__all__ = [
    "ActivationMesh",
    "face_planes",
    "image_faces",
    "interpolation_errors",
    "tetrahedron",
]

# Each tetrahedron of a cell walks from corner 0 to corner 7 by these two, along axes in some order.
_PATHS = tuple((int(second), int(third)) for _, second, third, _ in kuhn_simplices(3))

_EDGES = tuple((a, b) for a in range(8) for b in range(a + 1, 8) if a & b == a)
_SAFETY = 1.25  # for derivatives of higher order
_SHARE = _SAFETY * 3.0 / 16.0  # of a second difference


class ActivationMesh(NamedTuple):
    """Cells of the activation box and their images."""

    gamma: np.ndarray
    """Vertices [-], shape (vertex, 3)."""
    tip: np.ndarray
    """Their tips [m], shape (vertex, 3)."""
    slope: np.ndarray
    """Their position Jacobians [m], shape (vertex, 3, 3)."""
    corner: np.ndarray
    """Vertices of each cell, bit j of a corner along axis j, shape (cell, 8)."""
    interpolation_error: np.ndarray
    """How far the true image may lie from the linear one [m], shape (cell,)."""
    slope_change: np.ndarray
    """How much the Jacobian changes across the cell at most [m], shape (cell,)."""


@kernel
def interpolation_errors(gamma, slope, corner, out):
    """Estimate the largest interpolation error of every cell from second differences.

    On a simplex a quadratic differs from its linear interpolant by ½ Σ λi λj f''[eij, eij], i < j,
    with Σ λi λj <= 3/8, hence by at most 3/16 of the largest |f''[e, e]| = |ΔJ e| of its edges.
    For quadratics the result is therefore a bound, 1.25 times the sharp one. For other maps ΔJ e is
    the mean of f''[e, e] along the edge and the result is an estimate, not a bound: it fails where
    f'' changes across one cell by more than its own size, as at an inflection of x³, where ΔJ = 0.
    `design/inverse.md` has what was measured on arms.
    """
    for c in range(corner.shape[0]):
        worst = 0.0
        for a, b in _EDGES:
            bend = _second_difference(gamma, slope, corner[c, a], corner[c, b])
            worst = max(worst, dot(bend, bend))
        out[c] = _SHARE * math.sqrt(worst)


@kernel
def face_planes(mesh, rounding, planes):
    """Planes round the inflated images: n·p >= d for unit normals n, shape (6 cells, 4, 4)."""
    for c in range(mesh.corner.shape[0]):
        for which in range(6):
            v = tetrahedron(mesh.corner, c, which)
            base, det, normals = image_faces(mesh.tip, v)
            for i in range(4):
                n = normals[i]
                size = math.sqrt(dot(n, n))
                scale = 1.0 / size if size > 0 else 0.0
                offset = -det if i == 0 else 0.0
                for k in range(3):
                    planes[6 * c + which, i, k] = scale * n[k]
                unit = times(scale, n)
                error = _error_along(mesh.gamma, mesh.slope, v, unit) + rounding
                planes[6 * c + which, i, 3] = dot(base, unit) + scale * offset - error


@inline
def _error_along(gamma, slope, v, n):
    """How far the true image may lie beyond the linear one along n: see `interpolation_errors`."""
    worst = 0.0
    for a, b in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
        worst = max(worst, abs(dot(n, _second_difference(gamma, slope, v[a], v[b]))))
    return _SHARE * worst


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
def tetrahedron(corner, c, which):
    """The four vertices of one of the tetrahedra of cell c."""
    second, third = _PATHS[which]
    return corner[c, 0], corner[c, second], corner[c, third], corner[c, 7]


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
