"""Every activation of three bundles that puts the tip at a target."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.inverse.problem import tips_and_slopes
from softreach.kernels import candidates, folds, newton
from softreach.kernels.images import Mesh
from softreach.kernels.newton import CONVERGED, UNDER_WAY, Search
from softreach.kernels.space_tree import SpaceTree
from softreach.kinematics import tip_positions
from softreach.manipulator import Manipulator

__all__ = ["ROUNDING", "Found", "conditions", "distinct", "every_branch", "starts"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

ROUNDING = 1e-13
"""Of a tip, in L, with room to spare."""

_BLOCK = 1024
_ROUNDS = 40
_PARTNER_RANGE = 1.5  # widths of a cell within which a fold's other preimage is looked for


class Found(NamedTuple):
    """Activations found, each for one of the targets."""

    target: Index
    """Number of the target, shape (n,)."""
    gamma: Array
    """Activations [-], shape (n, 3)."""
    slope: Array
    """Position Jacobians [m], shape (n, 3, 3)."""
    residual: Array
    """|tip - target| [m], shape (n,)."""
    cell: Index
    """Cell of the mesh where the search began, shape (n,)."""

    def where(self, chosen: NDArray[np.bool_] | Index) -> Found:
        """Those chosen by a mask or an index."""
        return Found(
            self.target[chosen],
            self.gamma[chosen],
            self.slope[chosen],
            self.residual[chosen],
            self.cell[chosen],
        )

    def and_also(self, other: Found) -> Found:
        """Both, sorted by target."""
        both = Found(
            np.concatenate([self.target, other.target]),
            np.concatenate([self.gamma, other.gamma]),
            np.concatenate([self.slope, other.slope]),
            np.concatenate([self.residual, other.residual]),
            np.concatenate([self.cell, other.cell]),
        )
        return both.where(np.argsort(both.target, kind="stable"))


def every_branch(
    arm: Manipulator, mesh: Mesh, tree: SpaceTree, targets: Array, tol: float, residual: float
) -> Found:
    """All solutions inside the bounds, sorted by target.

    Args:
        arm: A design of three bundles.
        mesh: Its `box_mesh`.
        tree: The mesh's `space_tree`.
        targets: Targets [m], shape (t, 3).
        tol: Largest tip error, in L.
        residual: Largest |tip - target| of a solution [m].
    """
    rounding = ROUNDING * arm.length
    target, cell, start = starts(arm, mesh, tree, targets)
    found = _within(
        arm, _search(arm, target, cell, start, targets, tol, residual), targets, tol, residual
    )
    found = distinct(found, len(targets), rounding)
    fresh = found
    for _ in range(2):  # a partner may have a partner of its own where two folds meet
        target, cell, start = _partners(arm, mesh, fresh)
        fresh = _search(arm, target, cell, start, targets, tol, residual)
        fresh = _within(arm, fresh, targets, tol, residual)
        before = len(found.target)
        found = distinct(found.and_also(fresh), len(targets), rounding)
        if len(found.target) == before:
            break
    return found


def _search(
    arm: Manipulator,
    target: Index,
    cell: Index,
    start: Array,
    targets: Array,
    tol: float,
    residual: float,
) -> Found:
    """Damped Newton from every start (n, 3); those that arrive, wherever that is."""
    low, high = arm.bounds.T.copy()
    state = _begun(targets[target], start)
    for _ in range(_ROUNDS):
        active = np.flatnonzero(state.state == UNDER_WAY)
        if not len(active):
            break
        tips, slopes = tips_and_slopes(arm, state.trial[active], tol)
        newton.newton_step(state, active, tips, slopes, low, high, residual)
    arrived = np.flatnonzero(state.state == CONVERGED)
    # The step that convergence left untaken; `_within` evaluates it.
    return Found(target, state.trial, state.slope, state.residual, cell).where(arrived)


def _begun(goal: Array, start: Array) -> Search:
    n = len(start)
    return Search(
        goal=goal,
        gamma=start.copy(),
        slope=np.zeros((n, 3, 3)),
        residual=np.full(n, 1e300),
        step=np.zeros((n, 3)),
        part=np.ones(n),
        trial=start.copy(),
        state=np.full(n, UNDER_WAY),
    )


def starts(
    arm: Manipulator, mesh: Mesh, tree: SpaceTree, targets: Array
) -> tuple[Index, Index, Array]:
    """Target, cell and activation of every start, sorted by target."""
    low, high = arm.bounds.T.copy()
    blocks = list(parallel.blocks(len(targets), _BLOCK))
    parts: list[list[tuple[Index, Index, Array]]] = [[] for _ in blocks]

    def fill(part: list[tuple[Index, Index, Array]], first: int, last: int) -> None:
        room = candidates.MOST + 4 * _BLOCK
        target, cell, start = (
            np.empty(room, np.int64),
            np.empty(room, np.int64),
            np.empty((room, 3)),
        )
        while first < last:
            done, found = candidates.find_starts(
                mesh, tree, targets[first:last], low, high, target, cell, start
            )
            part.append((target[:found] + first, cell[:found].copy(), start[:found].copy()))
            first += done

    parallel.run(
        partial(fill, part, b.start, b.stop) for part, b in zip(parts, blocks, strict=True)
    )
    everything = [_no_starts(), *(piece for part in parts for piece in part)]
    target, cell, start = (np.concatenate(pieces) for pieces in zip(*everything, strict=True))
    return target, cell, start


def _no_starts() -> tuple[Index, Index, Array]:
    return np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 3))


def _within(arm: Manipulator, found: Found, targets: Array, tol: float, residual: float) -> Found:
    """Solutions moved onto the bounds they overstep, if they still are solutions there."""
    low, high = arm.bounds.T
    gamma = np.clip(found.gamma, low, high)
    tips = tip_positions(arm, gamma, tol)
    missed = np.linalg.norm(tips - targets[found.target], axis=1)
    return found._replace(gamma=gamma, residual=missed).where(missed <= residual)


def distinct(found: Found, targets: int, rounding: float) -> Found:
    """Every solution once; those of a target nearer than `rounding` allows are one."""
    offsets = np.searchsorted(found.target, np.arange(targets + 1))
    smallest, _ = conditions(found.slope)
    kept = np.ones(len(found.target), bool)
    newton.merge(offsets, found.gamma, found.residual, smallest, rounding, kept)
    return found.where(kept)


def _partners(arm: Manipulator, mesh: Mesh, found: Found) -> tuple[Index, Index, Array]:
    """Target, cell and start of the second preimage of every solution with a fold near."""
    low, high = arm.bounds.T.copy()
    smallest, _ = conditions(found.slope)
    start, near = np.empty_like(found.gamma), np.zeros(len(found.target), bool)
    folds.partners(
        mesh, found.cell, found.gamma, found.slope, smallest, _PARTNER_RANGE, low, high, start, near
    )
    return found.target[near], found.cell[near], start[near]


def conditions(slope: Array) -> tuple[Array, Array]:
    """Smallest singular values [m] and condition numbers of 3x3 Jacobians."""
    smallest, condition = np.empty(len(slope)), np.empty(len(slope))
    newton.conditions(slope, smallest, condition)
    return smallest, condition
