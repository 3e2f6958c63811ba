"""Design and poses as one smooth program: values and derivatives at one place of the unknowns."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import find_parameters
from softreach.arm.parameters.changes import parameters_by_every_name
from softreach.arm.summary import load_number, mass
from softreach.optimization.free_parameters import Values
from softreach.optimization.objectives import DesignCase, Goal
from softreach.optimization.problem import Problem
from softreach.requirements.checks import effort_scales
from softreach.requirements.poses import PoseRules
from softreach.rod.rods import refined, tip_map
from softreach.rod.tip_map import TipMap
from softreach.rod.view import stable_tips
from softreach.support.arrays import Array
from softreach.workspace.gradient import VolumeGradient, volume_gradient
from softreach.workspace.tip_derivatives import TipDerivatives

__all__ = ["DesignPoint", "Point"]

SETS = {
    "exact_volume": "volume",
    "exact_convex_volume": "convex_volume",
    "exact_unreachability": "unreachability",
}
"""Goals and measures of the reachable set, and what they are called there."""
EFFORTS = ("mean_effort", "worst_effort")
_OF_ARM: dict[str, Callable[[Manipulator], float]] = {
    "mass": lambda arm: mass(arm) or 0.0,
    "load_number": lambda arm: load_number(arm) or 0.0,
}
_TOL = 1e-9  # of tips at the targets, in L
_STEP = 1e-4  # of a range, or of the unit cube, for what is differentiated by differences
_ROOM = 0.99  # of the distance within which a tip must come to a place
_SPARE = 1e-4  # over L or relative, by which limits are kept
_POWER = 40  # of the mean that stands for the largest effort
_NOWHERE = 10.0  # L: a tip without a stable equilibrium


@dataclass(eq=False)
class DesignPoint:
    """One design on the way of a polish; derivatives are by real parameters over their ranges."""

    problem: Problem
    values: Values
    accuracy: float

    @cached_property
    def case(self) -> DesignCase:
        """The design, to be asked."""
        return self.problem.case(self.values, self.accuracy)

    @cached_property
    def rods(self) -> tuple[TipMap, ...]:
        """Its tip map under each payload."""
        return tuple(refined(tip_map(arm), _TOL) for arm in _laden(self.problem, self.case.arm))

    @cached_property
    def derivatives(self) -> tuple[TipDerivatives, ...]:
        """∂r/∂p of each of these, by parameters of the arm."""
        known = [find_parameters(rod.arm, self._paths[0]) for rod in self.rods]
        return tuple(
            TipDerivatives(rod, [each[name] for name in self._paths[0]])
            for rod, each in zip(self.rods, known, strict=True)
        )

    @cached_property
    def chain(self) -> Array:
        """Change of parameters of the arm by unknowns: ranges and ties, shape (paths, reals)."""
        return self._paths[1]

    @cached_property
    def sets(self) -> VolumeGradient:
        """Derivatives of the reachable set."""
        return volume_gradient(self.case.arm, self._paths[0], accuracy=self.accuracy)

    def of_set(self, name: str) -> tuple[float, Array]:
        """A number of the reachable set and its derivatives by the reals."""
        value = float(getattr(self.case.reached, SETS[name]))
        return value, getattr(self.sets, SETS[name]) @ self.chain

    def of_arm(self, name: str) -> tuple[float, Array]:
        """A number that follows from the design alone, and its derivatives by differences."""
        of = _OF_ARM[name]
        slopes = [(of(ahead) - of(behind)) / step for step, ahead, behind in self.neighbors]
        return of(self.case.arm), np.array(slopes)

    @cached_property
    def neighbors(self) -> list[tuple[float, Manipulator, Manipulator]]:
        """Designs on both sides along each real parameter, and how far they are apart."""
        parameters, pairs = self.problem.parameters, []
        reals, (low, high) = parameters.reals(self.values), parameters.bounds.T
        for k in range(len(reals)):
            ends = np.clip(reals[k] + np.array([1, -1]) * _STEP * (high - low)[k], low[k], high[k])
            arms = []
            for end in ends:
                moved = reals.copy()
                moved[k] = end
                arms.append(parameters.arm(parameters.moved(self.values, moved)))
            pairs.append((float((ends[0] - ends[1]) / (high - low)[k]), *arms))
        return pairs

    @cached_property
    def _paths(self) -> tuple[tuple[str, ...], Array]:
        """Parameters of the arm that move, and the chain."""
        parameters = self.problem.parameters
        known = parameters_by_every_name(self.case.arm)
        widths = np.ptp(parameters.bounds, axis=1)
        names = [each.name for each in parameters.real]
        rows = {
            name: widths[k] * np.eye(len(names))[k] for k, name in enumerate(names) if name in known
        }
        for tie in parameters.ties:
            if tie.of in names and tie.name in known:
                k = names.index(tie.of)
                rows[tie.name] = tie.factor * widths[k] * np.eye(len(names))[k]
        return tuple(rows), np.array(list(rows.values())).reshape(-1, len(names))


def _laden(problem: Problem, arm: Manipulator) -> list[Manipulator]:
    """The arm under each payload of the requirements, or as it is."""
    loads = arm.loads
    if not problem.requirements.payloads or loads is None:
        return [arm]
    return [
        arm.replace(loads=loads.replace(payload=mass)) for mass in problem.requirements.payloads
    ]


@dataclass(eq=False)
class Point:
    """A design with its poses: cost, equations and rooms, each with all derivatives.

    Unknowns are the real parameters over their ranges, then the poses in the unit cube of the free
    inputs, one for each payload and place.
    """

    design: DesignPoint
    reals: Array
    poses: Array
    """Shape (payloads · places, free inputs)."""
    goal: int
    floors: Sequence[float]

    @cached_property
    def cost_value(self) -> float:
        """Cost of the goal alone, for which sets need not be differentiated."""
        goals = self.design.problem.goals
        if not goals or goals[self.goal].name not in SETS:
            return self.cost[0]
        goal = goals[self.goal]
        return -goal.sense * float(getattr(self.design.case.reached, SETS[goal.name]))

    @cached_property
    def cost(self) -> tuple[float, Array]:
        """Cost of the goal and its derivatives."""
        goals = self.design.problem.goals
        return self._cost_of(goals[self.goal]) if goals else (0.0, np.zeros(self._size))

    @cached_property
    def equations(self) -> tuple[Array, Array]:
        """Tips less the places that they must be at, over L."""
        parts = self._tips
        return _stacked([(gap, slope) for gap, slope, within in parts if within == 0.0], self._size)

    @cached_property
    def rooms(self) -> tuple[Array, Array]:
        """What must not fall below 0: limits, measures, regions, other goals."""
        parts = [*self._near_places(), *self._rules(), *self._of_design(), *self._other_goals()]
        return _stacked(parts, self._size)

    @property
    def _size(self) -> int:
        return len(self.reals) + self.poses.size

    def _cost_of(self, goal: Goal) -> tuple[float, Array]:
        slope = np.zeros(self._size)
        if goal.name in EFFORTS:
            value, slope = self._effort(goal.name)
        elif goal.name in SETS:
            value, slope[: len(self.reals)] = self.design.of_set(goal.name)
        else:
            value, slope[: len(self.reals)] = self.design.of_arm(goal.name)
        return -goal.sense * value, -goal.sense * slope

    def _effort(self, name: str) -> tuple[float, Array]:
        """Mean of |γ|, each over its largest bound; of a high power for the largest of them."""
        box, count = self.design.rods[0].box, len(self.poses)
        scales = effort_scales(self.design.case.arm)
        gamma = box.from_free_cube(self.poses) / scales
        each = np.linalg.norm(gamma, axis=1).clip(1e-12)
        power = 1 if name == "mean_effort" else _POWER
        mean = float((each**power).mean() ** (1.0 / power))
        weight = (each / mean) ** (power - 1) / count
        widths = (box.widths / scales)[box.free]
        slope = np.zeros(self._size)
        slope[len(self.reals) :] = (
            weight[:, None] * gamma[:, box.free] / each[:, None] * widths
        ).ravel()
        return mean, slope

    @cached_property
    def _tips(self) -> list[tuple[Array, Array, float]]:
        """Tip less place over L, its derivatives, and how near it must come, of each pose."""
        needs, result = self.design.problem.requirements, []
        places, within = needs.places, _within(needs.targets)
        if not len(places):
            return []
        poses = self.poses.reshape(len(self.design.rods), -1, self.poses.shape[-1])
        count, start = len(self.reals), len(self.reals)
        for rod, derivatives, cube in zip(
            self.design.rods, self.design.derivatives, poses, strict=True
        ):
            box, length = rod.box, rod.length
            tips, slopes = stable_tips(rod).tips_and_slopes(box.from_free_cube(cube))
            by_pose = slopes[:, :, box.free] * box.widths[box.free] / length
            by_real = derivatives.at(cube) @ self.design.chain / length
            gaps = np.nan_to_num((tips - places) / length, nan=_NOWHERE)
            for k in range(len(places)):
                slope = np.zeros((3, self._size))
                slope[:, :count] = np.nan_to_num(by_real[k])
                slope[:, start : start + cube.shape[1]] = np.nan_to_num(by_pose[k])
                start += cube.shape[1]
                result.append((gaps[k], slope, within[k] / length))
        return result

    def _near_places(self) -> list[tuple[Array, Array]]:
        """Places that need not be met exactly: how much nearer the tip is than it must be."""
        return [
            (np.array([(within**2 - gap @ gap) / within]), -2.0 / within * (gap @ slope)[None])
            for gap, slope, within in ((g, s, _ROOM * w) for g, s, w in self._tips)
            if within > 0.0
        ]

    def _rules(self) -> list[tuple[Array, Array]]:
        """Regions to keep to and limits of poses, by differences."""
        needs = self.design.problem.requirements
        keeps = [keep for keep in needs.keeps if keep.when == "targets"]
        if not len(self.poses):
            return []
        arms, parts = _laden(self.design.problem, self.design.case.arm), []
        poses = self.poses.reshape(len(arms), -1, self.poses.shape[-1])
        start = len(self.reals)
        for number, (arm, cube) in enumerate(zip(arms, poses, strict=True)):
            rules = PoseRules.of(arm, keeps, needs.limits, np.inf)
            if not len(rules):
                return []
            value = _room(rules, cube)
            slope = np.zeros((*value.shape, self._size))
            for k, (apart, *pair) in enumerate(self.design.neighbors):
                ahead, behind = (
                    _room(
                        PoseRules.of(
                            _laden(self.design.problem, a)[number], keeps, needs.limits, np.inf
                        ),
                        cube,
                    )
                    for a in pair
                )
                slope[:, :, k] = (ahead - behind) / apart
            for j in range(cube.shape[1]):
                ends = []
                for side in (1, -1):
                    moved = cube.copy()
                    moved[:, j] = np.clip(moved[:, j] + side * _STEP, 0.0, 1.0)
                    ends.append((moved[:, j], _room(rules, moved)))
                (high, ahead), (low, behind) = ends
                column = start + np.arange(len(cube)) * cube.shape[1] + j
                change = (ahead - behind) / (high - low)[:, None]
                slope[np.arange(len(cube)), :, column] = change
            start += cube.size
            parts.append((value.ravel(), slope.reshape(-1, self._size)))
        return parts

    def _of_design(self) -> list[tuple[Array, Array]]:
        """Limits and measures that follow from the design or its set."""
        needs, parts = self.design.problem.requirements, []
        for name, (low, high) in needs.measures.items():
            if name not in SETS:
                continue
            value, slope = self.design.of_set(name)
            parts += [self._room_below(value, slope, high), self._room_above(value, slope, low)]
        for name in _OF_ARM:
            most = needs.limits.given.get(name)
            if most is not None:
                parts.append(self._room_below(*self.design.of_arm(name), most))
        return [part for part in parts if part is not None]

    def _other_goals(self) -> list[tuple[Array, Array]]:
        """Goals that must not become worse than given."""
        parts = []
        for k, (goal, floor) in enumerate(
            zip(self.design.problem.goals, self.floors, strict=False)
        ):
            if k != self.goal:
                cost, slope = self._cost_of(goal)
                scale = abs(floor) or 1.0
                parts.append((np.array([(floor - cost) / scale]), -slope[None] / scale))
        return parts

    def _room_below(
        self, value: float, slope: Array, most: float | None
    ) -> tuple[Array, Array] | None:
        if most is None:
            return None
        scale, row = abs(most) or 1.0, np.zeros((1, self._size))
        row[0, : len(self.reals)] = -slope / scale
        return np.array([(most - value) / scale - _SPARE]), row

    def _room_above(
        self, value: float, slope: Array, least: float | None
    ) -> tuple[Array, Array] | None:
        return None if least is None else self._room_below(-value, -slope, -least)


def _room(rules: PoseRules, cube: Array) -> Array:
    """How far poses are from what the rules forbid, over L or over the limit, shape (n, rule)."""
    value = rules.judged(rules.rod.box.from_free_cube(cube)).value
    most = np.array([0.0] * len(rules.keeps) + [*rules.limits.values()])
    scale = np.array(
        [rules.arm.length] * len(rules.keeps) + [x or 1.0 for x in most[len(rules.keeps) :]]
    )
    return np.nan_to_num((most - value) / scale - _SPARE, nan=-1.0, neginf=-1.0, posinf=1.0)


def _within(targets: Sequence[object]) -> Array:
    """How near the tip must come to each place [m]."""
    each = [
        np.full(len(target.places), target.within)  # pyright: ignore
        for target in targets
        if target.places is not None  # pyright: ignore
    ]
    return np.concatenate([np.empty(0), *each])


def _stacked(parts: Sequence[tuple[Array, Array]], size: int) -> tuple[Array, Array]:
    values = [value for value, _ in parts]
    slopes = [slope for _, slope in parts]
    return np.concatenate([np.empty(0), *values]), np.concatenate([np.empty((0, size)), *slopes])
