"""More bundles than the target needs: of all activations that reach it, those that change least."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softreach.inverse.landmarks import Landmarks
from softreach.inverse.minimizer import minimize
from softreach.inverse.objective import Objective
from softreach.inverse.prepared_map import PreparedMap
from softreach.inverse.request import Request
from softreach.rod.tip_map import TipMap

__all__ = ["constrained_minima", "least_changes"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PENALTIES = (1e4, 1e5, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6)
"""Rising; with a lower first one a small miss would buy a large change of activation."""
_PROJECTIONS = 4
_CANDIDATES = 96


def least_changes(prepared: PreparedMap, request: Request, known: Array) -> tuple[Index, Array]:
    """The activation of least change for each target, then others of the solution family.

    The others are those nearest to `family - 1` random activations, whatever their direction.

    Args:
        prepared: The tip map.
        request: Targets that can be reached, and what is preferred.
        known: An activation that reaches each target [-], shape (t, m).

    Returns:
        Number of the target and activation, sorted by target, those of least change first.
    """
    count, box = len(known), prepared.rod.box
    # One set for all targets, so that a target's family does not depend on its neighbors.
    rng = np.random.default_rng(request.seed)
    others = rng.uniform(box.low, box.high, (request.family - 1, box.bundles))
    asked = [request]
    asked += [replace(request, near=np.tile(near, (count, 1)), direction=None) for near in others]
    targets, found = [np.empty(0, np.int64)], [np.empty((0, box.bundles))]
    for one in asked:
        gamma, residual = _least_change(prepared, one, known)
        reached = np.flatnonzero(residual <= request.residual)
        targets.append(reached)
        found.append(gamma[reached])
    target = np.concatenate(targets)
    order = np.argsort(target, kind="stable")
    return target[order], np.concatenate(found)[order]


def _least_change(prepared: PreparedMap, request: Request, known: Array) -> tuple[Array, Array]:
    """The best of the constrained minima from several starts: activations and residuals [m].

    Starts are the activation known to reach each target, and landmarks of little change.
    """
    count = len(known)
    target, start = _starts(prepared.landmarks, request)
    target, start = np.concatenate([np.arange(count), target]), np.concatenate([known, start])
    each = request.of(target)
    gamma, residual = constrained_minima(prepared.rod, each, start)
    cost = np.where(residual <= request.residual, _cost(prepared.rod, each, gamma), np.inf)
    order = np.lexsort((cost, target))
    best = order[np.searchsorted(target[order], np.arange(count))]
    return gamma[best], residual[best]


def _starts(landmarks: Landmarks, request: Request) -> tuple[Index, Array]:
    """Of the landmarks near each target, those that change least and lie apart."""
    gamma = landmarks.nearest(request.targets, _CANDIDATES)
    order = np.linalg.norm(gamma - request.near[:, None], axis=2).argsort(axis=1)
    return landmarks.starts(np.take_along_axis(gamma, order[:, :, None], axis=1))


def _cost(rod: TipMap, request: Request, gamma: Array) -> Array:
    """|γ - near|² + w² |d3 - direction|², shape (n,)."""
    cost = np.linalg.norm(gamma - request.near, axis=1) ** 2
    if request.direction is not None:
        error = rod.tip_directions(gamma) - request.direction
        cost += (request.direction_weight * np.linalg.norm(error, axis=1)) ** 2
    return cost


def constrained_minima(rod: TipMap, request: Request, start: Array) -> tuple[Array, Array]:
    """Minimize ½|γ - near|² + ½ w²|d3 - direction|² subject to tip = target, from each start.

    Augmented Lagrangian, theory (40) [Hestenes1969] [Powell1969], whose inner searches respect the
    bounds, then Newton on the position alone among the activations that are not at a bound.

    Args:
        rod: The tip map.
        request: A target for each start, and what is preferred.
        start: Where to begin [-], shape (n, m).

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
        error = (rod.tips_and_slopes(gamma[rows])[0] - part.targets) / rod.length
        multiplier[rows] += penalty * error  # theory (40)
        residual[rows] = np.linalg.norm(error, axis=1) * rod.length
    return _projected(rod, request.targets, gamma)


def _multipliers(rod: TipMap, request: Request, gamma: Array) -> Array:
    """λ for which γ - near + Jᵀλ is least, at the start: those of a solution were it one."""
    slopes = rod.tips_and_slopes(gamma)[1] / rod.length
    inverse = np.linalg.pinv(slopes.transpose(0, 2, 1), rcond=1e-3)
    return -np.einsum("nij,nj->ni", inverse, gamma - request.near)


def _projected(rod: TipMap, targets: Array, gamma: Array) -> tuple[Array, Array]:
    """A few least-norm Newton steps, theory (39), of the activations that are off their bounds."""
    box = rod.box
    best, least = gamma.copy(), np.full(len(gamma), np.inf)
    for _ in range(_PROJECTIONS):
        tips, slopes = rod.tips_and_slopes(gamma)
        error = targets - tips
        residual = np.linalg.norm(error, axis=1)
        better = residual < least
        best[better], least[better] = gamma[better], residual[better]
        inside = (gamma > box.low) & (gamma < box.high)
        inverse = np.linalg.pinv(slopes * inside[:, None], rcond=1e-9)
        gamma = box.clip(gamma + np.einsum("nji,ni->nj", inverse, error))
    return best, least
