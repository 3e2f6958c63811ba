"""One block of targets, from the question to the answer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.inverse.branches import Aim, Found, conditions, distinct, every_branch, starts
from softreach.inverse.mesh import box_mesh
from softreach.inverse.nearest import Landmarks, Nearest, descend, landmarks, nearest
from softreach.inverse.problem import tips_and_slopes
from softreach.inverse.redundant import least_changes
from softreach.inverse.solutions import Solutions, Status
from softreach.inverse.tree import space_tree
from softreach.kernels.activation_mesh import ActivationMesh
from softreach.kernels.space_tree import SpaceTree

__all__ = ["CELLS", "Answer", "Preparation", "Wishes", "answer", "collected"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

CELLS = 32
"""Cells along each axis of the activation box of three bundles."""


@dataclass(frozen=True)
class Preparation:
    """What is computed once for a design, when first needed."""

    arm: Manipulator
    """The design."""
    tip_tol: float
    """Largest error of the tips, in L."""
    cells: int = CELLS
    """Cells along each axis of the activation box."""
    depth: int = 0
    """How often a cell may be halved where the map folds."""

    @cached_property
    def landmarks(self) -> Landmarks:
        """Where searches for the nearest point begin."""
        return landmarks(self.arm, self.tip_tol)

    @cached_property
    def index(self) -> tuple[ActivationMesh, SpaceTree]:
        """The cells of the activation box and where their images lie."""
        mesh = box_mesh(self.arm, self.tip_tol, self.cells, self.depth)
        return mesh, space_tree(mesh)

    @property
    def determined(self) -> bool:
        """Whether there are as many free bundles as coordinates, and no other."""
        low, high = self.arm.bounds.T
        return self.arm.bundles == 3 and bool((high > low).all())


@dataclass(frozen=True, kw_only=True)
class Wishes:
    """What is asked of the activations besides the target."""

    residual: float
    """Largest |tip - target| [m]."""
    near: Array
    """Activations to stay near to [-], shape (t, m)."""
    direction: Array | None
    """Wanted tip tangents, shape (t, 3)."""
    weight: float
    """What they count for."""
    family: int
    """Activations wanted for each target when there are many."""
    seed: int
    """Seed of the others."""

    def of(self, rows: slice) -> Wishes:
        """The wishes for some of the targets."""
        direction = None if self.direction is None else self.direction[rows]
        return replace(self, near=self.near[rows], direction=direction)


class Answer(NamedTuple):
    """Activations found, sorted by target, and how each target fared."""

    target: Index
    gamma: Array
    residual: Array
    condition: Array
    status: NDArray[np.int8]
    nearest: Array
    nearest_activation: Array
    gap: Array


def answer(prepared: Preparation, targets: Array, wishes: Wishes) -> Answer:
    """Solve for one block of targets."""
    found = _no_solutions(prepared.arm)
    if prepared.determined:
        aim = Aim(prepared.arm, targets, prepared.tip_tol, wishes.residual)
        found = every_branch(aim, *prepared.index)
    if wishes.direction is not None or not prepared.determined:
        return _by_search(prepared, targets, wishes, found)
    found = found.and_also(_stubborn(prepared, targets, wishes, _missing(found, targets)))
    missing = _missing(found, targets)
    close = nearest(prepared.arm, prepared.landmarks, targets[missing], prepared.tip_tol)
    return _answer(prepared, targets, wishes, found, missing, close)


def _missing(found: Found, targets: Array) -> Index:
    return np.flatnonzero(np.bincount(found.target, minlength=len(targets)) == 0)


def _stubborn(prepared: Preparation, targets: Array, wishes: Wishes, missing: Index) -> Found:
    """What descent finds where Newton's method found nothing: solutions at a singular Jacobian."""
    aim = Aim(prepared.arm, targets, prepared.tip_tol, wishes.residual)
    target, _, start = starts(aim, *prepared.index, missing)
    found = descend(prepared.arm, targets, target, start, prepared.tip_tol)
    found = _evaluated(prepared, targets, target, found.gamma)
    return distinct(aim, found.where(found.residual <= wishes.residual))


def _by_search(prepared: Preparation, targets: Array, wishes: Wishes, found: Found) -> Answer:
    """Answer by minimizing from landmarks, and from known solutions."""
    arm, everything = prepared.arm, np.arange(len(targets))
    soft = wishes.direction if arm.bundles <= 3 else None
    close = nearest(
        arm,
        prepared.landmarks,
        targets,
        prepared.tip_tol,
        direction=soft,
        weight=wishes.weight,
        more=(found.target, found.gamma),
    )
    found = _no_solutions(arm)
    if arm.bundles > 3:
        reached = np.linalg.norm(close.tip - targets, axis=1) <= wishes.residual
        rows = np.flatnonzero(reached)
        target, gamma = least_changes(
            arm,
            prepared.landmarks,
            targets[rows],
            close.gamma[rows],
            prepared.tip_tol,
            wishes.residual,
            near=wishes.near[rows],
            direction=None if wishes.direction is None else wishes.direction[rows],
            weight=wishes.weight,
            family=wishes.family,
            seed=wishes.seed,
        )
        found = _evaluated(prepared, targets, rows[target], gamma)
        missing = _missing(found, targets)
        return _answer(prepared, targets, wishes, found, missing, close.of(missing))
    return _answer(prepared, targets, wishes, found, everything, close)


def _answer(
    prepared: Preparation,
    targets: Array,
    wishes: Wishes,
    found: Found,
    missing: Index,
    close: Nearest,
) -> Answer:
    """Put together what was found and, for the targets that are missing, what came nearest."""
    rescued = _evaluated(prepared, targets, missing, close.gamma)
    found = found.and_also(rescued.where(rescued.residual <= wishes.residual))
    status = np.full(len(targets), Status.REACHED, np.int8)
    far = rescued.residual > wishes.residual
    status[missing] = np.where(close.settled, Status.UNREACHABLE, Status.NOT_CONVERGED)
    # Reached by the nearest point alone: the least change was not found.
    status[missing[~far]] = Status.NOT_CONVERGED if prepared.arm.bundles > 3 else Status.REACHED
    first = np.minimum(
        np.searchsorted(found.target, np.arange(len(targets))), len(found.target) - 1
    )
    activation = np.empty((len(targets), prepared.arm.bundles))
    gap = np.empty(len(targets))
    point = targets.copy()
    if len(found.target):
        activation[:], gap[:] = found.gamma[first], found.residual[first]
    activation[missing], gap[missing], point[missing] = close.gamma, rescued.residual, close.tip
    return Answer(
        found.target,
        found.gamma,
        found.residual,
        _condition(found.slope),
        status,
        point,
        activation,
        gap,
    )


def _evaluated(prepared: Preparation, targets: Array, target: Index, gamma: Array) -> Found:
    tips, slopes = tips_and_slopes(prepared.arm, gamma, prepared.tip_tol)
    missed = np.linalg.norm(tips - targets[target], axis=1)
    return Found(target, gamma, slopes, missed, np.zeros(len(target), np.int64))


def _no_solutions(arm: Manipulator) -> Found:
    none, m = np.empty(0, np.int64), arm.bundles
    return Found(none, np.empty((0, m)), np.empty((0, 3, m)), np.empty(0), none)


def _condition(slope: Array) -> Array:
    """Condition numbers of position Jacobians (n, 3, m)."""
    if slope.shape[2] == 3:
        return conditions(slope)[1]
    sigma = np.linalg.svd(slope, compute_uv=False)
    with np.errstate(divide="ignore"):
        return sigma[:, 0] / sigma[:, -1]


def collected(arm: Manipulator, targets: Array, answers: Sequence[Answer]) -> Solutions:
    """The answers to consecutive blocks of targets as one result."""
    counts = [np.bincount(part.target, minlength=len(part.status)) for part in answers]
    offsets = np.concatenate([[0], np.cumsum(np.concatenate([np.empty(0, int), *counts]))])
    empty = _no_answer(arm)
    whole = Answer(*(np.concatenate(parts) for parts in zip(empty, *answers, strict=True)))
    return Solutions(
        arm=arm,
        targets=targets,
        offsets=offsets.astype(np.int64),
        activations=whole.gamma,
        residuals=whole.residual,
        condition=whole.condition,
        margin=_margin(arm, whole.gamma),
        status=whole.status,
        nearest=whole.nearest,
        nearest_activation=whole.nearest_activation,
        gap=whole.gap,
    )


def _no_answer(arm: Manipulator) -> Answer:
    none, m = np.empty(0), arm.bundles
    return Answer(
        np.empty(0, np.int64),
        np.empty((0, m)),
        none,
        none,
        np.empty(0, np.int8),
        np.empty((0, 3)),
        np.empty((0, m)),
        none,
    )


def _margin(arm: Manipulator, gamma: Array) -> Array:
    """Smallest distance to a bound over its range, of the bundles that are free to move."""
    low, high = arm.bounds.T
    free = high > low
    if not free.any():
        return np.zeros(len(gamma))
    room = np.minimum(gamma - low, high - gamma)[:, free] / (high - low)[free]
    return room.min(axis=1)
