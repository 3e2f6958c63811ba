"""Starting points of Newton's method: tetrahedra of the activation box that map onto a target.

A target's solutions lie in tetrahedra whose linear image, inflated by its interpolation error,
contains it. In each of them the quadratic through tips and Jacobians says whether and where, up to
its remainder. Where the map does not fold, a root of the quadratic that lies outside its
tetrahedron is left to the neighbor's; where it may, one is searched on either side of the fold.
"""

from __future__ import annotations

import numpy as np

from softreach.kernels.branches.quadratic import expand, is_inside, quadratic, refine
from softreach.kernels.branches.space_tree import leaf_at, listed
from softreach.kernels.compiler import inline, kernel
from softreach.kernels.image.activation_mesh import axes_of, image_faces, orientation, tetrahedron
from softreach.kernels.vector import cross, dot, matrix, minus, row

__all__ = ["MOST_STARTS", "find_starts"]

MOST_STARTS = 1024
"""Starts kept for one target; a fold to a point has a whole curve of them."""

_DISTINCT = 0.1  # starts nearer than this, in widths of their cells, lead to one solution
_MARGIN = 2.0  # remainders by which a target may lie outside the image of a tetrahedron
_MANY = 32  # starts after which a tetrahedron is searched once only
_EVEN = 0.3  # ratio of det J at its vertices above which a tetrahedron does not fold
_AT_ONCE = 512  # tetrahedra of a list that are compared with a target before any is searched
_ASIDE = 0.1  # how far from each other vertex a search near one begins


def find_starts(mesh, tree, targets, low, high, with_root, target, cell, start, inverse):
    """Activations near each solution of the targets, until the arrays are full.

    Args:
        mesh: Cells of the activation box.
        tree: Octree of their images.
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
        Number of targets that are done, and of starts found.
    """
    # Memory that a kernel makes takes longer to compile.
    room = quadratic(), np.empty(MOST_STARTS), np.empty(_AT_ONCE, np.int32)
    return _find_starts(
        mesh, tree, targets, low, high, with_root, *room, target, cell, start, inverse
    )


@kernel
def _find_starts(
    mesh, tree, targets, low, high, with_root, q, side, held, target, cell, start, inverse
):
    count = np.intp(0)  # typed: compiled once
    for t in range(targets.shape[0]):
        if count + MOST_STARTS > start.shape[0]:
            return t, count
        first = count
        p = row(targets, t)
        begin, end = leaf_at(tree.low, tree.size, tree.child, tree.first, tree.length, p)
        for part in range(begin, end, _AT_ONCE):
            for entry in range(listed(tree, p, part, min(part + _AT_ONCE, end), held)):
                c, which = held[entry] // 6, held[entry] % 6
                v, axes = tetrahedron(mesh.corner, c, which), axes_of(which)
                most, least, even = _determinants(mesh.slope, v)
                expand(mesh, v, axes, p, q)
                for attempt in range(_attempts(even, count - first)):
                    weights = _linear_weights(mesh.tip, v, p)
                    if attempt > 0:
                        weights = _near_vertex((most, least)[attempt - 1])
                    reached, weights, det = _search(q, weights, even, mesh.remainder[c])
                    guess, det = _place(mesh.gamma, v, weights), det * orientation(which)
                    if (reached or not with_root) and _is_new(
                        mesh, c, guess, det, start, side, first, count
                    ):
                        _put(
                            guess,
                            q,
                            axes,
                            orientation(which) * det,
                            low,
                            high,
                            count,
                            start,
                            inverse,
                        )
                        target[count], cell[count], side[count - first] = t, c, det
                        count += 1
    return targets.shape[0], count


@inline
def _attempts(even, count):
    """Number of searches to begin in a tetrahedron: one, or also on either side of a fold."""
    if count >= MOST_STARTS:
        return 0
    return 1 if even or count >= _MANY else 3


@inline
def _search(q, weights, even, remainder):
    """Outcome of a search: true if it reaches the target, its end, and the determinant there."""
    reached, weights, det = refine(q, weights, remainder)
    if reached and even:
        reached = is_inside(q, weights, det, _MARGIN * remainder)
    return reached, weights, det


@inline
def _place(gamma, v, w):
    """The activation at barycentric coordinates."""
    a, b, c, d = row(gamma, v[0]), row(gamma, v[1]), row(gamma, v[2]), row(gamma, v[3])
    return (
        w[0] * a[0] + w[1] * b[0] + w[2] * c[0] + w[3] * d[0],
        w[0] * a[1] + w[1] * b[1] + w[2] * c[1] + w[3] * d[1],
        w[0] * a[2] + w[1] * b[2] + w[2] * c[2] + w[3] * d[2],
    )


@inline
def _put(guess, q, axes, det, low, high, n, start, inverse):
    scale = 1.0 / det if det != 0.0 else 0.0
    for i in range(3):
        start[n, i] = min(max(guess[i], low[i]), high[i])
        for j in range(3):
            inverse[n, axes[i], j] = scale * q.width[i] * q.gradient[i, j]


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
def _is_new(mesh, c, guess, det, start, side, begin, end):
    """True if no start of the target is so near, on one side of a fold, that both lead to one."""
    gamma, first, last = mesh.gamma, mesh.corner[c, 0], mesh.corner[c, 7]
    for i in range(begin, end):
        apart = 0.0
        for k in range(3):
            width = gamma[last, k] - gamma[first, k]
            apart = max(apart, abs(start[i, k] - guess[k]) / width)
        if apart < _DISTINCT and det * side[i - begin] > 0.0:
            return False
    return True
