"""Targets out of reach whose twins are not: the same place from a base that points another way."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from softreach.arm.base import POINTS
from softreach.arm.manipulator import Manipulator
from softreach.inverse.request import as_targets
from softreach.inverse.solutions import Status
from softreach.inverse.solve import solve_inverse
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array

__all__ = ["twin_hints"]


def twin_hints(
    arm: Manipulator | TipMap, targets: ArrayLike, *, tol: float = 1e-6
) -> tuple[str, ...]:
    """Hints at what targets out of reach may mean: another base, or a z axis that points down.

    A hint for the place that the arm would reach if its base pointed another way; its loads turn
    with it here, so that a loaded arm may reach it not quite.

    Args:
        arm: The design, or its tip map.
        targets: Places that it does not reach [m], shape (t, 3).
        tol: Largest tip error, in L.

    Returns:
        One line for each target; "" where no twin of it is reached either.

    Raises:
        InvalidInput: Targets of another shape or not finite.
    """
    rod, places = tip_map(arm, tol), as_targets("targets", targets)
    twins = _twins(rod, places)
    solutions = solve_inverse(rod, np.concatenate(list(twins.values())))
    reached = (solutions.statuses == Status.REACHED).reshape(len(twins), len(places))
    words = list(twins)
    return tuple(words[int(each.argmax())] if each.any() else "" for each in reached.T)


def _twins(rod: TipMap, places: Array) -> dict[str, Array]:
    """Hint -> the places that the arm, as it is, would have to reach instead."""
    base, pose = rod.arm.base, rod.pose
    twins = {
        _posture(name): pose.to_world(base.replace(points=name).to_base(places))
        for name in POINTS
        if name != base.points
    }
    mirrored = places * (1.0, 1.0, -1.0) + 2.0 * np.array(pose.position) * (0.0, 0.0, 1.0)
    return twins | {"it would be reached with the sign of z turned over: z points up": mirrored}


def _posture(name: str) -> str:
    word = {"down": "hanging", "up": "upright"}.get(name, name)
    return f"it would be reached if the base pointed {name}: --base {word}"
