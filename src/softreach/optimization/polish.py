"""A design made better from where it stands: quadratic programs on exact derivatives (SLSQP)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from softreach.optimization.free_parameters import Values
from softreach.optimization.problem import Candidate, Problem
from softreach.optimization.program import DesignPoint, Part, Point, stacked, stacked_slopes
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, InvalidInput, no_warnings

_MOST_POSES = 60  # that move with the design
_ITERATIONS = 30
MOST_DESIGNS = 60
_HOPELESS = 0.5  # over L or relative: what a start may miss
_TOLERANCE = 0.003  # of the accuracy
_GENTLE = 0.1  # of the cost: the first step is along its slope, and as long
_BACK = (0.05, 0.1, 0.2, 0.4)  # of the way from an end that misses something to its start
_AMPLE = 24  # designs of which some are kept for that way back
_WORSE = 10.0  # times the cost of the start: a design that cannot exist


class Polished(NamedTuple):
    """The end of a polish."""

    candidate: Candidate
    """The better of both ends, judged as its start was."""
    designs: int
    """Designs that were looked at; none for a start that is too far from what is required."""


def can_polish(problem: Problem) -> bool:
    """True of problems with numbers that can change a little, and goals with derivatives."""
    needs = problem.requirements
    regions = any(target.region is not None for target in needs.targets)
    of_poses = needs.keeps or needs.limits.of_poses
    return (
        not (regions and of_poses)  # what is covered depends on poses at countless places
        and len(problem.parameters.real) > 0
        and len(needs.places) * max(1, len(needs.payloads)) <= _MOST_POSES
        and all(goal.objective.smooth for goal in problem.goals)
    )


@no_warnings()
def polished(
    problem: Problem,
    start: Candidate,
    *,
    accuracy: float | None = None,
    goal: int = 0,
    floors: Sequence[float] = (),
    designs: int = MOST_DESIGNS,
) -> Polished:
    """The local optimum of one goal next to a design; poses at the targets move along with it.

    Args:
        problem: The problem.
        start: The design to begin with.
        accuracy: Relative error of volumes, instead of that of coarse sets.
        goal: Number of the goal that is optimized.
        floors: Costs of all goals that are not to be exceeded, but for that one.
        designs: Most designs that are made.
    """
    if start.excess > _HOPELESS:
        return Polished(start, 0)
    allowed, most = designs, designs - len(_BACK) * (start.is_feasible and designs >= _AMPLE)
    program = _Program(problem, start, accuracy or problem.coarse, goal, floors, most)
    try:
        first = program.begin()
        end = _solved(program, first)
        candidate = problem.judged(program.values_of(end), program.point(end).design.case)
        designs = program.designs
        if start.is_feasible and not candidate.is_feasible:
            # A program that was cut, or stalled, ends a little outside of what is required.
            low, high = (problem.parameters.reals(each.values) for each in (candidate, start))
            for back in _BACK[: max(allowed - designs, 0)]:
                values = problem.parameters.moved(start.values, low + back * (high - low))
                again = problem.judged(values, problem.case(values, accuracy or problem.coarse))
                designs += 1
                if again.is_feasible:
                    candidate = again
                    break
    except (InvalidDesign, InvalidInput):
        return Polished(start, max(1, program.designs))
    better = min((start, candidate), key=problem.score) if len(problem.goals) < 2 else candidate
    return Polished(better, designs)


@no_warnings()
def point_of(problem: Problem, candidate: Candidate, accuracy: float, goal: int = 0) -> Point:
    """The program of one goal at a design, with the poses that it has at the targets.

    Raises:
        InvalidDesign: It is no design.
    """
    program = _Program(problem, candidate, accuracy, goal, ())
    return program.point(program.begin())


def _solved(program: _Program, first: Array) -> Array:
    from scipy.optimize import minimize

    point = program.point(first)
    constraints = []
    for kind, parts in (("eq", point.equations), ("ineq", point.inequalities)):
        if parts:
            fun, jac = program.asked(kind, stacked), program.asked(kind, stacked_slopes)
            constraints.append({"type": kind, "fun": fun, "jac": jac})
    try:
        end = minimize(
            program.cost,
            first,
            jac=program.cost_slope,
            bounds=[(0.0, 1.0)] * len(first),
            constraints=constraints,
            method="SLSQP",
            options={"maxiter": _ITERATIONS, "ftol": program.tolerance},
        ).x
    except _Spent:
        end, program.accepted = program.accepted, np.empty(0)
    return np.clip(end, 0.0, 1.0) if np.isfinite(end).all() else first


class _Spent(Exception):
    """A polish has looked at as many designs as it may."""


class _Program:
    """The program of one start: unknowns are the real parameters and the poses, from 0 to 1."""

    def __init__(
        self,
        problem: Problem,
        start: Candidate,
        accuracy: float,
        goal: int,
        floors: Sequence[float],
        most: int = MOST_DESIGNS,
    ) -> None:
        self.designs, self._most = 0, most
        """Designs made so far."""
        self.accepted = np.empty(0)
        """Unknowns at which the last quadratic program was set up."""
        self._problem, self._start, self._accuracy = problem, start, accuracy
        self._goal, self._floors = goal, floors
        self._shape, self._scale = (0, 0), 1.0
        self._points: dict[bytes, Point] = {}
        self._like: Sequence[TipMap] = ()

    def begin(self) -> Array:
        """Unknowns of the start.

        Raises:
            InvalidDesign: It is no design.
        """
        problem = self._problem
        low, high = problem.parameters.bounds.T
        reals = (problem.parameters.reals(self._start.values) - low) / (high - low)
        poses = np.empty((0, 0))
        if len(problem.requirements.places):
            case = problem.case(self._start.values, self._accuracy)
            box = as_tip_map(case.arm).box
            gamma = np.nan_to_num(case.check.poses.reshape(-1, box.bundles))
            poses = np.clip(box.to_cube(box.clip(gamma))[:, box.free], 0.0, 1.0)
        self._shape = poses.shape
        first = np.concatenate([np.clip(reals, 0.0, 1.0), poses.ravel()])
        if len(poses):
            self._like = self.point(first).design.rods
        self._scale = (abs(self.point(first).cost) or 1.0) / _GENTLE
        return first

    @property
    def tolerance(self) -> float:
        """Change of the cost, over that of the start, at which the program ends."""
        return _TOLERANCE * self._accuracy * _GENTLE

    def values_of(self, unknowns: Array) -> Values:
        parameters = self._problem.parameters
        low, high = parameters.bounds.T
        reals = low + unknowns[: len(low)] * (high - low)
        return parameters.moved(self._start.values, np.clip(reals, low, high))

    def point(self, unknowns: Array) -> Point:
        """The program at some unknowns; designs that differ in their poses alone are made once."""
        key = unknowns.tobytes()
        if key not in self._points:
            count = len(self._problem.parameters.real)
            reals, poses = unknowns[:count].copy(), unknowns[count:].reshape(self._shape).copy()
            alike = (p.design for p in self._points.values() if (p.reals == reals).all())
            design = next(alike, None)
            if design is None:
                # one is left for the design that it ends with
                if self.designs >= self._most - 1 and len(self.accepted):
                    raise _Spent
                self.designs += 1
                values = self.values_of(unknowns)
                design = DesignPoint(self._problem, values, self._accuracy, self._like)
            if len(self._points) > 3:
                self._points.pop(next(iter(self._points)))
            self._points[key] = Point(design, reals, poses, self._goal, self._floors)
        return self._points[key]

    def cost(self, unknowns: Array) -> float:
        """Cost over that of the start; that of a design that cannot exist is large."""
        try:
            cost = self.point(unknowns).cost / self._scale
        except (InvalidDesign, InvalidInput):
            return _WORSE
        return cost if math.isfinite(cost) else _WORSE

    def cost_slope(self, unknowns: Array) -> Array:
        self.accepted = unknowns.copy()
        try:
            return np.nan_to_num(self.point(unknowns).cost_slope / self._scale)
        except (InvalidDesign, InvalidInput):
            return np.zeros(len(unknowns))

    def asked(self, kind: str, what: Callable[[Sequence[Part]], Array]) -> Callable[[Array], Array]:
        """Values or derivatives of equations ("eq") or inequalities ("ineq") by the unknowns."""

        def values(unknowns: Array) -> Array:
            point = self.point(unknowns)
            return what(point.equations if kind == "eq" else point.inequalities)

        return values
