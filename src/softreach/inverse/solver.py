"""Solving for activations: a design is prepared once, then any number of targets."""

from __future__ import annotations

from functools import lru_cache

from numpy.typing import ArrayLike

from softreach import parallel
from softreach.arm.manipulator import Manipulator
from softreach.inverse.answer import CELLS, Preparation, Wishes, answer, collected
from softreach.inverse.problem import (
    checked_direction,
    checked_near,
    checked_number,
    checked_targets,
)
from softreach.inverse.solutions import Solutions

__all__ = ["InverseSolver", "solve_inverse"]

_CHUNK = 32_768  # targets at once: bounds the memory of a call


def solve_inverse(
    arm: Manipulator,
    targets: ArrayLike,
    *,
    tol: float = 1e-10,
    near: ArrayLike | None = None,
    direction: ArrayLike | None = None,
    direction_weight: float = 0.1,
    family: int = 1,
    seed: int = 0,
    tip_tol: float = 1e-6,
) -> Solutions:
    """The activations that put the tip at each target, or as near to it as the arm can reach.

    With three bundles: every activation within the bounds, by Newton's method from every cell of
    the activation box whose image covers the target. With more: the one of least |γ - near|, and
    `family - 1` others on request. With fewer, or out of reach: the nearest reachable point.
    The design is prepared at the first call and remembered.

    Args:
        arm: The design.
        targets: Tip positions to reach [m], shape (t, 3).
        tol: Largest |tip - target| of a solution, in L.
        near: With more than three bundles: the activation to stay near to [-], shape (m,) or
            (t, m); by default rest.
        direction: Wanted tip tangents d3, shape (3,) or (t, 3), of any length. With more than
            three bundles the freedom left by the position goes to least
            |γ - near|² + w² |d3 - direction|²; with three or fewer the position yields too:
            least |tip - target|²/L² + w² |d3 - direction|².
        direction_weight: w [-].
        family: With more than three bundles: how many activations to give for each target,
            the others being those nearest to random activations.
        seed: Seed of these.
        tip_tol: Largest error of the tips themselves, in L; the residual refers to
            `tip_positions` with this tolerance.

    Returns:
        One `Solution` for each target; failures are its status, never an exception.

    Raises:
        InvalidInput: Arguments of another shape, not finite, or out of range.
    """
    return _prepared(arm, float(tip_tol))(
        targets,
        tol=tol,
        near=near,
        direction=direction,
        direction_weight=direction_weight,
        family=family,
        seed=seed,
    )


class InverseSolver:
    """A design prepared for `solve_inverse`; what is not needed is not prepared."""

    def __init__(
        self, arm: Manipulator, *, tip_tol: float = 1e-6, cells: int = CELLS, depth: int = 0
    ) -> None:
        """Prepare a design.

        Args:
            arm: The design.
            tip_tol: Largest error of the tips, in L.
            cells: With three bundles: cells along each axis of the activation box.
            depth: How often a cell is halved where det J changes sign or is uneven.
        """
        self.preparation = Preparation(arm, tip_tol, cells, depth)

    def __call__(
        self,
        targets: ArrayLike,
        *,
        tol: float = 1e-10,
        near: ArrayLike | None = None,
        direction: ArrayLike | None = None,
        direction_weight: float = 0.1,
        family: int = 1,
        seed: int = 0,
    ) -> Solutions:
        """As `solve_inverse`."""
        arm, points = self.preparation.arm, checked_targets("targets", targets)
        tol = checked_number("tol", tol, 1e-13, 1e-2)
        wishes = Wishes(
            residual=tol * arm.length,
            near=checked_near(arm, near, len(points)),
            direction=None if direction is None else checked_direction(direction, len(points)),
            weight=checked_number("direction_weight", direction_weight, 0.0, 1e6),
            family=int(checked_number("family", family, 1, 10_000)),
            seed=int(checked_number("seed", seed, 0, 2**63)),
        )
        rows = parallel.blocks(len(points), _CHUNK)
        answers = [answer(self.preparation, points[r], wishes.of(r)) for r in rows]
        return collected(arm, points, answers)


@lru_cache(maxsize=4)
def _prepared(arm: Manipulator, tip_tol: float) -> InverseSolver:
    return InverseSolver(arm, tip_tol=tip_tol)
