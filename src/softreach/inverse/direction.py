"""A wanted direction of the tip: compromises with position and change, by Newton in the box."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from softreach.inverse.request import Request
from softreach.inverse.roots import descend
from softreach.kernels.box.bounded_descent import box_steps
from softreach.rod.inputs import ActivationBox
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index, Mask

Evaluate = Callable[[Index, Array], tuple[Array, Array]]
"""(which functions, activations (n, m)) -> values (n,), gradients (n, m)."""

_MOST_NEWTON_STEPS = 80
_DIFFERENCE = 1e-6  # step of the differences of gradients, in ranges
_STEP_TOL = 1e-10  # step at which a search has converged, in ranges
_VALUE_TOL = 1e-14  # relative increase of a value that is rounding
_LARGEST_DAMPING = 1e8  # at which a search stagnates

_PENALTIES = (1e4, 1e5, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6)
"""Rising; with a lower first one a small miss would buy a large change of activation."""


def compromises(tip_map: TipMap, request: Request, start: Array) -> tuple[Array, Array]:
    """Least |tip - target|²/L² + w² |d3 - direction|² from starts (n, m): where, and half of it."""
    return minimize(partial(objective, tip_map, request, 1.0, None), start, tip_map.box)


def constrained_minima(tip_map: TipMap, request: Request, start: Array) -> tuple[Array, Array]:
    """Minimize ½|γ - near|² + ½ w²|d3 - direction|² subject to tip = target, from starts (n, m).

    Augmented Lagrangian, theory (40) [Hestenes1969] [Powell1969], with inner searches in the box,
    then descent to the target; activations and what they miss [m].
    """
    gamma, residual = start.copy(), np.full(len(start), np.inf)
    slopes = tip_map.tips_and_slopes(gamma)[1] / tip_map.length
    slopes = np.nan_to_num(slopes, nan=0.0)  # of a start without a tip, which leads nowhere
    # λ for which γ - near + Jᵀλ is least: that of a solution if the start is one.
    inverse = np.linalg.pinv(slopes.transpose(0, 2, 1), rcond=1e-3)
    multiplier = -np.einsum("nij,nj->ni", inverse, gamma - request.near)
    for penalty in _PENALTIES:
        rows = np.flatnonzero(residual > 0.1 * request.residual)
        if not len(rows):
            break
        part = request.of(rows)
        lagrangian = partial(objective, tip_map, part, penalty, multiplier[rows])
        gamma[rows] = minimize(lagrangian, gamma[rows], tip_map.box)[0]
        error = (tip_map.tips_and_slopes(gamma[rows])[0] - part.targets) / tip_map.length
        multiplier[rows] += penalty * error  # theory (40)
        residual[rows] = np.linalg.norm(error, axis=1) * tip_map.length
    ends = descend(tip_map, request.targets, gamma, request.residual)
    return ends.gamma, ends.distance


def minimize(evaluate: Evaluate, start: Array, box: ActivationBox) -> tuple[Array, Array]:
    """Minimize function i from start i, shape (n, m), by damped Newton within the bounds.

    Activations of local minima, and the functions there (n,); Hessians are of gradients.
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
        accepted = ahead[0] <= value[active] + _VALUE_TOL * np.abs(value[active])
        taken = active[accepted]
        gamma[taken] = trial[accepted]
        value[taken], gradient[taken], hessian[taken] = (part[accepted] for part in ahead)
        eased = np.where(damped > 1e-6, 0.1 * damped, 0.0)
        damping[active] = np.where(accepted, eased, np.maximum(10 * damped, 1e-3))
        active = active[~still & (damping[active] < _LARGEST_DAMPING)]
    return gamma, value


def objective(
    tip_map: TipMap,
    request: Request,
    penalty: float,
    multiplier: Array | None,
    which: Index,
    gamma: Array,
) -> tuple[Array, Array]:
    """½ |γ - near|² + λ·c + ½ μ |c|² + ½ w² |d3 - direction|² with the miss c = (tip - target)/L.

    Theory (40), with the penalty μ and multipliers λ (n, 3); without these and the change it is a
    compromise. Values (k,) and gradients (k, m) at activations (k, m) of searches `which` (k,).
    """
    assert request.direction is not None
    motions, wanted = tip_map.tip_motions(gamma), request.direction[which]
    miss = (motions.tips - request.targets[which]) / tip_map.length
    force, value = penalty * miss, 0.5 * penalty * _squares(miss)
    if multiplier is not None:
        force += multiplier[which]
        value += np.einsum("ni,ni->n", multiplier[which], miss)
    gradient = np.einsum("ni,nij->nj", force, motions.slopes / tip_map.length)
    if multiplier is not None:
        change = gamma - request.near[which]
        value += 0.5 * _squares(change)
        gradient += change
    squared_weight = request.direction_weight**2
    value += 0.5 * squared_weight * _squares(motions.directions - wanted)
    # ∂d3 = ω × d3, so that ½|d3 - e|² changes by -(ω × d3)·e = -ω·(d3 × e)
    turn = np.cross(motions.directions, wanted)
    gradient -= squared_weight * np.einsum("nij,ni->nj", motions.rotations, turn)
    return value, gradient


def _expanded(
    evaluate: Evaluate, which: Index, gamma: Array, scales: Array, curved: Mask
) -> tuple[Array, Array, Array]:
    """Values, gradients and, where `curved`, Hessians by differences of these, in one call."""
    n, m = gamma.shape
    k = int(curved.sum())
    displaced = np.repeat(gamma[curved, None], m, axis=1)
    displaced[:, np.arange(m), np.arange(m)] += _DIFFERENCE * scales
    every = np.concatenate([which, np.repeat(which[curved], m)])
    value, gradient = evaluate(every, np.concatenate([gamma, displaced.reshape(k * m, m)]))
    change = gradient[n:].reshape(k, m, m) - gradient[:n][curved, None]
    hessian = np.full((n, m, m), np.nan)
    hessian[curved] = change / (_DIFFERENCE * scales)[:, None]
    torn = np.isfinite(value[:n]) & curved & np.isnan(hessian).any(axis=(1, 2))
    # Next to where a function ends, steps down of a tenth of the ranges.
    size = np.abs(gradient[:n][torn] * scales).max(axis=1, initial=0.0)
    hessian[torn] = (10.0 * size / scales[:, None] ** 2).T[:, :, None] * np.eye(m)
    return value[:n], gradient[:n], hessian


def _squares(rows: Array) -> Array:
    return np.einsum("ni,ni->n", rows, rows)
