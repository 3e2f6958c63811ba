"""Where to start looking: which tetrahedra of the activation box map onto a target, nearly.

A cell of the box is cut into six tetrahedra, each mapped linearly by its corners. The true image of
a tetrahedron lies within the cell's `blur` of that linear one, so a target's solutions all lie in
tetrahedra whose image, inflated by the blur, contains it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.simplices import kuhn_simplices
from softreach.kernels.space_tree import holds, leaf_at

__all__ = ["MOST", "Mesh", "blurs", "face_planes", "find_starts"]

MOST = 1024
"""Starts kept for one target; a fold to a point has a whole curve of them."""

# Each tetrahedron of a cell walks from corner 0 to corner 7 by these two, along axes in some order.
_PATHS = tuple((int(second), int(third)) for _, second, third, _ in kuhn_simplices(3))
_EDGES = tuple((a, b) for a in range(8) for b in range(a + 1, 8) if a & b == a)
_SAME = 0.1  # starts nearer than this, in widths of their cells, lead to one solution
_SHARE = 1.25 * 3.0 / 16.0  # of a second difference, with a quarter for safety
_ROUNDS = 6
_BEYOND = 0.5  # how far outside a tetrahedron its quadratic is followed, in barycentric units
_CLOSE, _REST = 0.01, 0.4  # of the blur: good enough to end, good enough to keep


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

    A quadratic differs from its linear interpolant on a simplex by ½ Σ λi λj f''[eij, eij], which is
    at most 3/16 of the largest f''[e, e] ≈ ΔJ e: Σ λi λj <= 3/8.
    """
    for c in range(corner.shape[0]):
        worst = 0.0
        for a, b in _EDGES:
            bend = _second_difference(gamma, slope, corner[c, a], corner[c, b])
            worst = max(worst, _dot(bend, bend))
        out[c] = _SHARE * math.sqrt(worst)


@kernel
def face_planes(mesh, rounding, planes):
    """Planes round the inflated images: n·p >= d for unit normals n, shape (6 cells, 4, 4)."""
    for c in range(mesh.corner.shape[0]):
        for path in range(6):
            v = _tetrahedron(mesh.corner, c, path)
            base, det, normals = _faces(mesh.tip, v)
            for i in range(4):
                n = normals[i]
                size = math.sqrt(_dot(n, n))
                scale = 1.0 / size if size > 0 else 0.0
                offset = -det if i == 0 else 0.0
                for k in range(3):
                    planes[6 * c + path, i, k] = scale * n[k]
                unit = _times(scale, n)
                blur = _blur_along(mesh.gamma, mesh.slope, v, unit) + rounding
                planes[6 * c + path, i, 3] = _dot(base, unit) + scale * offset - blur


@inline
def _blur_along(gamma, slope, v, n):
    """How far the true image may lie beyond the linear one along n: see `blurs`."""
    worst = 0.0
    for a, b in ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)):
        worst = max(worst, abs(_dot(n, _second_difference(gamma, slope, v[a], v[b]))))
    return _SHARE * worst


@inline
def _second_difference(gamma, slope, i, j):
    """f''[e, e] ≈ ΔJ e along the edge e from vertex i to vertex j."""
    e = _apart(gamma, j, i)
    return (
        _dot(
            (
                slope[j, 0, 0] - slope[i, 0, 0],
                slope[j, 0, 1] - slope[i, 0, 1],
                slope[j, 0, 2] - slope[i, 0, 2],
            ),
            e,
        ),
        _dot(
            (
                slope[j, 1, 0] - slope[i, 1, 0],
                slope[j, 1, 1] - slope[i, 1, 1],
                slope[j, 1, 2] - slope[i, 1, 2],
            ),
            e,
        ),
        _dot(
            (
                slope[j, 2, 0] - slope[i, 2, 0],
                slope[j, 2, 1] - slope[i, 2, 1],
                slope[j, 2, 2] - slope[i, 2, 2],
            ),
            e,
        ),
    )


@kernel
def find_starts(mesh, tree, targets, low, high, target, cell, start):
    """Activations near each solution of the targets, until the arrays are full.

    Args:
        mesh: Cells of the activation box.
        tree: Where their images lie.
        targets: Targets [m], shape (t, 3).
        low: Lower bounds, shape (3,).
        high: Upper bounds, shape (3,).
        target: Filled with the number of each start's target.
        cell: Filled with its cell.
        start: Filled with the activation, shape (room, 3).

    Returns:
        How many targets are done, and how many starts were found.
    """
    guess = np.empty(3)
    gamma, tip, slope, corner, blur = mesh.gamma, mesh.tip, mesh.slope, mesh.corner, mesh.blur
    planes, item = tree.planes, tree.item
    found = 0
    for t in range(targets.shape[0]):
        if found + MOST > start.shape[0]:
            return t, found
        first = found
        p = (targets[t, 0], targets[t, 1], targets[t, 2])
        begin, end = leaf_at(tree.low, tree.size, tree.child, tree.first, tree.count, p)
        for entry in range(begin, end):
            k = item[entry]
            if found - first < MOST and holds(planes, k, p, (0.0, 0.0, 0.0)):
                c = k // 6
                v = _tetrahedron(corner, c, k % 6)
                weights = _linear_weights(tip, v, p)
                if _refine(gamma, tip, slope, v, weights, p, blur[c], guess) and _is_new(
                    gamma, corner, c, guess, start, first, found
                ):
                    for axis in range(3):
                        start[found, axis] = min(max(guess[axis], low[axis]), high[axis])
                    target[found], cell[found] = t, c
                    found += 1
    return targets.shape[0], found


@inline
def _tetrahedron(corner, c, path):
    """The four vertices of one of the tetrahedra of cell c."""
    second, third = _PATHS[path]
    return corner[c, 0], corner[c, second], corner[c, third], corner[c, 7]


@inline
def _apart(t, a, b):
    return t[a, 0] - t[b, 0], t[a, 1] - t[b, 1], t[a, 2] - t[b, 2]


@inline
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@inline
def _times(s, a):
    return s * a[0], s * a[1], s * a[2]


@inline
def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@inline
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inline
def _faces(tip, v):
    """The image of a tetrahedron: a corner, det >= 0, inward normals as long as the faces are large."""
    base = (tip[v[0], 0], tip[v[0], 1], tip[v[0], 2])
    d1, d2, d3 = _apart(tip, v[1], v[0]), _apart(tip, v[2], v[0]), _apart(tip, v[3], v[0])
    side = 1.0 if _dot(d1, _cross(d2, d3)) >= 0 else -1.0
    n1, n2, n3 = (
        _times(side, _cross(d2, d3)),
        _times(side, _cross(d3, d1)),
        _times(side, _cross(d1, d2)),
    )
    n0 = (-n1[0] - n2[0] - n3[0], -n1[1] - n2[1] - n3[1], -n1[2] - n2[2] - n3[2])
    return base, _dot(d1, n1), (n0, n1, n2, n3)


@inline
def _linear_weights(tip, v, p):
    """Barycentric coordinates of p in a linear image, moved into it."""
    base, det, normals = _faces(tip, v)
    q = _minus(p, base)
    b0, b1 = max(det + _dot(q, normals[0]), 0.0), max(_dot(q, normals[1]), 0.0)
    b2, b3 = max(_dot(q, normals[2]), 0.0), max(_dot(q, normals[3]), 0.0)
    total = b0 + b1 + b2 + b3
    if total > 0:
        return b0 / total, b1 / total, b2 / total, b3 / total
    return 0.25, 0.25, 0.25, 0.25


@inline
def _refine(gamma, tip, slope, v, weights, p, blur, guess):
    """Solve the quadratic through a tetrahedron's tips and slopes, near the tetrahedron.

    At x the average of the corners' expansions, Σ λi (fi + ½ Ji (x - xi)), is exact for quadratics.
    Return whether the target is reached but for the cubic rest.
    """
    for k in range(3):
        guess[k] = (
            weights[0] * gamma[v[0], k]
            + weights[1] * gamma[v[1], k]
            + weights[2] * gamma[v[2], k]
            + weights[3] * gamma[v[3], k]
        )
    last = False
    for _ in range(_ROUNDS):
        r, a = _model(gamma, tip, slope, v, weights, p, guess)
        if _dot(r, r) <= (_CLOSE * blur) ** 2:
            if last:
                return True
            last = True  # close enough, and once more to be closer
        weights, moved = _step(gamma, v, weights, r, a, guess)
        if not moved:
            break
    r, a = _model(gamma, tip, slope, v, weights, p, guess)
    return _dot(r, r) <= (_REST * blur) ** 2


@inline
def _model(gamma, tip, slope, v, weights, p, guess):
    """p minus the quadratic at the guess, and the rows of its slope there."""
    r0, r1, r2 = p
    a00 = a01 = a02 = a10 = a11 = a12 = a20 = a21 = a22 = 0.0
    for i in range(4):
        j, w = v[i], weights[i]
        e0 = 0.5 * (guess[0] - gamma[j, 0])
        e1 = 0.5 * (guess[1] - gamma[j, 1])
        e2 = 0.5 * (guess[2] - gamma[j, 2])
        r0 -= w * (tip[j, 0] + slope[j, 0, 0] * e0 + slope[j, 0, 1] * e1 + slope[j, 0, 2] * e2)
        r1 -= w * (tip[j, 1] + slope[j, 1, 0] * e0 + slope[j, 1, 1] * e1 + slope[j, 1, 2] * e2)
        r2 -= w * (tip[j, 2] + slope[j, 2, 0] * e0 + slope[j, 2, 1] * e1 + slope[j, 2, 2] * e2)
        a00, a01, a02 = a00 + w * slope[j, 0, 0], a01 + w * slope[j, 0, 1], a02 + w * slope[j, 0, 2]
        a10, a11, a12 = a10 + w * slope[j, 1, 0], a11 + w * slope[j, 1, 1], a12 + w * slope[j, 1, 2]
        a20, a21, a22 = a20 + w * slope[j, 2, 0], a21 + w * slope[j, 2, 1], a22 + w * slope[j, 2, 2]
    return (r0, r1, r2), ((a00, a01, a02), (a10, a11, a12), (a20, a21, a22))


@inline
def _step(gamma, v, weights, r, a, guess):
    """A Newton step, cut short where it leaves the neighborhood of the tetrahedron."""
    c0, c1, c2 = _cross(a[1], a[2]), _cross(a[2], a[0]), _cross(a[0], a[1])
    det = _dot(a[0], c0)
    if det == 0.0:
        return weights, False
    y = (
        (c0[0] * r[0] + c1[0] * r[1] + c2[0] * r[2]) / det,
        (c0[1] * r[0] + c1[1] * r[1] + c2[1] * r[2]) / det,
        (c0[2] * r[0] + c1[2] * r[1] + c2[2] * r[2]) / det,
    )
    ahead = _weights(gamma, v, (guess[0] + y[0], guess[1] + y[1], guess[2] + y[2]))
    part = 1.0
    for i in range(4):
        if ahead[i] < -_BEYOND:
            part = min(part, (weights[i] + _BEYOND) / (weights[i] - ahead[i]))
    if part < 1e-3:
        return weights, False
    for k in range(3):
        guess[k] += part * y[k]
    return _weights(gamma, v, guess), True


@inline
def _weights(gamma, v, x):
    """Barycentric coordinates in a Freudenthal tetrahedron, whose edges follow the axes."""
    a, b = v[0], v[3]
    u = (
        (x[0] - gamma[a, 0]) / (gamma[b, 0] - gamma[a, 0]),
        (x[1] - gamma[a, 1]) / (gamma[b, 1] - gamma[a, 1]),
        (x[2] - gamma[a, 2]) / (gamma[b, 2] - gamma[a, 2]),
    )
    first, second = _moved(gamma, v[0], v[1], u), _moved(gamma, v[1], v[2], u)
    third = _moved(gamma, v[2], v[3], u)
    return 1.0 - first, first - second, second - third, third


@inline
def _moved(gamma, a, b, u):
    """The coordinate along the axis on which vertices a and b differ."""
    if gamma[a, 0] != gamma[b, 0]:
        return u[0]
    return u[1] if gamma[a, 1] != gamma[b, 1] else u[2]


@inline
def _is_new(gamma, corner, c, guess, start, begin, end):
    """Whether no start of the target is so near that it leads to the same solution."""
    first, last = corner[c, 0], corner[c, 7]
    for i in range(begin, end):
        apart = 0.0
        for k in range(3):
            width = gamma[last, k] - gamma[first, k]
            apart = max(apart, abs(start[i, k] - guess[k]) / width)
        if apart < _SAME:
            return False
    return True
