"""More bundles than the target needs: of all activations that reach it, those that change least."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.inverse.minimum import minimum
from softreach.inverse.nearest import Landmarks
from softreach.inverse.objective import Objective, tip_directions
from softreach.inverse.problem import tips_and_slopes

__all__ = ["LeastChange", "least_change", "least_changes"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_PENALTIES = (1e4, 1e5, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6)
"""Rising; with a lower first one a small miss would buy a large change of activation."""
_POLISH = 4
_LANDMARKS = 96


class LeastChange(NamedTuple):
    """Local solutions of: least |γ - near| with the tip at the target, within the bounds."""

    gamma: Array
    """Activations [-], shape (n, m)."""
    miss: Array
    """|tip - target| [m], shape (n,)."""
    settled: NDArray[np.bool_]
    """Whether the last search came to rest, shape (n,)."""


def least_change(
    arm: Manipulator,
    targets: Array,
    start: Array,
    near: Array,
    tol: float,
    residual: float,
    direction: Array | None = None,
    weight: float = 0.0,
) -> LeastChange:
    """Minimize ½|γ - near|² + ½ w²|d3 - direction|² subject to tip = target, from each start.

    Augmented Lagrangian (Hestenes, Powell) whose inner searches respect the bounds, then Newton on
    the position alone among the activations that are not at a bound.

    Args:
        arm: The design.
        targets: Reachable targets [m], shape (n, 3).
        start: Where to begin [-], shape (n, m).
        near: What to stay near to [-], shape (n, m).
        tol: Largest tip error, in L.
        residual: |tip - target| to come below [m].
        direction: Wanted tip directions, unit vectors, shape (n, 3).
        weight: What a direction error of 1 rad counts for against a change of 1.
    """
    low, high = arm.bounds.T.copy()
    gamma, multiplier = start.copy(), _multipliers(arm, start, near, tol)
    settled = np.ones(len(start), bool)
    miss = np.full(len(start), np.inf)
    for penalty in _PENALTIES:
        rows = np.flatnonzero(miss > 0.1 * residual)
        if not len(rows):
            break
        goal = Objective(
            arm=arm,
            tol=tol,
            targets=targets[rows],
            softness=1.0,
            near=near[rows],
            multiplier=multiplier[rows],
            penalty=penalty,
            direction=None if direction is None else direction[rows],
            weight=weight,
        )
        found = minimum(goal, gamma[rows], low, high)
        gamma[rows], settled[rows] = found.gamma, found.settled
        error = (tips_and_slopes(arm, found.gamma, tol)[0] - targets[rows]) / arm.length
        multiplier[rows] += penalty * error
        miss[rows] = np.linalg.norm(error, axis=1) * arm.length
    gamma, miss = _polished(arm, targets, gamma, tol)
    return LeastChange(gamma, miss, settled)


def _multipliers(arm: Manipulator, gamma: Array, near: Array, tol: float) -> Array:
    """λ for which γ - near + Jᵀλ is least, at the start: those of a solution were it one."""
    slopes = tips_and_slopes(arm, gamma, tol)[1] / arm.length
    inverse = np.linalg.pinv(slopes.transpose(0, 2, 1), rcond=1e-3)
    return -np.einsum("nij,nj->ni", inverse, gamma - near)


def _polished(arm: Manipulator, targets: Array, gamma: Array, tol: float) -> tuple[Array, Array]:
    """A few least-norm Newton steps on the position, of activations that are off their bounds."""
    low, high = arm.bounds.T
    best, least = gamma.copy(), np.full(len(gamma), np.inf)
    for _ in range(_POLISH):
        tips, slopes = tips_and_slopes(arm, gamma, tol)
        error = targets - tips
        miss = np.linalg.norm(error, axis=1)
        better = miss < least
        best[better], least[better] = gamma[better], miss[better]
        free = (gamma > low) & (gamma < high)
        inverse = np.linalg.pinv(slopes * free[:, None], rcond=1e-9)
        gamma = np.clip(gamma + np.einsum("nji,ni->nj", inverse, error), low, high)
    return best, least


def least_changes(
    arm: Manipulator,
    places: Landmarks,
    targets: Array,
    reached: Array,
    tol: float,
    residual: float,
    *,
    near: Array,
    direction: Array | None,
    weight: float,
    family: int,
    seed: int,
) -> tuple[Index, Array]:
    """The activation of least change for each target, then others of the solution family.

    The others are those nearest to `family - 1` random activations.

    Args:
        arm: The design.
        places: Landmarks to begin from.
        targets: Reachable targets [m], shape (t, 3).
        reached: An activation that reaches each [-], shape (t, m).
        tol: Largest tip error, in L.
        residual: Largest |tip - target| [m].
        near: What to stay near to [-], shape (t, m).
        direction: Wanted tip directions, shape (t, 3).
        weight: What they count for.
        family: Activations for each target.
        seed: Seed of the random ones.

    Returns:
        Number of the target and activation, sorted by target, those of least change first.
    """
    every = np.arange(len(targets))
    goals = np.repeat(near[:, None], family, axis=1)
    low, high = arm.bounds.T
    # One set for all targets, so that a target's family does not depend on its neighbors.
    goals[:, 1:] = np.random.default_rng(seed).uniform(low, high, (family - 1, arm.bundles))
    found, of = [], []
    for k in range(family):
        best = _best(
            arm, places, targets, reached, goals[:, k], tol, residual,
            None if direction is None or k else direction, weight,
        )  # fmt: skip
        good = best.miss <= residual
        of.append(every[good])
        found.append(best.gamma[good])
    order = np.argsort(np.concatenate(of), kind="stable")
    return np.concatenate(of)[order], np.concatenate(found)[order]


def _best(
    arm: Manipulator,
    places: Landmarks,
    targets: Array,
    reached: Array,
    near: Array,
    tol: float,
    residual: float,
    direction: Array | None,
    weight: float,
) -> LeastChange:
    """From the activation known to reach each target, and from landmarks of little change."""
    of, start = _starts(places, targets, near)
    of = np.concatenate([np.arange(len(targets)), of])
    start = np.concatenate([reached, start])
    wanted = None if direction is None else direction[of]
    found = least_change(arm, targets[of], start, near[of], tol, residual, wanted, weight)
    cost = np.linalg.norm(found.gamma - near[of], axis=1) ** 2
    if wanted is not None:
        off = tip_directions(arm, found.gamma, tol) - wanted
        cost += (weight * np.linalg.norm(off, axis=1)) ** 2
    order = np.lexsort((np.where(found.miss <= residual, cost, np.inf), of))
    best = order[np.searchsorted(of[order], np.arange(len(targets)))]
    return LeastChange(found.gamma[best], found.miss[best], found.settled[best])


def _starts(places: Landmarks, targets: Array, near: Array) -> tuple[Index, Array]:
    """Of the landmarks near each target, those that change least and lie apart."""
    gamma = places.gamma[places.near(targets, _LANDMARKS)]
    order = np.linalg.norm(gamma - near[:, None], axis=2).argsort(axis=1)
    gamma = np.take_along_axis(gamma, order[:, :, None], axis=1)
    return places.spread(gamma)
