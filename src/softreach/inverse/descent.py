"""From starts to targets: damped Gauss-Newton inside the bounds, for many starts at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.damped_step import damped_steps
from softreach.rod.tip_map import TipMap

__all__ = ["Descent", "descend"]

Array = NDArray[np.float64]

_MOST_ITERATIONS = 60
_FIRST_DAMPING, _LEAST_DAMPING, _LARGEST_DAMPING = 1e-2, 1e-8, 1e8
_STALLED = 1e-12  # step, in ranges, at which a search has found a minimum that is no root


class Descent(NamedTuple):
    """Where searches ended."""

    gamma: Array
    """Activations [-], shape (n, m)."""
    tip: Array
    """Their tips [m], shape (n, 3)."""
    slope: Array
    """∂r/∂γ there [m], shape (n, 3, m)."""
    residual: Array
    """|tip - target| [m], shape (n,)."""

    def of(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Descent:
        """Some of them."""
        return Descent(self.gamma[rows], self.tip[rows], self.slope[rows], self.residual[rows])


def descend(
    rod: TipMap, targets: Array, start: Array, residual: float, most: int = _MOST_ITERATIONS
) -> Descent:
    """Levenberg's method: each step solves min |r + J d - p|² + μ |d|² inside the bounds exactly.

    μ falls with the residual, which keeps convergence quadratic at regular roots and linear at
    singular ones.

    Args:
        rod: The tip map.
        targets: One for each start [m], shape (n, 3).
        start: Inside the bounds [-], shape (n, m).
        residual: At which a search ends [m].
        most: Iterations.
    """
    scales = rod.box.scales
    tip, slope = rod.tips_and_slopes(start)
    away = np.linalg.norm(tip - targets, axis=1)
    # A start without a tip leads nowhere, and a step to a place without one fails.
    found = Descent(start.copy(), tip, slope, np.where(np.isnan(away), np.inf, away))
    damping, floor = np.full(len(start), _FIRST_DAMPING), 1e-3 * residual
    active = np.flatnonzero((found.residual > floor) & (found.residual < np.inf))
    stay = np.zeros(len(start), np.int64)
    for _ in range(most):
        if not len(active):
            break
        goal, gamma = targets[active], found.gamma[active]
        trial = _trials(rod, found.of(active), goal, damping[active])
        tip, slope = rod.tips_and_slopes(trial)
        miss = np.linalg.norm(tip - goal, axis=1)
        better = miss < found.residual[active]
        taken = active[better]
        gain = 1.0 - miss[better] / found.residual[taken]
        found.gamma[taken], found.tip[taken] = trial[better], tip[better]
        found.slope[taken], found.residual[taken] = slope[better], miss[better]
        damping[active] *= np.where(better, 0.2, 8.0)
        damping[taken] = np.maximum(damping[taken], _LEAST_DAMPING)
        # A minimum of the distance that is no root is approached ever more slowly.
        stay[taken] = np.where(gain < 1e-3, stay[taken] + 1, 0)
        still = (np.abs(trial - gamma) / scales).max(axis=1) <= _STALLED
        reached = found.residual[active] <= residual
        end = (found.residual[active] <= floor) | (reached & ~better) | still
        end |= (damping[active] > _LARGEST_DAMPING) | (stay[active] > 4)
        active = active[~end]
    return found


def _trials(rod: TipMap, at: Descent, targets: Array, damping: Array) -> Array:
    """The end of each step."""
    miss, softness = (at.tip - targets) / rod.length, damping * at.residual / rod.length
    return damped_steps(rod.box, at.gamma, miss, at.slope / rod.length, softness)[0]
