"""Local minima of the change of activation among the activations that reach a target."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.inverse.descent import Objective, descend, linearized, minimize
from softreach.inverse.request import Request
from softreach.kernels.box.box_projection import project
from softreach.kernels.box.sequential_projection import (
    FIRST_PROXIMITY,
    LONGEST_STEP,
    NOWHERE,
    Running,
    judge,
    next_trials,
)
from softreach.rod.tip_map import BLOCK, TipMap
from softreach.support import parallel
from softreach.support.arrays import Array, Index

_TOGETHER = BLOCK // 16  # searches that one thread runs side by side

_PENALTIES = (1e4, 1e5, 1e6, 1e6, 1e6, 1e6, 1e6, 1e6)
"""Rising; with a lower first one a small miss would buy a large change of activation."""


class Minima(NamedTuple):
    """Ends of searches for the least change."""

    gamma: Array
    """Activations [-], shape (n, m)."""
    residual: Array
    """|tip - target| [m], shape (n,)."""
    merit: Array
    """½|γ - near|² and the penalty of the miss, shape (n,)."""
    proximity: Array
    """σ of the last step, shape (n,)."""
    penalty: Array
    """Penalty of the miss, in 1/L: half as much again as its multiplier, shape (n,)."""


def sqp(
    rod: TipMap,
    request: Request,
    owner: Index,
    start: Array,
    *,
    penalty: float = 0.0,
    proximity: Array | float = FIRST_PROXIMITY,
    settled: float = 1e-6,
    most: int = 60,
) -> Minima:
    """Minimize ½|γ - near|² subject to tip = target and bounds, from each start.

    Each step minimizes ½|x - near|² + ½σ|x - γ|² where the linearized map meets the target, inside
    the bounds, exactly: sequential quadratic programming with a multiple of the identity for
    the Hessian, of which σ is a secant estimate. It is taken if ½|x - near|² + penalty·|miss| falls
    as it should; else σ grows.

    Args:
        rod: The tip map.
        request: Targets, and what to stay near to.
        owner: Number of the target of each start, shape (n,).
        start: Activations to begin with, inside the bounds [-], shape (n, m).
        penalty: Least penalty. A high one keeps a search near the target once it is there, as it
            must where the target lies next to a fold or to the boundary of the reachable set.
        proximity: σ of the first step, shape (n,) or one for all.
        settled: Step at which a search ends, in ranges.
        most: Steps.
    """
    # Copies: kernels are compiled once more for arrays that are read-only or not contiguous.
    n, owner = len(start), owner.copy()
    request = replace(request, targets=request.targets.copy(), near=request.near.copy())
    begin = np.empty(n)
    begin[:] = proximity
    minima = Minima(start.copy(), np.empty(n), np.empty(n), begin, np.empty(n))
    # Searches that end make room for others; only the last of a task run by a few.
    share = max(_TOGETHER, -(-n // parallel.thread_count()))
    rod.prepare()
    search = partial(_searched, rod, request, penalty=penalty, limits=(settled, most))
    parallel.run(
        partial(search, owner[block], Minima(*(part[block] for part in minima)))
        for block in parallel.blocks(n, share)
    )
    return minima._replace(residual=minima.residual * rod.length)


def _searched(
    rod: TipMap,
    request: Request,
    owner: Index,
    ends: Minima,
    penalty: float,
    limits: tuple[float, int],
) -> None:
    """Run the searches that begin at `ends`, on the calling thread."""
    box, total = rod.box, len(owner)
    bounds = (box.low.copy(), box.high.copy(), box.scales.copy())
    running = _room(min(total, _TOGETHER), box.bundles)
    tips, ahead = np.empty_like(running.miss), np.empty_like(running.slope)
    begun = n = 0
    while begun < total or n:
        more = min(total - begun, len(tips) - n)
        new, rows = slice(n, n + more), slice(begun, begun + more)
        running.row[new], running.steps[new] = np.arange(begun, begun + more), 0
        running.trial[new], running.proximity[new] = ends.gamma[rows], ends.proximity[rows]
        running.penalty[new], running.multiplier[new] = penalty, 0.0
        running.reach[new] = LONGEST_STEP
        n, begun = n + more, begun + more
        rod.fill(running.trial[:n], tips[:n], ahead[:n])
        if rod.supports_unstable:
            lost = np.isnan(tips[:n, 0])
            tips[:n][lost], ahead[:n][lost] = NOWHERE, 0.0
        asked = request.targets, request.near
        n = judge(running, n, tips, ahead, owner, *asked, bounds, rod.length, limits, ends)
        steps = (part[:n] for part in (running.center, running.slope, running.wanted))
        limited = (part[:n] for part in (running.softness, running.low, running.high))
        project(*steps, *limited, running.trial[:n], running.multiplier[:n])
        next_trials(running, n, owner, request.near)


def _room(n: int, m: int) -> Running:
    return Running(
        row=np.empty(n, np.int64),
        steps=np.empty(n, np.int64),
        slope=np.empty((n, 3, m)),
        **{name: np.empty((n, 3)) for name in ("miss", "wanted", "multiplier")},
        **{name: np.empty((n, m)) for name in ("gamma", "center", "low", "high", "trial")},
        **{name: np.empty(n) for name in ("penalty", "proximity", "reach", "weight")},
        **{name: np.empty(n) for name in ("gain", "softness")},
    )


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
        assert part.direction is not None
        lagrangian = Objective(
            rod=rod,
            targets=part.targets,
            penalty=penalty,
            multiplier=multiplier[rows],
            near=part.near,
            direction=part.direction,
            direction_weight=part.direction_weight,
        )
        gamma[rows] = minimize(lagrangian, gamma[rows], rod.box)[0]
        error = (linearized(rod, gamma[rows])[0] - part.targets) / rod.length
        multiplier[rows] += penalty * error  # theory (40)
        residual[rows] = np.linalg.norm(error, axis=1) * rod.length
    ends = descend(rod, request.targets, gamma, request.residual)
    return ends.gamma, ends.residual


def _multipliers(rod: TipMap, request: Request, gamma: Array) -> Array:
    """λ for which γ - near + Jᵀλ is least, at the start: those of a solution were it one."""
    slopes = linearized(rod, gamma)[1] / rod.length
    slopes = np.nan_to_num(slopes, nan=0.0)  # of a start without a tip, which leads nowhere
    inverse = np.linalg.pinv(slopes.transpose(0, 2, 1), rcond=1e-3)
    return -np.einsum("nij,nj->ni", inverse, gamma - request.near)
