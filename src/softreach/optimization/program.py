"""Design and poses as one smooth program: values and derivatives at one place of the unknowns."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import find_parameters
from softreach.arm.parameters.changes import parameters_by_every_name
from softreach.arm.summary import load_number, mass
from softreach.optimization.free_parameters import Values
from softreach.optimization.objectives import SETS, DesignCase, Goal
from softreach.optimization.problem import Problem
from softreach.optimization.robust import margin
from softreach.requirements.checks import effort_scales
from softreach.requirements.poses import PoseRules
from softreach.requirements.regions import Region
from softreach.rod.rods import in_steps, refined, tip_map
from softreach.rod.tip_map import TipMap
from softreach.rod.view import stable_tips
from softreach.support.arrays import Array
from softreach.support.lazy import lazy
from softreach.workspace import ReachableSet, ReachableSolid, reachable_set
from softreach.workspace.boundary_samples import boundary_samples
from softreach.workspace.gradient import VolumeGradient, volume_gradient
from softreach.workspace.tip_derivatives import TipDerivatives

__all__ = ["DesignPoint", "Point"]

COVERAGE = "coverage"
EFFORTS = ("mean_effort", "worst_effort")
_OF_ARM: dict[str, Callable[[Manipulator], float]] = {
    "mass": lambda arm: mass(arm) or 0.0,
    "load_number": lambda arm: load_number(arm) or 0.0,
    "actuators": lambda arm: float(arm.inputs),
}
_TOL = 1e-7  # of tips at the targets, in L
_STEP = 1e-4  # of a range, or of the unit cube, for what is differentiated by differences
_FAR = 0.1  # over L or relative: room beyond which a rule is not differentiated
_ROOM = 0.98  # of the distance within which a tip must come to a place
_SPARE = 1e-4  # over L or relative, by which limits are kept
_WIDE_STEP = 0.02  # of a range, for what is rough
_TOUCHES = 1e-12
_PLACES = 8192  # of a region, whose share is covered
_POWER = 40  # of the mean that stands for the largest effort
_NOWHERE = 10.0  # L: a tip without a stable equilibrium


@dataclass(eq=False)
class DesignPoint:
    """One design on the way of a polish; derivatives are by real parameters over their ranges."""

    problem: Problem
    values: Values
    accuracy: float
    like: Sequence[TipMap] = ()
    """Tip maps of a design nearby, in as many steps."""

    @lazy
    def case(self) -> DesignCase:
        """The design, to be asked."""
        return self.problem.case(self.values, self.accuracy)

    @lazy
    def rods(self) -> tuple[TipMap, ...]:
        """Its tip map under each payload."""
        arms = _laden(self.problem, self.case.arm)
        if not self.like:
            return tuple(refined(tip_map(arm), _TOL) for arm in arms)
        pairs = zip(arms, self.like, strict=True)
        return tuple(in_steps(arm, rod.steps, rod) for arm, rod in pairs)

    @lazy
    def derivatives(self) -> tuple[TipDerivatives, ...]:
        """∂r/∂p of each of these, by parameters of the arm."""
        known = [find_parameters(rod.arm, self._paths[0]) for rod in self.rods]
        return tuple(
            TipDerivatives(rod, [each[name] for name in self._paths[0]])
            for rod, each in zip(self.rods, known, strict=True)
        )

    @lazy
    def chain(self) -> Array:
        """Change of parameters of the arm by unknowns: ranges and ties, shape (paths, reals)."""
        return self._paths[1]

    @lazy
    def sets(self) -> VolumeGradient:
        """Derivatives of the reachable set."""
        return volume_gradient(self.case.arm, self._paths[0], accuracy=self.accuracy)

    def of_set(self, name: str) -> tuple[float, Array]:
        """A number of the reachable set and its derivatives by the reals."""
        value = float(getattr(self.case.reached, SETS[name]))
        return value, getattr(self.sets, SETS[name]) @ self.chain

    def of_coverage(self) -> tuple[float, Array]:
        """Mean share of the regions that the tip reaches, and its derivatives by the reals."""
        pairs = [
            (number, target.region)
            for number in range(len(self.rods))
            for target in self.problem.requirements.targets
            if target.region is not None
        ]
        shares, slopes = zip(*(self.share(*pair) for pair in pairs), strict=True)
        return float(np.mean(shares)), np.mean(slopes, axis=0)

    def share(self, number: int, region: Region) -> tuple[float, Array]:
        """Share of a region that the tip reaches under a payload, and its derivatives.

        They are what the part of the boundary that is in the region sweeps, theory (98).
        """
        solid = self._solids[number]
        if not isinstance(solid, ReachableSolid):
            return 0.0, np.zeros(self.chain.shape[1])
        nodes = boundary_samples(solid.image)
        inside = (region.distance(nodes.places) <= 0.0).astype(float)
        swept = nodes.derivative(self.derivatives[number].at(nodes.cube), inside)
        share = float(solid.contains(region.places(_PLACES)).mean())
        return share, swept @ self.chain / region.volume

    @lazy
    def _solids(self) -> tuple[ReachableSet, ...]:
        """Reachable sets under each payload."""
        if len(self.rods) == 1:
            return (self.case.reached,)
        return tuple(reachable_set(rod.arm, accuracy=self.accuracy) for rod in self.rods)

    def of_arm(self, name: str) -> tuple[float, Array]:
        """A number that follows from the design alone, and its derivatives by differences."""
        of = _OF_ARM[name]
        slopes = [(of(ahead) - of(behind)) / step for step, ahead, behind in self.neighbors]
        return of(self.case.arm), np.array(slopes)

    def margin(self, goal: Goal) -> float:
        """Distance of a robust goal from that of the design itself."""
        if goal.name not in self._margins:
            self._margins[goal.name] = goal.sense * margin(goal, self.case)
        return self._margins[goal.name]

    def margin_slope(self, goal: Goal) -> Array:
        """Its derivatives by the reals: differences to one side."""
        parameters = self.problem.parameters
        reals, (low, high) = parameters.reals(self.values), parameters.bounds.T
        slopes = []
        for k, step in enumerate(_WIDE_STEP * (high - low)):
            moved = reals.copy()
            moved[k] += step if reals[k] + step <= high[k] else -step
            case = self.problem.case(parameters.moved(self.values, moved), self.accuracy)
            change = goal.sense * margin(goal, case) - self.margin(goal)
            slopes.append(change / (moved[k] - reals[k]) * (high - low)[k])
        return np.array(slopes)

    @lazy
    def _margins(self) -> dict[str, float]:
        return {}

    @lazy
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

    @lazy
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

    @lazy
    def cost_value(self) -> float:
        """Cost of the goal alone, for which sets need not be differentiated."""
        goals = self.design.problem.goals
        if not goals or goals[self.goal].name not in SETS:
            return self.cost[0]
        goal = goals[self.goal]
        cost = -goal.sense * float(getattr(self.design.case.reached, SETS[goal.name]))
        return cost + self.design.margin(goal) if goal.objective.sigmas else cost

    @lazy
    def cost(self) -> tuple[float, Array]:
        """Cost of the goal and its derivatives."""
        goals = self.design.problem.goals
        return self._cost_of(goals[self.goal]) if goals else (0.0, np.zeros(self._size))

    @lazy
    def equations(self) -> tuple[Part, ...]:
        """Tips less the places that they must be at, over L."""
        return tuple(part for part in self._tips if part.within == 0.0)

    @lazy
    def rooms(self) -> tuple[Part, ...]:
        """What must not fall below 0: limits, measures, regions, other goals."""
        near = (_near_place(part) for part in self._tips if part.within > 0.0)
        return (*near, *self._rules(), *self._shares(), *self._of_design(), *self._other_goals())

    @property
    def _size(self) -> int:
        return len(self.reals) + self.poses.size

    def _cost_of(self, goal: Goal) -> tuple[float, Array]:
        slope = np.zeros(self._size)
        if goal.name in EFFORTS:
            value, slope = self._effort(goal.name)
        elif goal.name == COVERAGE:
            value, slope[: len(self.reals)] = self.design.of_coverage()
        elif goal.name in SETS:
            value, slope[: len(self.reals)] = self.design.of_set(goal.name)
        else:
            value, slope[: len(self.reals)] = self.design.of_arm(goal.name)
        cost, slope = -goal.sense * value, -goal.sense * slope
        if goal.objective.sigmas:
            cost += self.design.margin(goal)
            slope[: len(self.reals)] += self.design.margin_slope(goal)
        return cost, slope

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

    @lazy
    def _tips(self) -> list[Part]:
        """Tip less place over L of each pose."""
        needs, parts = self.design.problem.requirements, []
        within = _within(needs.targets)
        for number, (rod, cube) in enumerate(self._by_payload()):
            tips = stable_tips(rod).tips(rod.box.from_free_cube(cube))
            gaps = np.nan_to_num((tips - needs.places) / rod.length, nan=_NOWHERE)
            slopes = lazily(partial(self._tip_slopes, number))
            for k, gap in enumerate(gaps):
                slope = partial(_row, slopes, k)
                near = within[k] / rod.length
                parts.append(Part(f"place {k + 1}", gap, slope, near, rod.length, "m"))
        return parts

    def _tip_slopes(self, number: int) -> Array:
        """Derivatives of tips over L under one payload, shape (place, 3, unknowns)."""
        rod, cube = self._by_payload()[number]
        box, count = rod.box, len(self.reals)
        _, slopes = stable_tips(rod).tips_and_slopes(box.from_free_cube(cube))
        result = np.zeros((len(cube), 3, self._size))
        result[:, :, :count] = self.design.derivatives[number].at(cube) @ self.design.chain
        for j, column in enumerate(self._columns(number)):
            result[np.arange(len(cube)), :, column] = (
                slopes[:, :, box.free[j]] * box.widths[box.free[j]]
            )
        return np.nan_to_num(result / rod.length)

    def _by_payload(self) -> list[tuple[TipMap, Array]]:
        """Tip map and poses under each payload."""
        if not len(self.poses):
            return []
        rods = self.design.rods
        return list(zip(rods, self.poses.reshape(len(rods), -1, self.poses.shape[1]), strict=True))

    def _columns(self, number: int) -> Array:
        """Columns of the unknowns of poses under one payload, shape (free inputs, place)."""
        rods, free = len(self.design.rods), self.poses.shape[1]
        places = len(self.poses) // rods
        first = len(self.reals) + number * places * free
        return first + np.arange(places * free).reshape(places, free).T

    def _rules(self) -> Iterator[Part]:
        """Regions to keep to and limits of poses."""
        needs = self.design.problem.requirements
        keeps = [keep for keep in needs.keeps if keep.when == "targets"]

        def rules_of(arm: Manipulator, number: int) -> PoseRules:
            laden = _laden(self.design.problem, arm)[number]
            like = self.design.rods[number]
            rod = like if arm is self.design.case.arm else in_steps(laden, like.steps, like)
            return PoseRules.of(laden, keeps, needs.limits, np.inf, rod)

        for number, (_, cube) in enumerate(self._by_payload()):
            rules = rules_of(self.design.case.arm, number)
            if not len(rules):
                return
            value = _room(rules, cube)
            slopes = lazily(partial(self._rule_slopes, rules_of, number, value))
            scales = [(keep.name, rules.arm.length, "m") for keep in keeps]
            scales += [(name, most or 1.0, "") for name, most in rules.limits.items()]
            for column, (name, scale, unit) in enumerate(scales):
                slope = partial(_column, slopes, column)
                yield Part(name, value[:, column], slope, scale=scale, unit=unit)

    def _rule_slopes(
        self, rules_of: Callable[[Manipulator, int], PoseRules], number: int, value: Array
    ) -> Array:
        """Derivatives of rules by differences, shape (place, rule, unknowns); 0 far from them."""
        slope = np.zeros((*value.shape, self._size))
        near = np.flatnonzero(((value < _FAR) & (value != 0.0)).any(axis=0))
        if not len(near):
            return slope
        rules, cube = rules_of(self.design.case.arm, number), self._by_payload()[number][1]
        for k, (apart, *pair) in enumerate(self.design.neighbors):
            ahead, behind = (_room(rules_of(arm, number).some(near), cube) for arm in pair)
            slope[:, near, k] = (ahead - behind) / apart
        for j, column in enumerate(self._columns(number)):
            ends = np.repeat(cube[None], 2, axis=0)
            ends[:, :, j] = np.clip(cube[:, j] + np.array([[_STEP], [-_STEP]]), 0.0, 1.0)
            ahead, behind = (_room(rules.some(near), end) for end in ends)
            apart = (ends[0, :, j] - ends[1, :, j])[:, None]
            for place, at in enumerate(column):
                slope[place, near, at] = ((ahead - behind) / apart)[place]
        return slope

    def _shares(self) -> Iterator[Part]:
        """Shares of regions that must be covered."""
        for target in self.design.problem.requirements.targets:
            if (region := target.region) is None:
                continue
            for number in range(len(self.design.rods)):
                share = partial(self.design.share, number, region)
                yield self._limit(target.name, -1.0, share()[0], target.share, share)

    def _of_design(self) -> Iterator[Part]:
        """Limits and measures that follow from the design or its set."""
        needs = self.design.problem.requirements
        for name, (low, high) in needs.measures.items():
            if name in SETS:
                value = float(getattr(self.design.case.reached, SETS[name]))
                slope = partial(self.design.of_set, name)
                for sense, limit in ((1.0, high), (-1.0, low)):
                    if limit is not None:
                        yield self._limit(name, sense, value, limit, slope)
        for name in _OF_ARM:
            most = needs.limits.given.get(name)
            if most is not None:
                value = _OF_ARM[name](self.design.case.arm)
                yield self._limit(name, 1.0, value, most, partial(self.design.of_arm, name))

    def _limit(
        self,
        name: str,
        sense: float,
        value: float,
        limit: float,
        derived: Callable[[], tuple[float, Array]],
    ) -> Part:
        """Room below a limit (sense 1) or above it (-1), relative."""
        scale = abs(limit) or 1.0

        def slope() -> Array:
            row = np.zeros((1, self._size))
            row[0, : len(self.reals)] = -sense * derived()[1] / scale
            return row

        room = np.array([sense * (limit - value) / scale - _SPARE])
        return Part(name, room, slope, scale=scale)

    def _other_goals(self) -> Iterator[Part]:
        """Goals that must not become worse than given."""
        goals = self.design.problem.goals
        for k, (goal, floor) in enumerate(zip(goals, self.floors, strict=False)):
            if k != self.goal:
                cost, slope = self._cost_of(goal)
                scale = abs(floor) or 1.0
                value = np.array([(floor - cost) / scale])
                row = partial(np.multiply, -1.0 / scale, slope[None])
                yield Part(goal.name, value, row, scale=scale)


@dataclass(frozen=True)
class Part:
    """Equations or rooms of one requirement, whose derivatives are made when asked for."""

    name: str
    """Of the requirement."""
    value: Array
    """Shape (n,)."""
    slope: Callable[[], Array]
    """Makes the derivatives by all unknowns, shape (n, unknowns)."""
    within: float = 0.0
    """Distance to a place that is allowed, over L."""
    scale: float = 1.0
    """Of what the requirement allows, per unit of the value."""
    unit: str = ""
    """Unit of that; "" for that of the limit or measure."""


def stacked(parts: Sequence[Part]) -> Array:
    """All values, shape (n,)."""
    return np.concatenate([np.empty(0), *(part.value for part in parts)])


def stacked_slopes(parts: Sequence[Part]) -> Array:
    """All derivatives, shape (n, unknowns)."""
    return np.concatenate([part.slope() for part in parts])


def _near_place(part: Part) -> Part:
    """Room on both sides along each axis in a cube within the distance that is allowed."""
    half = _ROOM * part.within / np.sqrt(3.0)
    value = np.concatenate([half - part.value, half + part.value])
    scale = part.scale * np.sqrt(3.0) / _ROOM
    return Part(
        part.name,
        value,
        lambda: np.concatenate([-part.slope(), part.slope()]),
        scale=scale,
        unit=part.unit,
    )


def _row(slopes: Callable[[], Array], k: int) -> Array:
    return slopes()[k]


def _column(slopes: Callable[[], Array], k: int) -> Array:
    return slopes()[:, k]


def lazily(make: Callable[[], Array]) -> Callable[[], Array]:
    """A function that calls another once."""
    return cache(make)


def _room(rules: PoseRules, cube: Array) -> Array:
    """How far poses are from what the rules forbid, over L or over the limit, shape (n, rule).

    With a little to spare, but for what touches at the base, which nothing moves.
    """
    value = rules.judged(rules.rod.box.from_free_cube(cube)).value
    most = np.array([0.0] * len(rules.keeps) + [*rules.limits.values()])
    scale = np.array(
        [rules.arm.length] * len(rules.keeps) + [x or 1.0 for x in rules.limits.values()]
    )
    room = np.nan_to_num((most - value) / scale, nan=-1.0, neginf=-1.0, posinf=1.0)
    return np.where(np.abs(room) < _TOUCHES, 0.0, room - _SPARE)


def _within(targets: Sequence[object]) -> Array:
    """How near the tip must come to each place [m]."""
    each = [
        np.full(len(target.places), target.within)  # pyright: ignore
        for target in targets
        if target.places is not None  # pyright: ignore
    ]
    return np.concatenate([np.empty(0), *each])
