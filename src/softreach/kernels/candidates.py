"""Starting points of Newton's method: tetrahedra of the activation box that map onto a target.

A target's solutions lie in tetrahedra whose linear image, inflated by its interpolation error,
contains it. In each of them the quadratic through tips and Jacobians says whether and where, up to
its remainder. Where the map does not fold, a root of the quadratic that lies outside its
tetrahedron is left to the neighbor's; where it may, one is searched on either side of the fold.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.activation_mesh import image_faces, tetrahedron
from softreach.kernels.compiler import inline, kernel
from softreach.kernels.space_tree import leaf_at, may_meet
from softreach.kernels.vector import cofactors, combination, cross, dot, matrix, minus, row

__all__ = ["MOST_STARTS", "find_starts"]

MOST_STARTS = 1024
"""Starts kept for one target; a fold to a point has a whole curve of them."""

_DISTINCT = 0.1  # starts nearer than this, in widths of their cells, lead to one solution
_ITERATIONS = 6
_OUTSIDE = 0.5  # how far outside a tetrahedron its quadratic is followed, in barycentric units
_CONVERGED, _ACCEPTED = 0.25, 2.0  # residuals at which to end and to keep, in remainders
_MARGIN = 2.0  # remainders by which a target may lie outside the image of a tetrahedron
_MANY = 32  # starts after which a tetrahedron is searched once only
_EVEN = 0.3  # ratio of det J at its vertices above which a tetrahedron does not fold
_ASIDE = 0.1  # how far from each other vertex a search near one begins
_ROUNDING = 1e-6  # the same in barycentric units


def find_starts(mesh, tree, targets, low, high, with_root, target, cell, start, inverse):
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
        inverse: Filled with the inverse of the quadratic's Jacobian near it [1/m], zero where it is
            singular, shape (room, 3, 3).

    Returns:
        How many targets are done, and how many starts were found.
    """
    # Memory that a kernel makes takes longer to compile.
    room = np.empty(3), np.empty((3, 3)), np.empty(MOST_STARTS)
    return _find_starts(
        mesh, tree, targets, low, high, with_root, *room, target, cell, start, inverse
    )


@kernel
def _find_starts(
    mesh,
    tree,
    targets,
    low,
    high,
    with_root,
    guess,
    adjugate,
    side,
    target,
    cell,
    start,
    inverse,
):
    gamma, corner, planes, item = mesh.gamma, mesh.corner, tree.planes, tree.item
    found = np.intp(0)  # typed: compiled once
    for t in range(targets.shape[0]):
        if found + MOST_STARTS > start.shape[0]:
            return t, found
        first = found
        p = row(targets, t)
        begin, end = leaf_at(tree.low, tree.size, tree.child, tree.first, tree.length, p)
        for entry in range(begin, end):
            k = item[entry]
            if not may_meet(planes, k, p, (0.0, 0.0, 0.0)):
                continue
            c, v = k // 6, tetrahedron(corner, k // 6, k % 6)
            most, least, even = _determinants(mesh.slope, v)
            for attempt in range(_attempts(even, found - first)):
                near = (-1, most, least)[attempt]
                reached, det = _search(mesh, c, v, near, p, even, guess, adjugate)
                if (reached or not with_root) and _is_new(
                    gamma, corner, c, guess, det, start, side, first, found
                ):
                    _put(guess, adjugate, det, low, high, found, start, inverse)
                    target[found], cell[found], side[found - first] = t, c, det
                    found += 1
    return targets.shape[0], found


@inline
def _attempts(even, found):
    """How many searches to begin in a tetrahedron: one, or also on either side of a fold."""
    if found >= MOST_STARTS:
        return 0
    return 1 if even or found >= _MANY else 3


@inline
def _search(mesh, c, v, near, p, even, guess, adjugate):
    """Whether a search from near a vertex, or from the linear root, reaches p, and its det J."""
    remainder = mesh.remainder[c]
    weights = _linear_weights(mesh.tip, v, p) if near < 0 else _near_vertex(near)
    reached, weights, det = _refine(
        mesh.gamma, mesh.tip, mesh.slope, v, weights, p, remainder, guess, adjugate
    )
    if reached and even:
        reached = _is_inside(mesh.gamma, v, weights, adjugate, det, _MARGIN * remainder)
    return reached, det


@inline
def _put(guess, adjugate, det, low, high, n, start, inverse):
    """Write start n."""
    scale = 1.0 / det if det != 0.0 else 0.0
    for i in range(3):
        start[n, i] = min(max(guess[i], low[i]), high[i])
        for j in range(3):
            inverse[n, i, j] = scale * adjugate[j, i]


@inline
def _determinants(slope, v):
    """The vertices of the largest and least det J, and whether the tetrahedron does not fold."""
    most, least = 0, 0
    high = low = _determinant(slope, v[0])
    for i in range(1, 4):
        det = _determinant(slope, v[i])
        if det > high:
            most, high = i, det
        if det < low:
            least, low = i, det
    return most, least, low > _EVEN * high or high < _EVEN * low


@inline
def _determinant(slope, i):
    a = matrix(slope, i)
    return dot(a[0], cross(a[1], a[2]))


@inline
def _near_vertex(i):
    """Barycentric coordinates of a place near a vertex."""
    near, far = 1.0 - 3.0 * _ASIDE, _ASIDE
    return (
        near if i == 0 else far,
        near if i == 1 else far,
        near if i == 2 else far,
        near if i == 3 else far,
    )


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
def _refine(gamma, tip, slope, v, weights, p, remainder, guess, adjugate):
    """Solve the quadratic through a tetrahedron's tips and slopes, near the tetrahedron.

    At x the average of the corners' expansions, Σ λi (fi + ½ Ji (x - xi)), is exact for quadratics.

    Returns:
        Whether the target is reached but for the cubic rest, the barycentric coordinates, and the
        determinant of the slope of the last step, whose cofactors are in `adjugate`.
    """
    for k in range(3):
        guess[k] = (
            weights[0] * gamma[v[0], k]
            + weights[1] * gamma[v[1], k]
            + weights[2] * gamma[v[2], k]
            + weights[3] * gamma[v[3], k]
        )
    det, size = 0.0, 0.0
    for _ in range(_ITERATIONS):
        r, a = _model(gamma, tip, slope, v, weights, p, guess)
        size = dot(r, r)
        weights, det, moved = _step(gamma, v, weights, r, a, guess, adjugate)
        if size <= (_CONVERGED * remainder) ** 2:
            return True, weights, det
        if not moved:
            return size <= (_ACCEPTED * remainder) ** 2, weights, det
    r, a = _model(gamma, tip, slope, v, weights, p, guess)
    return dot(r, r) <= (_ACCEPTED * remainder) ** 2, weights, det


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
def _step(gamma, v, weights, r, a, guess, adjugate):
    """A Newton step, cut short where it leaves the neighborhood of the tetrahedron."""
    c = cofactors(a)
    det = dot(a[0], c[0])
    for i in range(3):
        adjugate[i, 0], adjugate[i, 1], adjugate[i, 2] = c[i]
    if det == 0.0:
        return weights, det, False
    y = combination(r, c)
    y = (y[0] / det, y[1] / det, y[2] / det)
    ahead = _weights(gamma, v, (guess[0] + y[0], guess[1] + y[1], guess[2] + y[2]))
    part = 1.0
    for i in range(4):
        if ahead[i] < -_OUTSIDE:
            part = min(part, (weights[i] + _OUTSIDE) / (weights[i] - ahead[i]))
    if part < 1e-3:
        return weights, det, False
    for k in range(3):
        guess[k] += part * y[k]
    return _weights(gamma, v, (guess[0], guess[1], guess[2])), det, True


@inline
def _is_inside(gamma, v, weights, adjugate, det, margin):
    """Whether a target can lie in the image of a tetrahedron, if it is off by so much at most.

    Each barycentric coordinate then changes by no more than its gradient in space times that.
    """
    zero = (0.0, 0.0, 0.0)
    first, second = _gradient(gamma, v[0], v[1], adjugate), _gradient(gamma, v[1], v[2], adjugate)
    g = (zero, first, second, _gradient(gamma, v[2], v[3], adjugate), zero)
    for i in range(4):
        outside = -weights[i] - _ROUNDING
        if outside > 0.0:
            change = minus(g[i], g[i + 1])
            if (outside * det) ** 2 > margin * margin * dot(change, change):
                return False
    return True


@inline
def _gradient(gamma, a, b, adjugate):
    """det J times the gradient in space of the coordinate along the edge from a to b."""
    k = 0 if gamma[a, 0] != gamma[b, 0] else (1 if gamma[a, 1] != gamma[b, 1] else 2)
    width = gamma[b, k] - gamma[a, k]
    return adjugate[0, k] / width, adjugate[1, k] / width, adjugate[2, k] / width


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
def _is_new(gamma, corner, c, guess, det, start, side, begin, end):
    """Whether no start of the target is so near, on one side of a fold, that both lead to one."""
    first, last = corner[c, 0], corner[c, 7]
    for i in range(begin, end):
        apart = 0.0
        for k in range(3):
            width = gamma[last, k] - gamma[first, k]
            apart = max(apart, abs(start[i, k] - guess[k]) / width)
        if apart < _DISTINCT and det * side[i - begin] > 0.0:
            return False
    return True
