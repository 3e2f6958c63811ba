"""The other preimage of a point near a fold of tip(γ), from the one that is known.

Along the null direction v of J, with u its left counterpart, the map is σ s + ½ κ s² with
κ = u·f''[v, v] (Lyapunov and Schmidt); its other root is s = -2σ/κ.
"""

from __future__ import annotations

import math

import numpy as np

from softreach.kernels.compiler import inline, kernel

__all__ = ["partners"]

# Instead of 2: from beyond the other root Newton's method converges to it, from short of it perhaps
# back to the one that is known.
_OVERSHOOT = 2.8
_ROUNDS = 3  # of inverse iteration, which near a fold gains many digits each


@kernel
def partners(mesh, cell, gamma, slope, smallest, reach, low, high, start, near):
    """Where the partner of each solution lies, and whether within `reach` widths of its cell."""
    u, v, helper = np.empty(3), np.empty(3), np.empty((3, 3))
    for n in range(gamma.shape[0]):
        c = cell[n]
        first, last = mesh.corner[c, 0], mesh.corner[c, 7]
        near[n] = 2.0 * smallest[n] <= reach * mesh.change[c]
        if not near[n]:
            continue
        sigma = _null_vectors(slope, n, helper, u, v)
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
            s = -_OVERSHOOT * sigma / kappa * v[k]
            goal = gamma[n, k] + s
            start[n, k] = min(max(goal, low[k]), high[k])
            near[n] = near[n] and abs(s) <= reach * width and abs(start[n, k] - goal) <= width


@inline
def _null_vectors(slope, n, adjugate, u, v):
    """Singular vectors u, v of the smallest singular value, uᵀ J v, by inverse iteration."""
    _transposed_cofactors(slope, n, adjugate)
    for i in range(3):
        u[i] = 0.5 + 0.25 * i  # along no axis of symmetry
    for _ in range(_ROUNDS):
        for i in range(3):
            v[i] = adjugate[i, 0] * u[0] + adjugate[i, 1] * u[1] + adjugate[i, 2] * u[2]
        _normalize(v)
        for i in range(3):
            u[i] = adjugate[0, i] * v[0] + adjugate[1, i] * v[1] + adjugate[2, i] * v[2]
        _normalize(u)
    sigma = 0.0
    for i in range(3):
        for j in range(3):
            sigma += u[i] * slope[n, i, j] * v[j]
    return sigma


@inline
def _transposed_cofactors(a, n, out):
    for i in range(3):
        for j in range(3):
            i1, i2, j1, j2 = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
            out[j, i] = a[n, i1, j1] * a[n, i2, j2] - a[n, i1, j2] * a[n, i2, j1]


@inline
def _normalize(a):
    size = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    scale = 1.0 / size if size > 0.0 else 0.0
    for i in range(3):
        a[i] *= scale
