"""Newton's method for tip(γ) = p with three bundles, one step for many starts at a time.

The rod itself is evaluated in between, for all starts that are still under way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel

__all__ = ["CONVERGED", "LOST", "UNDER_WAY", "Search", "conditions", "merge", "newton_step"]

UNDER_WAY, CONVERGED, LOST = 0, 1, 2

_LONGEST = 0.25  # step, in ranges of the bounds
_OUTSIDE = 0.05  # how far a search may leave the bounds, in ranges
_PROGRESS = 0.2  # least part of the promised decrease that is progress
_SETTLED = 1e-7  # a last step that is small enough, in ranges
_SHORTEST = 1 / 32  # part of a step below which a search is lost


class Search(NamedTuple):
    """The state of every search."""

    goal: np.ndarray
    """Targets [m], shape (n, 3)."""
    gamma: np.ndarray
    """Best activations so far [-], shape (n, 3)."""
    slope: np.ndarray
    """Position Jacobians there [m], shape (n, 3, 3)."""
    residual: np.ndarray
    """|tip - goal| there [m], shape (n,)."""
    step: np.ndarray
    """Newton step from there [-], shape (n, 3)."""
    part: np.ndarray
    """The part of the step under trial, shape (n,)."""
    trial: np.ndarray
    """Activations to evaluate next [-], shape (n, 3)."""
    state: np.ndarray
    """UNDER_WAY, CONVERGED or LOST, shape (n,)."""


@kernel
def newton_step(search, active, tips, slopes, low, high, tol):
    """Take in the tips and slopes of the active searches' trials and set their next trials."""
    for k in range(active.shape[0]):
        n = active[k]
        d0 = search.goal[n, 0] - tips[k, 0]
        d1 = search.goal[n, 1] - tips[k, 1]
        d2 = search.goal[n, 2] - tips[k, 2]
        residual = math.sqrt(d0 * d0 + d1 * d1 + d2 * d2)
        # A search that creeps toward a fold it cannot cross is given up; a double root is not:
        # each full step quarters its residual.
        if residual < (1.0 - _PROGRESS * search.part[n]) * search.residual[n]:
            search.residual[n] = residual
            search.gamma[n] = search.trial[n]
            search.slope[n] = slopes[k]
            _solve(slopes[k], d0, d1, d2, search.step[n])
            _shorten(search.step, n, low, high)
            search.part[n] = 1.0
        else:
            search.part[n] *= 0.25
        for j in range(3):
            margin = _OUTSIDE * (high[j] - low[j])
            next_one = search.gamma[n, j] + search.part[n] * search.step[n, j]
            search.trial[n, j] = min(max(next_one, low[j] - margin), high[j] + margin)
        # Near a fold a small residual says little about γ: there the search goes on while it can.
        if search.part[n] < _SHORTEST:
            search.state[n] = CONVERGED if search.residual[n] <= tol else LOST
            search.trial[n] = search.gamma[n]
        elif search.residual[n] <= tol and _length(search.step, n, low, high) <= _SETTLED:
            search.state[n] = CONVERGED


@inline
def _solve(a, r0, r1, r2, out):
    """Write A⁻¹ r, by cofactors; the gradient's direction where A is singular."""
    c00 = a[1, 1] * a[2, 2] - a[1, 2] * a[2, 1]
    c01 = a[1, 2] * a[2, 0] - a[1, 0] * a[2, 2]
    c02 = a[1, 0] * a[2, 1] - a[1, 1] * a[2, 0]
    det = a[0, 0] * c00 + a[0, 1] * c01 + a[0, 2] * c02
    if det == 0.0:
        for j in range(3):
            out[j] = a[0, j] * r0 + a[1, j] * r1 + a[2, j] * r2
        return
    c10 = a[0, 2] * a[2, 1] - a[0, 1] * a[2, 2]
    c11 = a[0, 0] * a[2, 2] - a[0, 2] * a[2, 0]
    c12 = a[0, 1] * a[2, 0] - a[0, 0] * a[2, 1]
    c20 = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    c21 = a[0, 2] * a[1, 0] - a[0, 0] * a[1, 2]
    c22 = a[0, 0] * a[1, 1] - a[0, 1] * a[1, 0]
    out[0] = (c00 * r0 + c10 * r1 + c20 * r2) / det
    out[1] = (c01 * r0 + c11 * r1 + c21 * r2) / det
    out[2] = (c02 * r0 + c12 * r1 + c22 * r2) / det


@inline
def _shorten(step, n, low, high):
    longest = _length(step, n, low, high)
    if longest > _LONGEST:
        for j in range(3):
            step[n, j] *= _LONGEST / longest


@inline
def _length(step, n, low, high):
    """The largest component of a step, in ranges of the bounds."""
    longest = 0.0
    for j in range(3):
        longest = max(longest, abs(step[n, j]) / (high[j] - low[j]))
    return longest


@kernel
def conditions(slopes, smallest, condition):
    """Smallest singular value and condition number of 3x3 matrices.

    Largest eigenvalues alone are accurate in closed form, so σ_min is 1/σ_max of the inverse.
    """
    cofactors = np.empty((3, 3))
    for n in range(slopes.shape[0]):
        a = slopes[n]
        for i in range(3):
            for j in range(3):
                i1, i2, j1, j2 = (i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3
                cofactors[i, j] = a[i1, j1] * a[i2, j2] - a[i1, j2] * a[i2, j1]
        det = abs(a[0, 0] * cofactors[0, 0] + a[0, 1] * cofactors[0, 1] + a[0, 2] * cofactors[0, 2])
        spread = _largest(cofactors)
        smallest[n] = det / spread if spread > 0 else 0.0
        condition[n] = _largest(a) / smallest[n] if smallest[n] > 0 else math.inf


@inline
def _largest(a):
    """Largest singular value, from the trigonometric roots of the cubic of AᵀA."""
    xx = a[0, 0] * a[0, 0] + a[1, 0] * a[1, 0] + a[2, 0] * a[2, 0]
    yy = a[0, 1] * a[0, 1] + a[1, 1] * a[1, 1] + a[2, 1] * a[2, 1]
    zz = a[0, 2] * a[0, 2] + a[1, 2] * a[1, 2] + a[2, 2] * a[2, 2]
    xy = a[0, 0] * a[0, 1] + a[1, 0] * a[1, 1] + a[2, 0] * a[2, 1]
    xz = a[0, 0] * a[0, 2] + a[1, 0] * a[1, 2] + a[2, 0] * a[2, 2]
    yz = a[0, 1] * a[0, 2] + a[1, 1] * a[1, 2] + a[2, 1] * a[2, 2]
    mean = (xx + yy + zz) / 3
    x, y, z = xx - mean, yy - mean, zz - mean
    p = math.sqrt((x * x + y * y + z * z + 2 * (xy * xy + xz * xz + yz * yz)) / 6)
    if p <= 1e-300:
        return math.sqrt(mean)
    det = x * (y * z - yz * yz) - xy * (xy * z - yz * xz) + xz * (xy * yz - y * xz)
    angle = math.acos(min(max(det / (2 * p * p * p), -1.0), 1.0)) / 3
    return math.sqrt(mean + 2 * p * math.cos(angle))


@kernel
def merge(offsets, gamma, residual, smallest, rounding, kept):
    """Keep one of each set of equal solutions of a target, the one of least residual.

    Two solutions are one if the tip between them is about as near to the target as theirs: at a
    fold, where they lie δ apart, it misses by about σ_min δ/4.
    """
    for t in range(offsets.shape[0] - 1):
        for i in range(offsets[t], offsets[t + 1]):
            for j in range(offsets[t], i):
                if kept[i] and kept[j]:
                    square = 0.0
                    for k in range(3):
                        square += (gamma[i, k] - gamma[j, k]) ** 2
                    same = 16.0 * max(residual[i], residual[j]) + rounding
                    if min(smallest[i], smallest[j]) * math.sqrt(square) <= same:
                        kept[i if residual[i] >= residual[j] else j] = False
