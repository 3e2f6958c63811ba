"""Starting points of Newton's method: tetrahedra of the activation box that map onto a target.

A target's solutions lie in tetrahedra whose linear image, inflated by its interpolation error,
contains it. In each of them the quadratic through tips and Jacobians says whether and where.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.activation_mesh import image_faces, tetrahedron
from softreach.kernels.compiler import inline, kernel
from softreach.kernels.space_tree import leaf_at, may_meet
from softreach.kernels.vector import cofactors, combination, dot, minus, row

__all__ = ["MOST_STARTS", "find_starts"]

MOST_STARTS = 1024
"""Starts kept for one target; a fold to a point has a whole curve of them."""

_DISTINCT = 0.1  # starts nearer than this, in widths of their cells, lead to one solution
_ITERATIONS = 6
_OUTSIDE = 0.5  # how far outside a tetrahedron its quadratic is followed, in barycentric units
_CONVERGED, _ACCEPTED = 0.01, 0.4  # residuals at which to end and to keep, in interpolation errors


@kernel
def find_starts(mesh, tree, targets, low, high, with_root, target, cell, start):
    """Activations near each solution of the targets, until the arrays are full.

    Args:
        mesh: Cells of the activation box.
        tree: Where their images lie.
        targets: Targets [m], shape (t, 3).
        low: Lower bounds, shape (3,).
        high: Upper bounds, shape (3,).
        with_root: Whether to leave out tetrahedra whose quadratic does not reach the target.
        target: Filled with the number of each start's target.
        cell: Filled with its cell.
        start: Filled with the activation, shape (room, 3).

    Returns:
        How many targets are done, and how many starts were found.
    """
    guess = np.empty(3)
    gamma, tip, slope, corner = mesh.gamma, mesh.tip, mesh.slope, mesh.corner
    planes, item = tree.planes, tree.item
    found = np.intp(0)  # typed: compiled once
    for t in range(targets.shape[0]):
        if found + MOST_STARTS > start.shape[0]:
            return t, found
        first = found
        p = row(targets, t)
        begin, end = leaf_at(tree.low, tree.size, tree.child, tree.first, tree.length, p)
        for entry in range(begin, end):
            k = item[entry]
            if found - first < MOST_STARTS and may_meet(planes, k, p, (0.0, 0.0, 0.0)):
                c = k // 6
                v = tetrahedron(corner, c, k % 6)
                weights = _linear_weights(tip, v, p)
                reached = _refine(
                    gamma, tip, slope, v, weights, p, mesh.interpolation_error[c], guess
                )
                if (reached or not with_root) and _is_new(
                    gamma, corner, c, guess, start, first, found
                ):
                    for axis in range(3):
                        start[found, axis] = min(max(guess[axis], low[axis]), high[axis])
                    target[found], cell[found] = t, c
                    found += 1
    return targets.shape[0], found


@inline
def _linear_weights(tip, v, p):
    """Barycentric coordinates of p in a linear image, moved into it."""
    base, det, normals = image_faces(tip, v)
    q = minus(p, base)
    b0, b1 = max(det + dot(q, normals[0]), 0.0), max(dot(q, normals[1]), 0.0)
    b2, b3 = max(dot(q, normals[2]), 0.0), max(dot(q, normals[3]), 0.0)
    total = b0 + b1 + b2 + b3
    if total > 0:
        return b0 / total, b1 / total, b2 / total, b3 / total
    return 0.25, 0.25, 0.25, 0.25


@inline
def _refine(gamma, tip, slope, v, weights, p, error, guess):
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
    for _ in range(_ITERATIONS):
        r, a = _model(gamma, tip, slope, v, weights, p, guess)
        if dot(r, r) <= (_CONVERGED * error) ** 2:
            if last:
                return True
            last = True  # close enough, and once more to be closer
        weights, moved = _step(gamma, v, weights, r, a, guess)
        if not moved:
            break
    r, a = _model(gamma, tip, slope, v, weights, p, guess)
    return dot(r, r) <= (_ACCEPTED * error) ** 2


@inline
def _model(gamma, tip, slope, v, weights, p, guess):
    """How far the quadratic at the guess is from p, and the rows of its slope there."""
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
    c = cofactors(a)
    det = dot(a[0], c[0])
    if det == 0.0:
        return weights, False
    y = combination(r, c)
    y = (y[0] / det, y[1] / det, y[2] / det)
    ahead = _weights(gamma, v, (guess[0] + y[0], guess[1] + y[1], guess[2] + y[2]))
    part = 1.0
    for i in range(4):
        if ahead[i] < -_OUTSIDE:
            part = min(part, (weights[i] + _OUTSIDE) / (weights[i] - ahead[i]))
    if part < 1e-3:
        return weights, False
    for k in range(3):
        guess[k] += part * y[k]
    return _weights(gamma, v, (guess[0], guess[1], guess[2])), True


@inline
def _weights(gamma, v, x):
    """Barycentric coordinates in a Freudenthal tetrahedron, whose edges follow the axes."""
    a, b = v[0], v[3]
    u = (
        (x[0] - gamma[a, 0]) / (gamma[b, 0] - gamma[a, 0]),
        (x[1] - gamma[a, 1]) / (gamma[b, 1] - gamma[a, 1]),
        (x[2] - gamma[a, 2]) / (gamma[b, 2] - gamma[a, 2]),
    )
    first, second = _along_edge(gamma, v[0], v[1], u), _along_edge(gamma, v[1], v[2], u)
    third = _along_edge(gamma, v[2], v[3], u)
    return 1.0 - first, first - second, second - third, third


@inline
def _along_edge(gamma, a, b, u):
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
        if apart < _DISTINCT:
            return False
    return True
