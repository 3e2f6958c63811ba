"""The second preimage of a point near a fold of tip(γ), from the one that is known.

Along the null direction v of J, with u its left counterpart, the map is σ s + ½ κ s² with
κ = u·f''[v, v] (Lyapunov and Schmidt); its other root is s = -2σ/κ.
"""

from __future__ import annotations

import math

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import cofactors, combination, dot, matrix, times

__all__ = ["second_preimages"]

_ITERATIONS = 3  # of inverse iteration, which near a fold gains many digits each


@kernel
def second_preimages(mesh, cell, gamma, slope, smallest, reach, overshoot, low, high, start, near):
    """Near the second preimage of each solution, and whether that is within reach.

    Args:
        mesh: Cells of the activation box.
        cell: Cell of each solution, shape (n,).
        gamma: Solutions, shape (n, 3).
        slope: Jacobians there [m], shape (n, 3, 3).
        smallest: Their smallest singular values [m], shape (n,).
        reach: Largest move of a solution, in widths of its cell.
        overshoot: Put for 2 in -2σ/κ. From beyond the other root Newton's method converges
            to it, from short of it perhaps back to the one that is known.
        low: Lower bounds, shape (3,).
        high: Upper bounds, shape (3,).
        start: Filled with activations, shape (n, 3).
        near: Filled with whether they are within reach, shape (n,).
    """
    for n in range(gamma.shape[0]):
        c = cell[n]
        first, last = mesh.corner[c, 0], mesh.corner[c, 7]
        near[n] = 2.0 * smallest[n] <= reach * mesh.slope_change[c]
        if not near[n]:
            continue
        sigma, u, v = _null_vectors(matrix(slope, n))
        kappa = 0.0
        for k in range(3):
            other = mesh.corner[c, 1 << k]
            step = v[k] / (mesh.gamma[other, k] - mesh.gamma[first, k])
            for i in range(3):
                for j in range(3):
                    change = mesh.slope[other, i, j] - mesh.slope[first, i, j]
                    kappa += step * u[i] * change * v[j]
        if kappa == 0.0:
            near[n] = False
            continue
        for k in range(3):
            width = mesh.gamma[last, k] - mesh.gamma[first, k]
            s = -overshoot * sigma / kappa * v[k]
            root = gamma[n, k] + s
            start[n, k] = min(max(root, low[k]), high[k])
            near[n] = near[n] and abs(s) <= reach * width and abs(start[n, k] - root) <= width


@inline
def _null_vectors(a):
    """The smallest singular value uᵀ A v, with u and v, by inverse iteration with det(A) A⁻¹."""
    c = cofactors(a)
    u, v = (0.5, 0.75, 1.0), (0.0, 0.0, 0.0)  # along no axis of symmetry
    for _ in range(_ITERATIONS):
        v = _normalized(combination(u, c))
        u = _normalized((dot(c[0], v), dot(c[1], v), dot(c[2], v)))
    return dot(u, (dot(a[0], v), dot(a[1], v), dot(a[2], v))), u, v


@inline
def _normalized(a):
    size = math.sqrt(dot(a, a))
    return times(1.0 / size if size > 0.0 else 0.0, a)
