"""Descents to the tips nearest to targets, many at a time: what happens between two evaluations.

Those that end make room for the next, so that the rod is never evaluated for a few. `box_steps` are
Newton's toward the minimum of a function in the box, damped until the Hessian is positive definite;
variables on a bound that the gradient pushes outward stay there (Bertsekas 1982).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from softreach.kernels.compiler import inline, kernel

NOWHERE = 1e150  # coordinate of tips that do not count; no distance may be infinite here
FIRST_DAMPING = 1e-2
_LEAST_DAMPING, _LARGEST_DAMPING = 1e-4, 1e4
_BELIEVED = 0.1  # damping above which the linear map says little of what is left to gain
_PROGRESS = 0.005  # of the tolerance: a smaller gain ends a search


class Running(NamedTuple):
    """Searches side by side, and the step each takes next."""

    row: np.ndarray  # number of the search, (n,), int64
    steps: np.ndarray  # steps it has taken, (n,), int64
    damping: np.ndarray  # of the next step, part of the mean square of the slopes [-], (n,)
    left: np.ndarray  # distance that the linear map leaves behind the step under trial [m], (n,)
    slope: np.ndarray  # ∂r/∂γ in ranges of the bounds [m] where it is now, (n, 3, m)
    wanted: np.ndarray  # target minus tip [m], (n, 3)
    softness: np.ndarray  # damping times that mean square [m²], (n,)
    low: np.ndarray  # signed distances to the lower bounds, in ranges, (n, m)
    high: np.ndarray  # distances to the upper bounds, in ranges, (n, m)
    trial: np.ndarray  # activations to evaluate next [-], (n, m)


@kernel
def judge(running, n, tips, ahead, targets, ends, enough, stop, bounds):
    """Take in the trials of the first n; set up the next steps and return how many of them go on.

    Trials have tips (n, 3), `NOWHERE` if they do not count, and ∂r/∂γ `ahead` (n, 3, m); targets
    (all, 3) and ends, the best activations, tips and distances, are those of all searches. A search
    ends at a distance that is enough [m], at a gain to be hoped for, or after so many steps (stop).
    """
    gamma, best, distance = ends
    settled, most = stop
    kept = 0
    for i in range(n):
        row, damping = running.row[i], running.damping[i]
        x, y, z = (
            targets[row, 0] - tips[i, 0],
            targets[row, 1] - tips[i, 1],
            targets[row, 2] - tips[i, 2],
        )
        trial, now = math.sqrt(x * x + y * y + z * z), distance[row]
        begins = running.steps[i] == 0
        better = begins or trial < now
        ended = begins and trial >= NOWHERE  # nothing is stable there
        if not begins:
            gain = now - running.left[i]
            # What the linear map promises bounds what is left to gain, once it is to be believed.
            hoped = max(_PROGRESS * min(enough, now), settled * now)
            ended = damping <= _BELIEVED and gain <= hoped
            if now - trial > 0.25 * gain:
                damping = max(0.1 * damping, _LEAST_DAMPING)
            elif not better:
                # Searches beyond the loss of stability take long: a step into it is cut down.
                damping *= 100.0 if trial >= NOWHERE else 10.0
            ended = ended or damping >= _LARGEST_DAMPING or running.steps[i] >= most
        if better:
            distance[row] = trial
            for j in range(gamma.shape[1]):
                gamma[row, j] = running.trial[i, j]
            for a in range(3):
                best[row, a] = tips[i, a]
        if ended or distance[row] <= enough:
            continue
        square = _aim(running, i, kept, better, targets[row], best[row], ahead, gamma[row], bounds)
        running.row[kept], running.steps[kept] = row, running.steps[i] + 1
        running.damping[kept] = damping
        running.softness[kept] = damping * square / 3.0 + 1e-300
        kept += 1
    return kept


@inline
def _aim(running, i, kept, better, target, tip, ahead, gamma, bounds):
    """Set up what the next step minimizes; the sum of the squares of its slopes."""
    low, high, scales = bounds
    square = 0.0
    for a in range(3):
        running.wanted[kept, a] = target[a] - tip[a]
        for j in range(len(low)):
            slope = ahead[i, a, j] * scales[j] if better else running.slope[i, a, j]
            running.slope[kept, a, j] = slope
            square += slope**2
    for j in range(len(low)):
        running.low[kept, j] = (low[j] - gamma[j]) / scales[j]
        running.high[kept, j] = (high[j] - gamma[j]) / scales[j]
    return square


@kernel
def next_trials(running, n, step, multiplier, gamma, low, high, scales):
    """Ends of the steps (n, m) of the first n, in ranges `scales`, and what the linear map leaves.

    That is the multiplier (n, 3) times the softness. Best activations (all, m) are of all searches.
    """
    for i in range(n):
        for j in range(len(low)):
            end = gamma[running.row[i], j] + step[i, j] * scales[j]
            running.trial[i, j] = min(max(end, low[j]), high[j])
        x, y, z = multiplier[i, 0], multiplier[i, 1], multiplier[i, 2]
        running.left[i] = running.softness[i] * math.sqrt(x * x + y * y + z * z)


_FIRST_SHIFT = 1e-4  # of the largest diagonal entry
_DAMPINGS = 24


@kernel
def box_steps(gamma, gradient, hessian, damping, low, high, trial):
    """Write the end of each step (n, m) into `trial`; `damping` (n,) grows where it has to."""
    m = gamma.shape[1]
    factor, step = np.empty((m, m)), np.empty(m)
    free = np.empty(m, np.bool_)
    for n in range(gamma.shape[0]):
        largest = 0.0
        for i in range(m):
            down, up = gamma[n, i] <= low[i], gamma[n, i] >= high[i]
            slope = gradient[n, i]
            free[i] = not ((down and slope >= 0) or (up and slope <= 0) or low[i] == high[i])
            largest = max(largest, abs(hessian[n, i, i]))
        for _ in range(_DAMPINGS):
            if _factored(hessian, n, damping[n] * largest, free, factor):
                break
            damping[n] = max(10.0 * damping[n], _FIRST_SHIFT)
        _solve(factor, gradient, n, free, step)
        for i in range(m):
            trial[n, i] = min(max(gamma[n, i] + step[i], low[i]), high[i])


@inline
def _factored(hessian, n, shift, free, factor):
    """Cholesky of the free rows and columns plus a shift; whether it is positive definite."""
    m = factor.shape[0]
    for i in range(m):
        for j in range(i + 1):
            total = 0.5 * (hessian[n, i, j] + hessian[n, j, i]) if free[i] and free[j] else 0.0
            if i == j:
                total += shift if free[i] else 1.0
            scale = abs(total)
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i > j:
                factor[i, j] = total / factor[j, j]
            elif total <= 1e-13 * scale:
                return False
            else:
                factor[i, i] = math.sqrt(total)
    return True


@inline
def _solve(factor, gradient, n, free, step):
    m = factor.shape[0]
    for i in range(m):
        total = -gradient[n, i] if free[i] else 0.0
        for k in range(i):
            total -= factor[i, k] * step[k]
        step[i] = total / factor[i, i]
    for i in range(m - 1, -1, -1):
        total = step[i]
        for k in range(i + 1, m):
            total -= factor[k, i] * step[k]
        step[i] = total / factor[i, i]
