"""The quadratic through tips and Jacobians of a tetrahedron's vertices, and where it is a target.

The average of the vertices' expansions, Σ λi (fi + ½ Ji (x - xi)), is exact for quadratics. A
Freudenthal tetrahedron walks from vertex 0 to vertex 3 along one axis after the other; let sj tell
how far along edge j, so that λ = (1 - s0, s0 - s1, s1 - s2, s2), and Dij = Ji (xj+1 - xj). Then

    f(s) = Σ λi (gi + ½ Σ sj Dij),   gi = fi - ½ Σ Dij over j < i,

and Newton's method takes Σ λi Dij for ∂f/∂sj.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline
from softreach.kernels.vector import combination, cross, dot, matrix, minus, plus, row, times

__all__ = ["Quadratic", "barycentric", "expand", "is_inside", "quadratic", "refine"]

_ITERATIONS = 6
_OUTSIDE = 0.5  # how far outside a tetrahedron its quadratic is followed, in barycentric units
_CONVERGED, _ACCEPTED = 0.25, 2.0  # residuals at which to end and to keep, in remainders
_ROUNDING = 1e-6  # in barycentric units


class Quadratic(NamedTuple):
    """Of one tetrahedron at a time; all arrays are written."""

    value: np.ndarray
    """gi - p [m], p being the target, shape (4, 3)."""
    change: np.ndarray
    """Dij [m], shape (4, 3, 3)."""
    width: np.ndarray
    """The lengths of the edges along their axes, with sign [-], shape (3,)."""
    gradient: np.ndarray
    """Of each sj in space, times the determinant of ∂f/∂s, at the last step, shape (3, 3)."""


def quadratic():
    """Space for one."""
    return Quadratic(np.empty((4, 3)), np.empty((4, 3, 3)), np.empty(3), np.empty((3, 3)))


@inline
def expand(mesh, v, axes, p, q):
    """Put the quadratic of the tetrahedron of vertices v, whose edges follow `axes`, into q."""
    for j in range(3):
        q.width[j] = mesh.gamma[v[j + 1], axes[j]] - mesh.gamma[v[j], axes[j]]
    for i in range(4):
        for c in range(3):
            before = 0.0
            for j in range(3):
                change = q.width[j] * mesh.slope[v[i], c, axes[j]]
                q.change[i, j, c] = change
                if j < i:
                    before += change
            q.value[i, c] = mesh.tip[v[i], c] - p[c] - 0.5 * before


@inline
def refine(q, weights, remainder):
    """Follow Newton's method from barycentric coordinates to where f is the target.

    Returns:
        Whether it is reached but for the cubic rest, the barycentric coordinates, and the
        determinant of ∂f/∂s at the last step.
    """
    s = (1.0 - weights[0], weights[2] + weights[3], weights[3])
    det, size = 0.0, 0.0
    for _ in range(_ITERATIONS):
        miss, a = _at(q, s)
        size = dot(miss, miss)
        s, det, moved = _step(q, s, miss, a)
        if size <= (_CONVERGED * remainder) ** 2:
            return True, barycentric(s), det
        if not moved:
            return size <= (_ACCEPTED * remainder) ** 2, barycentric(s), det
    miss, a = _at(q, s)
    return dot(miss, miss) <= (_ACCEPTED * remainder) ** 2, barycentric(s), det


@inline
def barycentric(s):
    """λ at s."""
    return 1.0 - s[0], s[0] - s[1], s[1] - s[2], s[2]


@inline
def _at(q, s):
    """p - f at s, and ∂f/∂s0, ∂f/∂s1, ∂f/∂s2."""
    w, none = barycentric(s), (0.0, 0.0, 0.0)
    miss, a0, a1, a2 = none, none, none, none
    for i in range(4):
        change = matrix(q.change, i)
        a0, a1 = plus(a0, times(w[i], change[0])), plus(a1, times(w[i], change[1]))
        a2 = plus(a2, times(w[i], change[2]))
        miss = minus(miss, times(w[i], row(q.value, i)))
    a = (a0, a1, a2)
    return minus(miss, times(0.5, combination(s, a))), a


@inline
def _step(q, s, miss, a):
    """A Newton step, cut short where it leaves the neighborhood of the tetrahedron."""
    g = (cross(a[1], a[2]), cross(a[2], a[0]), cross(a[0], a[1]))
    det = dot(a[0], g[0])
    for j in range(3):
        q.gradient[j, 0], q.gradient[j, 1], q.gradient[j, 2] = g[j]
    if det == 0.0:
        return s, det, False
    scale = 1.0 / det
    y = (scale * dot(g[0], miss), scale * dot(g[1], miss), scale * dot(g[2], miss))
    here, ahead = barycentric(s), barycentric((s[0] + y[0], s[1] + y[1], s[2] + y[2]))
    part = 1.0
    for i in range(4):
        if ahead[i] < -_OUTSIDE:
            part = min(part, (here[i] + _OUTSIDE) / (here[i] - ahead[i]))
    if part < 1e-3:
        return s, det, False
    return (s[0] + part * y[0], s[1] + part * y[1], s[2] + part * y[2]), det, True


@inline
def is_inside(q, weights, det, margin):
    """True if a target can lie in the image of a tetrahedron that is off by so much at most.

    Each barycentric coordinate then changes by no more than its gradient in space times that.
    """
    for i in range(4):
        outside = -weights[i] - _ROUNDING
        if outside > 0.0:
            size = 0.0
            for c in range(3):
                before = q.gradient[i - 1, c] if i > 0 else 0.0
                behind = q.gradient[i, c] if i < 3 else 0.0
                size += (before - behind) ** 2
            if (outside * det) ** 2 > margin * margin * size:
                return False
    return True
