"""Least change with a wanted direction, among the activations that keep the tip where it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.inverse.descent import descend
from softreach.inverse.minimizer import minimize
from softreach.inverse.objective import Objective
from softreach.inverse.request import Request
from softreach.rod.tip_map import TipMap

__all__ = ["constrained_minima"]

Array = NDArray[np.float64]

_PENALTIES = (1e4, 1e5, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6)
"""Rising; with a lower first one a small miss would buy a large change of activation."""


def constrained_minima(rod: TipMap, request: Request, start: Array) -> tuple[Array, Array]:
    """Minimize ½|γ - near|² + ½ w²|d3 - direction|² subject to tip = target, from each start.

    Augmented Lagrangian, theory (40) [Hestenes1969] [Powell1969], whose inner searches respect the
    bounds, then descent to the target.

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
    found = descend(rod, request.targets, gamma, request.residual)
    return found.gamma, found.residual


def _multipliers(rod: TipMap, request: Request, gamma: Array) -> Array:
    """λ for which γ - near + Jᵀλ is least, at the start: those of a solution were it one."""
    slopes = rod.tips_and_slopes(gamma)[1] / rod.length
    slopes = np.nan_to_num(slopes, nan=0.0)  # of a start without a tip, which leads nowhere
    inverse = np.linalg.pinv(slopes.transpose(0, 2, 1), rcond=1e-3)
    return -np.einsum("nij,nj->ni", inverse, gamma - request.near)
