"""Images of the cells of the activation box: six tetrahedra each, mapped linearly by their corners.

The true image of a tetrahedron lies within a blur of the linear one, which the Jacobians at its
corners bound.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.simplices import kuhn_simplices

__all__ = [
    "Mesh",
    "blurs",
    "cross",
    "dot",
    "face_planes",
    "faces",
    "minus",
    "tetrahedron",
]

# Each tetrahedron of a cell walks from corner 0 to corner 7 by these two, along axes in some order.
_PATHS = tuple((int(second), int(third)) for _, second, third, _ in kuhn_simplices(3))
_EDGES = tuple((a, b) for a in range(8) for b in range(a + 1, 8) if a & b == a)
_SHARE = 1.25 * 3.0 / 16.0  # of a second difference, with a quarter for safety


class Mesh(NamedTuple):
    """Cells of the activation box and their images."""

    gamma: np.ndarray
    """Vertices [-], shape (vertex, 3)."""
    tip: np.ndarray
    """Their tips [m], shape (vertex, 3)."""
    slope: np.ndarray
    """Their position Jacobians [m], shape (vertex, 3, 3)."""
    corner: np.ndarray
    """Vertices of each cell, bit j of a corner along axis j, shape (cell, 8)."""
    blur: np.ndarray
    """How far the true image may lie from the linear one [m], shape (cell,)."""
    change: np.ndarray
    """How much the Jacobian changes across the cell at most [m], shape (cell,)."""


@kernel
def blurs(gamma, slope, corner, out):
    """Bound the interpolation error of every cell from the second differences along its edges.

    A quadratic differs from its linear interpolant on a simplex by ½ Σ λi λj f''[eij, eij], which
    is at most 3/16 of the largest f''[e, e] ≈ ΔJ e: Σ λi λj <= 3/8.
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
        for path in range(6):
            v = tetrahedron(mesh.corner, c, path)
            base, det, normals = faces(mesh.tip, v)
            for i in range(4):
                n = normals[i]
                size = math.sqrt(dot(n, n))
                scale = 1.0 / size if size > 0 else 0.0
                offset = -det if i == 0 else 0.0
                for k in range(3):
                    planes[6 * c + path, i, k] = scale * n[k]
                unit = _times(scale, n)
                blur = _blur_along(mesh.gamma, mesh.slope, v, unit) + rounding
                planes[6 * c + path, i, 3] = dot(base, unit) + scale * offset - blur


@inline
def _blur_along(gamma, slope, v, n):
    """How far the true image may lie beyond the linear one along n: see `blurs`."""
    worst = 0.0
    for a, b in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
        worst = max(worst, abs(dot(n, _second_difference(gamma, slope, v[a], v[b]))))
    return _SHARE * worst


@inline
def _second_difference(gamma, slope, i, j):
    """f''[e, e] ≈ ΔJ e along the edge e from vertex i to vertex j."""
    e = _apart(gamma, j, i)
    return (
        dot(
            (
                slope[j, 0, 0] - slope[i, 0, 0],
                slope[j, 0, 1] - slope[i, 0, 1],
                slope[j, 0, 2] - slope[i, 0, 2],
            ),
            e,
        ),
        dot(
            (
                slope[j, 1, 0] - slope[i, 1, 0],
                slope[j, 1, 1] - slope[i, 1, 1],
                slope[j, 1, 2] - slope[i, 1, 2],
            ),
            e,
        ),
        dot(
            (
                slope[j, 2, 0] - slope[i, 2, 0],
                slope[j, 2, 1] - slope[i, 2, 1],
                slope[j, 2, 2] - slope[i, 2, 2],
            ),
            e,
        ),
    )


@inline
def tetrahedron(corner, c, path):
    """The four vertices of one of the tetrahedra of cell c."""
    second, third = _PATHS[path]
    return corner[c, 0], corner[c, second], corner[c, third], corner[c, 7]


@inline
def faces(tip, v):
    """A tetrahedron's image: a corner, det >= 0, inward normals as long as the faces are large."""
    base = (tip[v[0], 0], tip[v[0], 1], tip[v[0], 2])
    d1, d2, d3 = _apart(tip, v[1], v[0]), _apart(tip, v[2], v[0]), _apart(tip, v[3], v[0])
    side = 1.0 if dot(d1, cross(d2, d3)) >= 0 else -1.0
    n1, n2, n3 = (
        _times(side, cross(d2, d3)),
        _times(side, cross(d3, d1)),
        _times(side, cross(d1, d2)),
    )
    n0 = (-n1[0] - n2[0] - n3[0], -n1[1] - n2[1] - n3[1], -n1[2] - n2[2] - n3[2])
    return base, dot(d1, n1), (n0, n1, n2, n3)


@inline
def _apart(t, a, b):
    return t[a, 0] - t[b, 0], t[a, 1] - t[b, 1], t[a, 2] - t[b, 2]


@inline
def minus(a, b):
    """A - b."""
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline
def _times(s, a):
    return s * a[0], s * a[1], s * a[2]


@inline
def cross(a, b):
    """A × b."""
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def dot(a, b):
    """A · b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
