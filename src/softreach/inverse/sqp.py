"""Local minima of the change of activation among the activations that reach a target."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from softreach.inverse.descent import Objective, descend, linearized, minimize
from softreach.inverse.request import Request
from softreach.kernels.box.box_projection import project
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array, Index

_LONGEST_STEP = 0.5  # in ranges
_SOFTNESS = 1e-9  # of the linearized target, in |J|²
_FIRST_PROXIMITY, _LARGEST_PROXIMITY = 0.3, 1e7

_PENALTIES = (1e4, 1e5, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6)
"""Rising; with a lower first one a small miss would buy a large change of activation."""


def sqp(
    rod: TipMap,
    request: Request,
    start: Array,
    *,
    penalty: float = 0.0,
    settled: float = 1e-6,
    most: int = 60,
) -> tuple[Array, Array]:
    """Minimize ½|γ - near|² subject to tip = target and bounds, from each start.

    Each step minimizes ½|x - near|² + ½σ|x - γ|² where the linearized map meets the target, inside
    the bounds, exactly: sequential quadratic programming with a multiple of the identity for
    the Hessian. It is taken if ½|x - near|² + penalty·|miss| falls as it should; else σ
    grows. Descent to the target ends the search.

    Args:
        rod: The tip map.
        request: A target for each start, and what to stay near to.
        start: Activations to begin with, inside the bounds [-], shape (n, m).
        penalty: Least penalty. A high one keeps a search near the target once it is there, as it
            must where the target lies next to a fold or to the boundary of the reachable set.
        settled: Step at which a search ends, in ranges.
        most: Iterations.

    Returns:
        Activations [-], shape (n, m), and their |tip - target| [m], shape (n,).
    """
    state = _searched(rod, request, start, penalty, settled, most)
    ends = descend(rod, request.targets, state.gamma, request.residual, most=20)
    return ends.gamma, ends.residual


def survey(rod: TipMap, request: Request, start: Array, most: int) -> tuple[Array, Array]:
    """Activations of searches as those of `sqp` after a few steps, and what they promise.

    Returns:
        Activations [-], shape (n, m), and what each search minimizes, ½|γ - near|² and the penalty
        of the miss, shape (n,).
    """
    state = _searched(rod, request, start, 0.0, 1e-6, most)
    return state.gamma, _merit(state.gamma, request.near, state.penalty, state.miss)


def constrained_minima(rod: TipMap, request: Request, start: Array) -> tuple[Array, Array]:
    """Minimize ½|γ - near|² + ½ w²|d3 - direction|² subject to tip = target, from each start.

    Augmented Lagrangian, theory (40) [Hestenes1969] [Powell1969], whose inner searches respect the
    bounds, then descent to the target.

    Args:
        rod: The tip map.
        request: A target for each start, and what is preferred.
        start: Activations to begin with [-], shape (n, m).

    Returns:
        Activations [-], shape (n, m), and their |tip - target| [m], shape (n,).
    """
    gamma, multiplier = start.copy(), _multipliers(rod, request, start)
    residual = np.full(len(start), np.inf)
    for penalty in _PENALTIES:
        rows = np.flatnonzero(residual > 0.1 * request.residual)
        if not len(rows):
            break
        part = request.of(rows)
        lagrangian = Objective(
            rod=rod,
            targets=part.targets,
            penalty=penalty,
            multiplier=multiplier[rows],
            near=part.near,
            direction=part.direction,
            direction_weight=part.direction_weight,
        )
        gamma[rows] = minimize(lagrangian, gamma[rows], rod.box).gamma
        error = (linearized(rod, gamma[rows])[0] - part.targets) / rod.length
        multiplier[rows] += penalty * error  # theory (40)
        residual[rows] = np.linalg.norm(error, axis=1) * rod.length
    ends = descend(rod, request.targets, gamma, request.residual)
    return ends.gamma, ends.residual


class _State(NamedTuple):
    """Every search as it stands, scaled with L."""

    gamma: Array
    """Activations [-], shape (n, m)."""
    miss: Array
    """(tip - target)/L, shape (n, 3)."""
    slope: Array
    """(∂r/∂γ)/L, shape (n, 3, m)."""
    penalty: Array
    """Penalty of a miss of L, beside ½|γ - near|², shape (n,)."""
    proximity: Array
    """σ: ½σ|step|² is added to what a step minimizes, shape (n,)."""


def _searched(
    rod: TipMap, request: Request, start: Array, penalty: float, settled: float, most: int
) -> _State:
    """The searches after so many steps, or fewer where they settled."""
    n, length = len(start), rod.length
    tip, slope = linearized(rod, start)
    state = _State(
        gamma=start.copy(),
        miss=(tip - request.targets) / length,
        slope=slope / length,
        penalty=np.full(n, penalty),
        proximity=np.full(n, _FIRST_PROXIMITY),
    )
    active = np.flatnonzero(np.isfinite(tip[:, 0]))
    for _ in range(most):
        if not len(active):
            break
        step = _advance(rod, request, state, active)
        active = active[(step >= settled) & (state.proximity[active] < _LARGEST_PROXIMITY)]
    return state


def _advance(rod: TipMap, request: Request, state: _State, active: Index) -> Array:
    """One step of the active searches; how long it would be without proximity, in ranges."""
    gamma, near, slope = state.gamma[active], request.near[active], state.slope[active]
    trial, force = _trials(rod, near, slope, state, active)
    length, (tip, new_slope) = rod.length, linearized(rod, trial)
    miss = (tip - request.targets[active]) / length
    penalty = np.maximum(state.penalty[active], 1.5 * np.linalg.norm(force, axis=1))
    linear_miss = state.miss[active] + np.einsum("nij,nj->ni", slope, trial - gamma)
    ends, misses = np.stack([gamma, trial, trial]), (state.miss[active], linear_miss, miss)
    before, foreseen, after = _merit(ends, near, penalty, np.stack(misses))
    predicted, gained = before - foreseen, before - after
    accepted = gained >= 0.1 * predicted - 1e-15
    taken, sigma = active[accepted], state.proximity[active]
    state.gamma[taken], state.miss[taken] = trial[accepted], miss[accepted]
    state.slope[taken] = new_slope[accepted] / length
    state.penalty[active] = penalty
    eased = np.where(gained >= 0.7 * predicted, 0.4 * sigma, sigma)
    state.proximity[active] = np.where(accepted, eased, 4.0 * sigma + 0.1)
    return (np.abs(trial - gamma) / rod.box.scales).max(axis=1) * (1 + sigma)


def _trials(
    rod: TipMap, near: Array, slope: Array, state: _State, active: Index
) -> tuple[Array, Array]:
    """Ends of the steps, and the multipliers of the linearized targets."""
    box, gamma = rod.box, state.gamma[active]
    weight = 1.0 + state.proximity[active, None]
    center = (near + state.proximity[active, None] * gamma) / weight
    wanted = np.einsum("nij,nj->ni", slope, gamma) - state.miss[active]
    softness = _SOFTNESS * (slope**2).sum(axis=(1, 2)) / (1.0 + state.penalty[active]) + 1e-30
    reach = _LONGEST_STEP * box.scales
    low, high = np.maximum(box.low, gamma - reach), np.minimum(box.high, gamma + reach)
    trial, multiplier = np.empty_like(gamma), np.empty((len(active), 3))
    project(center, slope, wanted, softness, low, high, trial, multiplier)
    return trial, multiplier * weight


def _merit(gamma: Array, near: Array, penalty: Array, miss: Array) -> Array:
    """½|γ - near|² + penalty·|miss|, shape of the leading axes."""
    return 0.5 * ((gamma - near) ** 2).sum(axis=-1) + penalty * np.linalg.norm(miss, axis=-1)


def _multipliers(rod: TipMap, request: Request, gamma: Array) -> Array:
    """λ for which γ - near + Jᵀλ is least, at the start: those of a solution were it one."""
    slopes = linearized(rod, gamma)[1] / rod.length
    slopes = np.nan_to_num(slopes, nan=0.0)  # of a start without a tip, which leads nowhere
    inverse = np.linalg.pinv(slopes.transpose(0, 2, 1), rcond=1e-3)
    return -np.einsum("nij,nj->ni", inverse, gamma - request.near)
