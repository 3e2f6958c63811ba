"""A design made better from where it stands: quadratic programs on exact derivatives (SLSQP)."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from softreach.optimization.free_parameters import Values
from softreach.optimization.problem import Candidate, Problem
from softreach.optimization.program import DesignPoint, Part, Point, stacked, stacked_slopes
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, InvalidInput, no_warnings

Floors = Sequence[float]

_MOST_POSES = 60  # that move with the design
_ITERATIONS = 30
MOST_DESIGNS = 60
_HOPELESS = 0.5  # over L or relative: what a start may miss
_TOLERANCE = 0.003  # of the accuracy
_GENTLE = 0.1  # of the cost: the first step is along its slope, and as long
_BACK = (0.05, 0.1, 0.2, 0.4)  # of the way from an end that misses something to its start
_AMPLE = 24  # designs of which some are kept for that way back
_WORSE = 10.0  # times the cost of the start: a design that cannot exist


def can_polish(problem: Problem) -> bool:
    """True of problems with numbers that can change a little, and goals with derivatives."""
    needs = problem.requirements
    of_poses = needs.keeps or needs.limits.of_poses
    covered = needs.regions and of_poses  # which depends on poses at countless places
    few = len(needs.places) * max(1, len(needs.payloads)) <= _MOST_POSES
    smooth = all(goal.objective.smooth for goal in problem.goals) and not needs.goals.directed.any()
    return not covered and few and smooth and len(problem.parameters.real) > 0


@parallel.undivided()
@no_warnings()
def polished(
    problem: Problem, start: Candidate, most: int, turn: tuple[int, Floors], accuracy: float
) -> Candidate:
    """The local optimum of one goal next to a design; poses at the targets move along with it.

    In `turn` is a goal, by its number, and the largest costs of the others; `accuracy` is the
    relative error of volumes. Returned is the better of both ends, with the number of designs that
    were made: none for a start that is too far from what is required.
    """
    if start.excess > _HOPELESS:
        return replace(start, designs=0)
    kept = len(_BACK) * (start.is_feasible and most >= _AMPLE)
    program = _Program(problem, start, accuracy, *turn, most - kept)
    try:
        end = program.optimum()
        candidate = problem.judged(program.values_of(end), program.point(end).design.case)
        spent = program.designs
        if start.is_feasible and not candidate.is_feasible:
            # A program that was cut, or stalled, ends a little outside of what is required.
            low, high = (problem.parameters.reals(each.values) for each in (candidate, start))
            for back in _BACK[: max(most - spent, 0)]:
                values = problem.parameters.moved(start.values, low + back * (high - low))
                again = problem.judged(values, problem.case(values, accuracy))
                spent += 1
                if again.is_feasible:
                    candidate = again
                    break
    except (InvalidDesign, InvalidInput):
        return replace(start, designs=max(1, program.designs))
    better = min((start, candidate), key=problem.score) if len(problem.goals) < 2 else candidate
    return replace(better, designs=spent)


@no_warnings()
def point_of(problem: Problem, candidate: Candidate, accuracy: float, goal: int = 0) -> Point:
    """The program of one goal at a design, with the poses that it has at the targets."""
    program = _Program(problem, candidate, accuracy, goal)
    return program.point(program.begin())


class _Spent(Exception):
    """A polish has looked at as many designs as it may."""


@dataclass(eq=False)
class _Program:
    """The program of one start: unknowns are the real parameters and the poses, from 0 to 1."""

    problem: Problem
    start: Candidate
    accuracy: float
    goal: int
    floors: Floors = ()
    most: int = MOST_DESIGNS
    designs: int = 0  # Designs made so far
    accepted: Array = field(default_factory=lambda: np.empty(0))
    """Unknowns at which the last quadratic program was set up."""
    _shape: tuple[int, ...] = (0, 0)  # of the poses
    _scale: float = 1.0
    _points: dict[bytes, Point] = field(default_factory=dict)
    _like: Sequence[TipMap] = ()

    def begin(self) -> Array:
        parameters = self.problem.parameters
        low, high = parameters.bounds.T
        reals = (parameters.reals(self.start.values) - low) / (high - low)
        poses = np.empty((0, 0))
        if len(self.problem.requirements.places):
            case = self.problem.case(self.start.values, self.accuracy)
            box = as_tip_map(case.arm).box
            gamma = np.nan_to_num(case.check.poses.reshape(-1, box.bundles))
            poses = np.clip(box.to_cube(box.clip(gamma))[:, box.free], 0.0, 1.0)
        self._shape = poses.shape
        first = np.concatenate([np.clip(reals, 0.0, 1.0), poses.ravel()])
        if len(poses):
            self._like = self.point(first).design.rods
        self._scale = (abs(self.point(first).cost) or 1.0) / _GENTLE
        return first

    def optimum(self) -> Array:
        """Unknowns at which the program ends, or at which it was cut."""
        from scipy.optimize import minimize

        first, constraints = self.begin(), []
        for kind, parts in (("eq", "equations"), ("ineq", "inequalities")):
            if getattr(self.point(first), parts):
                fun, jac = (partial(self._asked, parts, of) for of in (stacked, stacked_slopes))
                constraints.append({"type": kind, "fun": fun, "jac": jac})
        # A cost that changes by less, over that of the start, is that of the end.
        options = {"maxiter": _ITERATIONS, "ftol": _TOLERANCE * self.accuracy * _GENTLE}
        ends: Any = {"bounds": [(0.0, 1.0)] * len(first), "constraints": constraints}
        slsqp = partial(minimize, method="SLSQP", options=options, **ends)
        try:
            end = slsqp(self._cost, first, jac=self._cost_slope).x
        except _Spent:
            end, self.accepted = self.accepted, np.empty(0)
        return np.clip(end, 0.0, 1.0) if np.isfinite(end).all() else first

    def values_of(self, unknowns: Array) -> Values:
        parameters = self.problem.parameters
        low, high = parameters.bounds.T
        reals = low + unknowns[: len(low)] * (high - low)
        return parameters.moved(self.start.values, np.clip(reals, low, high))

    def point(self, unknowns: Array) -> Point:
        """The program at some unknowns; designs that differ in their poses alone are made once."""
        key = unknowns.tobytes()
        if key not in self._points:
            count = len(self.problem.parameters.real)
            reals, poses = unknowns[:count].copy(), unknowns[count:].reshape(self._shape).copy()
            alike = (p.design for p in self._points.values() if (p.reals == reals).all())
            design = next(alike, None)
            if design is None:
                # one is left for the design that it ends with
                if self.designs >= self.most - 1 and len(self.accepted):
                    raise _Spent
                self.designs += 1
                values = self.values_of(unknowns)
                design = DesignPoint(self.problem, values, self.accuracy, self._like)
            if len(self._points) > 3:
                self._points.pop(next(iter(self._points)))
            self._points[key] = Point(design, reals, poses, self.goal, self.floors)
        return self._points[key]

    def _cost(self, unknowns: Array) -> float:
        """Cost over that of the start; that of a design that cannot exist is large."""
        cost = math.nan
        with suppress(InvalidDesign, InvalidInput):
            cost = self.point(unknowns).cost / self._scale
        return cost if math.isfinite(cost) else _WORSE

    def _cost_slope(self, unknowns: Array) -> Array:
        self.accepted = unknowns.copy()
        with suppress(InvalidDesign, InvalidInput):
            return np.nan_to_num(self.point(unknowns).cost_slope / self._scale)
        return np.zeros(len(unknowns))

    def _asked(self, parts: str, of: Callable[[Sequence[Part]], Array], unknowns: Array) -> Array:
        return of(getattr(self.point(unknowns), parts))
