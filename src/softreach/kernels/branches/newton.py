"""Newton's method for tip(γ) = p with three bundles, one step for many starts at a time.

The rod itself is evaluated in between, for all starts that still run.

Near a fold of tip(γ), `second_preimages` finds the other preimage of a point whose one is known.
Along the null direction v of J, with u its left counterpart, the map is σ s + ½ κ s² with
κ = u·f''[v, v] (Lyapunov and Schmidt); its other root is s = -2σ/κ.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel
from softreach.kernels.vector import (
    cofactors,
    combination,
    difference,
    dot,
    matrix,
    minus,
    row,
    times,
)

RUNNING, CONVERGED, STAGNATED = 0, 1, 2

_LONGEST_STEP = 0.25  # in ranges of the bounds
_OUTSIDE = 0.05  # how far a search may leave the bounds, in ranges
_SUFFICIENT = 0.2  # least part of the predicted decrease that is accepted
_STEP_TOL = 1e-7  # a last step that is small enough, in ranges
_TINY_STEP = 1e-8  # one after which the tip is at its target but for rounding
_LEAST_DAMPING = 1 / 32  # part of a step below which a search stagnates
_UNKNOWN = 1e300  # residual of a search that has not been anywhere yet [m]
_EXPONENT = 0x7FF0000000000000  # bits of a double that are all set where it is not finite


class Search(NamedTuple):
    """The state of every search."""

    target: np.ndarray  # targets [m], (n, 3)
    gamma: np.ndarray  # best activations so far [-], (n, 3)
    slope: np.ndarray  # position Jacobians there [m], (n, 3, 3)
    residual: np.ndarray  # |tip - target| there [m], (n,)
    step: np.ndarray  # Newton step from there [-], (n, 3)
    damping: np.ndarray  # the damping factor of the step under trial, (0, 1], (n,)
    trial: np.ndarray  # activations to evaluate next [-], (n, 3)
    state: np.ndarray  # RUNNING, CONVERGED or STAGNATED, (n,)


@kernel
def newton_step(search, active, tips, slopes, low, high, tol):
    """Take in tips and slopes of active trials and set the next; a tip that is NaN has failed."""
    bits = tips.view(np.int64)
    for k in range(active.shape[0]):
        n = active[k]
        miss = minus(row(search.target, n), row(tips, k))
        residual = _residual(miss, bits[k, 0])
        # A search that creeps toward a fold it cannot cross is given up; a double root is not:
        # each full step quarters its residual.
        if residual < (1.0 - _SUFFICIENT * search.damping[n]) * search.residual[n]:
            search.residual[n] = residual
            _copy(search.trial, n, search.gamma)
            for i in range(3):
                for j in range(3):
                    search.slope[n, i, j] = slopes[k, i, j]
            x, y, z = _solution(matrix(slopes, k), miss)
            search.step[n, 0], search.step[n, 1], search.step[n, 2] = x, y, z
            _shorten(search.step, n, low, high)
            search.damping[n] = 1.0
        else:
            search.damping[n] *= 0.25
        for j in range(3):
            margin = _OUTSIDE * (high[j] - low[j])
            next_one = search.gamma[n, j] + search.damping[n] * search.step[n, j]
            search.trial[n, j] = min(max(next_one, low[j] - margin), high[j] + margin)
        # Near a fold a small residual says little about γ: there the search goes on while it can.
        if search.damping[n] < _LEAST_DAMPING or search.residual[n] >= _UNKNOWN:
            search.state[n] = CONVERGED if search.residual[n] <= tol else STAGNATED
            _copy(search.gamma, n, search.trial)
        else:
            enough = _STEP_TOL if search.residual[n] <= tol else _TINY_STEP
            if _length(search.step, n, low, high) <= enough:
                search.state[n] = CONVERGED


@inline
def _residual(miss, bits):
    """|miss|, unless the bits say that the tip is not finite: compiled arithmetic knows no NaN."""
    return _UNKNOWN if bits & _EXPONENT == _EXPONENT else math.sqrt(dot(miss, miss))


@inline
def _copy(points, n, to):
    """Row n; numba compiles the assignment of a row with all that could go wrong, for seconds."""
    for j in range(3):
        to[n, j] = points[n, j]


@inline
def _solution(a, r):
    """A⁻¹ r, by cofactors; the direction of the gradient, Aᵀ r, where A is singular."""
    c = cofactors(a)
    det = dot(a[0], c[0])
    if det == 0.0:
        return combination(r, a)
    x = combination(r, c)
    return x[0] / det, x[1] / det, x[2] / det


@inline
def _shorten(step, n, low, high):
    longest = _length(step, n, low, high)
    if longest > _LONGEST_STEP:
        for j in range(3):
            step[n, j] *= _LONGEST_STEP / longest


@inline
def _length(step, n, low, high):
    """The largest component of a step, in ranges of the bounds."""
    longest = 0.0
    for j in range(3):
        longest = max(longest, abs(step[n, j]) / (high[j] - low[j]))
    return longest


@kernel
def conditions(slopes, smallest, condition):
    """Smallest singular value, as 1/σ_max of the inverse, and condition number of 3x3 matrices."""
    for n in range(slopes.shape[0]):
        a = matrix(slopes, n)
        c = cofactors(a)
        largest = _largest(c)
        smallest[n] = abs(dot(a[0], c[0])) / largest if largest > 0 else 0.0
        condition[n] = _largest(a) / smallest[n] if smallest[n] > 0 else math.inf


@inline
def _largest(a):
    x, y, z = (
        (a[0][0], a[1][0], a[2][0]),
        (a[0][1], a[1][1], a[2][1]),
        (a[0][2], a[1][2], a[2][2]),
    )
    xx, yy, zz = dot(x, x), dot(y, y), dot(z, z)
    xy, xz, yz = dot(x, y), dot(x, z), dot(y, z)
    mean = (xx + yy + zz) / 3
    u, v, w = xx - mean, yy - mean, zz - mean
    p = math.sqrt((u * u + v * v + w * w + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    if p <= 1e-300:
        return math.sqrt(mean)
    det = u * (v * w - yz * yz) - xy * (xy * w - yz * xz) + xz * (xy * yz - v * xz)
    angle = math.acos(min(max(det / (2 * p * p * p), -1.0), 1.0)) / 3
    return math.sqrt(mean + 2 * p * math.cos(angle))


@kernel
def merge_equal(offsets, gamma, residual, smallest, rounding, kept):
    """Keep one of each set of equal solutions of a target, the one of least residual.

    Two solutions are one if the tip between them is about as near to the target as theirs: at a
    fold, where they lie δ apart, it misses by about σ_min δ/4.
    """
    for t in range(offsets.shape[0] - 1):
        for i in range(offsets[t], offsets[t + 1]):
            for j in range(offsets[t], i):
                if kept[i] and kept[j]:
                    apart = difference(gamma, i, j)
                    same = 16.0 * max(residual[i], residual[j]) + rounding
                    if min(smallest[i], smallest[j]) * math.sqrt(dot(apart, apart)) <= same:
                        kept[i if residual[i] >= residual[j] else j] = False


_ITERATIONS = 3  # of inverse iteration, which near a fold gains many digits each


@kernel
def second_preimages(mesh, cell, gamma, slope, smallest, reach, overshoot, low, high, start, near):
    """Starts (n, 3) near the second preimage of each solution, and whether that is within reach.

    Solutions have a cell, an activation `gamma` (n, 3), slopes (n, 3, 3) and their smallest
    singular value (n,); they move by `reach` widths of the cell at most. The overshoot is put for 2
    in -2σ/κ: from short of the other root Newton's method may converge to the known one.
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
