"""Every activation of three bundles that puts the tip at a target."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.arm.manipulator import Manipulator
from softreach.inverse.problem import tips_and_slopes
from softreach.kernels import candidates, folds, newton
from softreach.kernels.activation_mesh import ActivationMesh
from softreach.kernels.newton import CONVERGED, RUNNING, Search
from softreach.kernels.space_tree import SpaceTree
from softreach.rod.kinematics import tip_positions

__all__ = ["Aim", "Found", "conditions", "distinct", "every_branch", "starts"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_ROUNDING = 1e-13  # of a tip, in L, with room to spare

_BLOCK = 1024
_ROUNDS = 40
_PARTNER_RANGE = 1.5  # widths of a cell within which a fold's other preimage is looked for


class Aim(NamedTuple):
    """What is to be reached."""

    arm: Manipulator
    """The design."""
    targets: Array
    """Targets [m], shape (t, 3)."""
    tol: float
    """Largest tip error, in L."""
    residual: float
    """Largest |tip - target| of a solution [m]."""


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


def every_branch(aim: Aim, mesh: ActivationMesh, tree: SpaceTree) -> Found:
    """All solutions inside the bounds, sorted by target.

    Args:
        aim: What is to be reached, by a design of three bundles.
        mesh: Its `box_mesh`.
        tree: The mesh's `space_tree`.
    """
    every = np.arange(len(aim.targets))
    found = _searched(aim, *starts(aim, mesh, tree, every))
    # Where the quadratics say that nothing leads there, look once more without believing them.
    missing = np.flatnonzero(np.bincount(found.target, minlength=len(every)) == 0)
    found = found.and_also(_searched(aim, *starts(aim, mesh, tree, missing, strict=False)))
    found = fresh = distinct(aim, found)
    for _ in range(2):  # a partner may have a partner of its own where two folds meet
        fresh = _searched(aim, *_partners(aim, mesh, fresh))
        before = len(found.target)
        found = distinct(aim, found.and_also(fresh))
        if len(found.target) == before:
            break
    return found


def _searched(aim: Aim, target: Index, cell: Index, start: Array) -> Found:
    """Damped Newton from every start (n, 3); the solutions that arrive within the bounds."""
    low, high = aim.arm.bounds.T.copy()
    state = _begun(aim.targets[target], start)
    for _ in range(_ROUNDS):
        active = np.flatnonzero(state.state == RUNNING)
        if not len(active):
            break
        tips, slopes = tips_and_slopes(aim.arm, state.trial[active], aim.tol)
        newton.newton_step(state, active, tips, slopes, low, high, aim.residual)
    arrived = np.flatnonzero(state.state == CONVERGED)
    # The trial holds the step that convergence left untaken; it may overstep a bound a little.
    gamma, target = np.clip(state.trial[arrived], low, high), target[arrived]
    tips = tip_positions(aim.arm, gamma, aim.tol)
    missed = np.linalg.norm(tips - aim.targets[target], axis=1)
    found = Found(target, gamma, state.slope[arrived], missed, cell[arrived])
    return found.where(missed <= aim.residual)


def _begun(target: Array, start: Array) -> Search:
    n = len(start)
    return Search(
        target=target,
        gamma=start.copy(),
        slope=np.zeros((n, 3, 3)),
        residual=np.full(n, 1e300),
        step=np.zeros((n, 3)),
        damping=np.ones(n),
        trial=start.copy(),
        state=np.full(n, RUNNING),
    )


def starts(
    aim: Aim, mesh: ActivationMesh, tree: SpaceTree, rows: Index, strict: bool = True
) -> tuple[Index, Index, Array]:
    """Target, cell and activation of every start for some of the targets, sorted."""
    targets = aim.targets[rows]
    low, high = aim.arm.bounds.T.copy()
    blocks = list(parallel.blocks(len(targets), _BLOCK))
    parts: list[list[tuple[Index, Index, Array]]] = [[] for _ in blocks]

    def fill(part: list[tuple[Index, Index, Array]], first: int, last: int) -> None:
        room = candidates.MOST_STARTS + 4 * _BLOCK
        target, cell, start = (
            np.empty(room, np.int64),
            np.empty(room, np.int64),
            np.empty((room, 3)),
        )
        while first < last:
            done, found = candidates.find_starts(
                mesh, tree, targets[first:last], low, high, strict, target, cell, start
            )
            part.append((rows[target[:found] + first], cell[:found].copy(), start[:found].copy()))
            first += done

    parallel.run(
        partial(fill, part, b.start, b.stop) for part, b in zip(parts, blocks, strict=True)
    )
    everything = [_no_starts(), *(piece for part in parts for piece in part)]
    target, cell, start = (np.concatenate(pieces) for pieces in zip(*everything, strict=True))
    return target, cell, start


def _no_starts() -> tuple[Index, Index, Array]:
    return np.empty(0, np.int64), np.empty(0, np.int64), np.empty((0, 3))


def distinct(aim: Aim, found: Found) -> Found:
    """Every solution once."""
    offsets = np.searchsorted(found.target, np.arange(len(aim.targets) + 1))
    smallest, _ = conditions(found.slope)
    kept = np.ones(len(found.target), bool)
    rounding = _ROUNDING * aim.arm.length
    newton.merge_equal(offsets, found.gamma, found.residual, smallest, rounding, kept)
    return found.where(kept)


def _partners(aim: Aim, mesh: ActivationMesh, found: Found) -> tuple[Index, Index, Array]:
    """Target, cell and start of the second preimage of every solution with a fold near."""
    low, high = aim.arm.bounds.T.copy()
    smallest, _ = conditions(found.slope)
    start, near = np.empty_like(found.gamma), np.zeros(len(found.target), bool)
    folds.second_preimages(
        mesh, found.cell, found.gamma, found.slope, smallest, _PARTNER_RANGE, low, high, start, near
    )
    return found.target[near], found.cell[near], start[near]


def conditions(slope: Array) -> tuple[Array, Array]:
    """Smallest singular values [m] and condition numbers of 3x3 Jacobians."""
    smallest, condition = np.empty(len(slope)), np.empty(len(slope))
    newton.conditions(slope, smallest, condition)
    return smallest, condition
