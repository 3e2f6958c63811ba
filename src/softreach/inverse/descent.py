"""From starts to targets, or to compromises with a direction, for many starts at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softreach.kernels.box.box_newton import box_steps
from softreach.rod.activation_box import ActivationBox, damped_steps
from softreach.rod.tip_map import BLOCK, TipMap
from softreach.support.arrays import Array, Index, Mask

_FEW = BLOCK // 8
_MOST_ITERATIONS = 60
_FIRST_DAMPING, _LEAST_DAMPING, _LARGEST_DAMPING = 1e-2, 1e-8, 1e8
_STALLED = 1e-12  # step, in ranges, at which a search has found a minimum that is no root

Evaluate = Callable[[Index, Array], tuple[Array, Array]]
"""(which functions, activations (n, m)) -> values (n,), gradients (n, m)."""

_MOST_NEWTON_STEPS = 80
_DIFFERENCE = 1e-6  # step of the differences of gradients, in ranges
_STEP_TOL = 1e-10  # step at which a search has converged, in ranges
_VALUE_TOL = 1e-14  # relative increase of a value that is rounding
_LARGEST_NEWTON_DAMPING = 1e8  # at which a search stagnates


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
    tip, slope = linearized(rod, start)
    away = np.linalg.norm(tip - targets, axis=1)
    # A start without a tip leads nowhere, and a step to a place without one fails.
    ends = Descent(start.copy(), tip, slope, np.where(np.isnan(away), np.inf, away))
    damping, floor = np.full(len(start), _FIRST_DAMPING), 1e-3 * residual
    active = np.flatnonzero((ends.residual > floor) & (ends.residual < np.inf))
    stay = np.zeros(len(start), np.int64)
    for _ in range(most):
        if not len(active):
            break
        goal, gamma = targets[active], ends.gamma[active]
        gap, slope = (ends.tip[active] - goal) / rod.length, ends.slope[active] / rod.length
        softness = damping[active] * ends.residual[active] / rod.length
        trial = damped_steps(rod.box, gamma, gap, slope, softness)[0]
        tip, slope = linearized(rod, trial)
        miss = np.linalg.norm(tip - goal, axis=1)
        better = miss < ends.residual[active]
        taken = active[better]
        gain = 1.0 - miss[better] / ends.residual[taken]
        ends.gamma[taken], ends.tip[taken] = trial[better], tip[better]
        ends.slope[taken], ends.residual[taken] = slope[better], miss[better]
        damping[active] *= np.where(better, 0.2, 8.0)
        damping[taken] = np.maximum(damping[taken], _LEAST_DAMPING)
        # A minimum of the distance that is no root is approached ever more slowly.
        stay[taken] = np.where(gain < 1e-3, stay[taken] + 1, 0)
        still = (np.abs(trial - gamma) / scales).max(axis=1) <= _STALLED
        reached = ends.residual[active] <= residual
        end = (ends.residual[active] <= floor) | (reached & ~better) | still
        end |= (damping[active] > _LARGEST_DAMPING) | (stay[active] > 4)
        active = active[~end]
    return ends


def minimize(evaluate: Evaluate, start: Array, box: ActivationBox) -> tuple[Array, Array]:
    """Minimize function i from start i, by damped Newton within the bounds.

    Second derivatives are differences of the exact gradients.

    Args:
        evaluate: Values and gradients of some of the functions.
        start: Inside the bounds [-], shape (n, m).
        box: The bounds.

    Returns:
        Activations (n, m) of local minima, and the functions there, (n,).
    """
    low, high, scales = box.low.copy(), box.high.copy(), box.scales
    gamma, damping = start.copy(), np.zeros(len(start))
    active = np.arange(len(start))
    value, gradient, hessian = _expanded(evaluate, active, gamma, scales, active >= 0)
    active = active[np.isfinite(value)]
    for _ in range(_MOST_NEWTON_STEPS):
        if not len(active):
            break
        trial, damped = np.empty((len(active), start.shape[1])), damping[active]
        box_steps(gamma[active], gradient[active], hessian[active], damped, low, high, trial)
        still = (np.abs(trial - gamma[active]) / scales).max(axis=1, initial=0.0) <= _STEP_TOL
        ahead = _expanded(evaluate, active, trial, scales, ~still)
        accepted = ahead.value <= value[active] + _VALUE_TOL * np.abs(value[active])
        taken = active[accepted]
        gamma[taken] = trial[accepted]
        value[taken], gradient[taken], hessian[taken] = (part[accepted] for part in ahead)
        eased = np.where(damped > 1e-6, 0.1 * damped, 0.0)
        damping[active] = np.where(accepted, eased, np.maximum(10 * damped, 1e-3))
        active = active[~still & (damping[active] < _LARGEST_NEWTON_DAMPING)]
    return gamma, value


@dataclass(frozen=True, kw_only=True)
class Objective:
    """½ |γ - near|² + λ·c + ½ μ |c|² + ½ w² |d3 - direction|² with the miss c = (tip - target)/L.

    Theory (40). Without near and λ its minimum is a compromise of distance and direction; with near
    and the right λ it is the least change that reaches the target (an augmented Lagrangian).
    """

    rod: TipMap
    targets: Array
    """One for each search [m], shape (n, 3)."""
    direction: Array
    """Unit vectors, shape (n, 3)."""
    direction_weight: float
    """w [-]."""
    penalty: float = 1.0
    """μ [-]."""
    multiplier: Array | None = None
    """λ, shape (n, 3)."""
    near: Array | None = None
    """Shape (n, m) [-]; None for no term of change."""

    def __call__(self, which: Index, gamma: Array) -> tuple[Array, Array]:
        """Values (k,) and gradients (k, m) at activations (k, m) of searches `which` (k,)."""
        motions = self.rod.tip_motions(gamma)
        miss = (motions.tips - self.targets[which]) / self.rod.length
        force = self.penalty * miss
        value = 0.5 * self.penalty * _squares(miss)
        if self.multiplier is not None:
            force += self.multiplier[which]
            value += np.einsum("ni,ni->n", self.multiplier[which], miss)
        gradient = np.einsum("ni,nij->nj", force, motions.slopes / self.rod.length)
        if self.near is not None:
            change = gamma - self.near[which]
            value += 0.5 * _squares(change)
            gradient += change
        wanted, squared_weight = self.direction[which], self.direction_weight**2
        value += 0.5 * squared_weight * _squares(motions.directions - wanted)
        # ∂d3 = ω × d3, so that ½|d3 - e|² changes by -(ω × d3)·e = -ω·(d3 × e)
        turn = np.cross(motions.directions, wanted)
        gradient -= squared_weight * np.einsum("nij,ni->nj", motions.rotations, turn)
        return value, gradient


def linearized(rod: TipMap, gamma: Array) -> tuple[Array, Array]:
    """Tips [m] and ∂r/∂γ [m] as `TipMap.tips_and_slopes`, for the steps of a search.

    Their activations are arrays already: few of a rod without loads go past checks and threads.
    """
    if rod.supports_unstable or len(gamma) > _FEW:
        return rod.tips_and_slopes(gamma)
    tips, slopes = np.empty((len(gamma), 3)), np.empty((len(gamma), 3, gamma.shape[1]))
    rod.fill(np.ascontiguousarray(gamma), tips, slopes)
    return tips, slopes


class Descent(NamedTuple):
    """Ends of searches."""

    gamma: Array
    """Activations [-], shape (n, m)."""
    tip: Array
    """Their tips [m], shape (n, 3)."""
    slope: Array
    """∂r/∂γ there [m], shape (n, 3, m)."""
    residual: Array
    """|tip - target| [m], shape (n,)."""


class _Expansion(NamedTuple):
    """Functions to second order about a point each."""

    value: Array
    gradient: Array
    hessian: Array
    """NaN where it was not asked for."""


def _expanded(
    evaluate: Evaluate, which: Index, gamma: Array, scales: Array, curved: Mask
) -> _Expansion:
    """Values, gradients and, where `curved`, Hessians: gradients a step away along each axis.

    One call evaluates all: rods are computed in blocks that cost the same full or not.
    """
    n, m = gamma.shape
    k = int(curved.sum())
    displaced = np.repeat(gamma[curved, None], m, axis=1)
    displaced[:, np.arange(m), np.arange(m)] += _DIFFERENCE * scales
    value, gradient = evaluate(
        np.concatenate([which, np.repeat(which[curved], m)]),
        np.concatenate([gamma, displaced.reshape(k * m, m)]),
    )
    change = gradient[n:].reshape(k, m, m) - gradient[:n][curved, None]
    hessian = np.full((n, m, m), np.nan)
    hessian[curved] = change / (_DIFFERENCE * scales)[:, None]
    torn = np.isfinite(value[:n]) & curved & np.isnan(hessian).any(axis=(1, 2))
    hessian[torn] = _cautious(gradient[:n][torn], scales)
    return _Expansion(value[:n], gradient[:n], hessian)


def _cautious(gradient: Array, scales: Array) -> Array:
    """In place of a Hessian, next to where a function ends: steps down of a tenth of the ranges."""
    size = np.abs(gradient * scales).max(axis=1, initial=0.0)
    return (10.0 * size / scales[:, None] ** 2).T[:, :, None] * np.eye(len(scales))


def _squares(rows: Array) -> Array:
    return np.einsum("ni,ni->n", rows, rows)
