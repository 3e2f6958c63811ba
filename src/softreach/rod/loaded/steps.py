"""Steps of a loaded rod, theory (72).

The pilot of the free rod is solved with n and with 2n steps; n is the smallest number, no smaller
than the phase of the loads needs, whose largest difference, doubled for safety, is within `tol`.
Few of the pilot are solved first, all of them once these agree.

Near the loss of stability every error is magnified. Activations there are left out: those of small
margin, and the few that differ more than tenfold what 99 % of all do.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from softreach.arm.body import load_number
from softreach.arm.manipulator import Manipulator
from softreach.rod.loaded.phase import LoadPhase
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.shooting import Equilibria
from softreach.rod.loaded.solver import Solver
from softreach.rod.steps import enough_for_all_breaks
from softreach.rod.tip_map import has_tip
from softreach.support.errors import InvalidInput

__all__ = [
    "UNJUDGED",
    "Differences",
    "check_steps",
    "checked",
    "fewest_steps",
    "shape_differences",
    "tip_differences",
]

Array = NDArray[np.float64]
Differences = Callable[[Solver, Array, Equilibria], Array]
"""Distances [m] between what a solver and its judge find, near known equilibria."""

_SAFETY = 2.0
_FEWEST_STEPS, _MOST_STEPS = 4, 256
_FINER = 8  # times as many as let one end at every breakpoint are tried
UNJUDGED = 0
"""Instead of a number of steps: no activation can judge any."""
_CRITICAL = 0.02
_BULK, _OUTLYING = 0.99, 10.0
_FEW = 64
_STATIONS = 9


def fewest_steps(
    solver_of: Callable[[int], Solver], pilot: Array, steps: int, differences: Differences
) -> int | None:
    """The fewest steps for the tolerance of the solvers.

    Args:
        solver_of: A solver of so many steps.
        pilot: Activations to judge by, shape (n, bundles).
        steps: The fewest to try.
        differences: Differences that must be within the tolerance.

    Returns:
        Steps; None where even the most are too few, `UNJUDGED` where nothing can be judged.
    """
    steps = max(steps, _FEWEST_STEPS)
    others = pilot[_FEW:]  # behind the first, which are corners
    few = np.concatenate([pilot[:_FEW], others[:: max(1, len(others) // _FEW)]])
    enough = _enough(solver_of, few, steps, differences)
    if enough is None:
        return None
    return _enough(solver_of, pilot, enough or steps, differences)


def _enough(
    solver_of: Callable[[int], Solver], gamma: Array, steps: int, differences: Differences
) -> int | None:
    tol, at_all = solver_of(steps).tol, enough_for_all_breaks(solver_of(steps).tables.arm)
    known: Equilibria | None = None
    while steps <= max(_MOST_STEPS, _FINER * at_all):
        solver = solver_of(steps)
        allowed = tol * solver.tables.arm.length / _SAFETY
        if known is None:
            known = Postures.of(solver).find(gamma)
            held = has_tip(known.status)
            gamma, known = gamma[held], known.of(held)
        equilibria = solver.near(gamma, known)
        settled = has_tip(equilibria.status) & (np.abs(equilibria.margin) > _CRITICAL)
        errors = _bulk(differences(solver, gamma[settled], equilibria.of(settled)))
        if not len(errors):
            return UNJUDGED
        error = float(errors.max())
        if error <= allowed:
            return steps
        steps = max(steps + 1, int(0.97 * steps * (error / allowed) ** (1 / 8)))
        if steps > _MOST_STEPS:
            steps = max(steps, at_all)
    return None


def _bulk(distances: Array) -> Array:
    """Without those that are far larger than nearly all."""
    known = distances[np.isfinite(distances)]
    if not len(known):
        return known
    return known[known <= _OUTLYING * np.quantile(known, _BULK, method="lower")]


def tip_differences(solver: Solver, gamma: Array, known: Equilibria) -> Array:
    """Between tips."""
    return _distances(known.tips, solver.judge().near(gamma, known).tips)


def shape_differences(solver: Solver, gamma: Array, known: Equilibria) -> Array:
    """Between centerlines, along the arm."""
    stations = np.linspace(0.0, solver.tables.arm.length, _STATIONS)
    shapes = [each.shapes(gamma, stations, known) for each in (solver, solver.judge())]
    return _distances(*(shape.frames.position for shape in shapes)).max(axis=1, initial=0.0)


def _distances(a: Array, b: Array) -> Array:
    return np.linalg.norm(a - b, axis=-1)


def check_steps(arm: Manipulator, phase: LoadPhase) -> None:
    """Refuse loads that turn tangents more often than any number of steps can tell.

    Raises:
        InvalidInput: Too heavy loads.
    """
    if phase.fewest_steps > _MOST_STEPS:
        load, most = f"of load number {load_number(arm):.3g}", f"at most {_MOST_STEPS} allowed"
        allowed = f"lighter: they need {phase.fewest_steps:,} steps, {most}"
        raise InvalidInput("loads", load, allowed, "lighten the load or stiffen the arm")


def checked(steps: int | None, tol: float) -> int:
    """The steps that a tolerance needs.

    Raises:
        InvalidInput: None are enough.
    """
    if steps is None:
        raise InvalidInput("tol", tol, f"reachable within {_MOST_STEPS} steps", "enlarge it")
    return steps
