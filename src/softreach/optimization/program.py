"""Design and poses as one smooth program: values and derivatives at one place of the unknowns."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, partial

import numpy as np

from softreach.arm.body import load_number, mass
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import find_parameters, parameters_by_every_name
from softreach.geometry.regions import Region
from softreach.optimization.free_parameters import Values
from softreach.optimization.problem import SETS, DesignCase, Goal, Problem
from softreach.requirements.poses import PoseRules, effort_scales
from softreach.rod.rods import as_tip_map, effective, in_steps, refined
from softreach.rod.tip_map import TipMap
from softreach.support.arrays import Array
from softreach.support.lazy import lazy
from softreach.workspace.gradient import VolumeGradient, boundary_samples, gradient_of
from softreach.workspace.tip_derivatives import TipDerivatives

OF_ARM: dict[str, Callable[[Manipulator], float]] = {"mass": mass, "load_number": load_number}
OF_ARM["actuators"] = lambda arm: float(arm.inputs)
_TOL = 1e-7  # of tips at the targets, in L
STEP = 1e-4  # of a range, or of the unit cube, for what is differentiated by differences
_PLACES = 8192  # of a region, whose share is covered


@dataclass(eq=False)
class DesignPoint:
    """One design on the way of a polish; derivatives are by real parameters over their ranges."""

    problem: Problem
    values: Values
    accuracy: float
    like: Sequence[TipMap] = ()  # Tip maps of a design nearby, in as many steps

    @lazy
    def case(self) -> DesignCase:
        """The design, to be asked."""
        return self.problem.case(self.values, self.accuracy)

    @lazy
    def arms(self) -> list[Manipulator]:
        """The arm under each payload."""
        return self.problem.requirements.under_payloads(self.case.arm)

    @lazy
    def rods(self) -> tuple[TipMap, ...]:
        """Its tip map under each payload."""
        if not self.like:
            return tuple(refined(as_tip_map(arm), _TOL) for arm in self.arms)
        pairs = zip(self.arms, self.like, strict=True)
        return tuple(in_steps(arm, rod.steps, rod) for arm, rod in pairs)

    @lazy
    def derivatives(self) -> tuple[TipDerivatives, ...]:
        """∂r/∂p of each of these, by parameters of the arm."""
        return tuple(map(self._derivatives_of, self.rods))

    def _derivatives_of(self, rod: TipMap) -> TipDerivatives:
        known = find_parameters(rod.arm, self.moved)
        return TipDerivatives(rod, [known[name] for name in self.moved])

    @lazy
    def sets(self) -> VolumeGradient:
        """Derivatives of the reachable set."""
        return gradient_of(self.case.reached, (*self.moved,), self.accuracy)

    def value(self, name: str) -> float:
        """A number of the reachable set, of what it covers, or of the design alone."""
        if name == "coverage":
            return float(np.mean([self.share(*pair) for pair in self._covered]))
        if name in SETS:
            return float(getattr(self.case.reached, SETS[name]))
        return OF_ARM[name](self.case.arm)

    def slope(self, name: str) -> Array:
        """Its derivatives by the reals; those of the design alone by differences."""
        if name == "coverage":
            return np.mean([self.share_slope(*pair) for pair in self._covered], axis=0)
        if name in SETS:
            return getattr(self.sets, SETS[name]) @ self.chain
        of = OF_ARM[name]
        return np.array([(of(up) - of(down)) / step for step, up, down in self.neighbors])

    @property
    def _covered(self) -> list[tuple[int, Region]]:
        """Numbers of the payloads with the regions that must be covered under them."""
        regions = self.problem.requirements.regions
        return [(number, region) for number in range(len(self.arms)) for _, region in regions]

    def share(self, number: int, region: Region) -> float:
        """Share of a region that the tip reaches under a payload."""
        solid = self.case.set_of(self.arms[number])
        if solid.dimension < 3:
            return 0.0
        return float(solid.contains(region.places(_PLACES)).mean())

    def share_slope(self, number: int, region: Region) -> Array:
        """Its derivatives: what the part of the boundary in the region sweeps, theory (98)."""
        solid = self.case.set_of(self.arms[number])
        if solid.dimension < 3:
            return np.zeros(len(self.problem.parameters.real))
        nodes = boundary_samples(solid.image)
        inside = (region.distance(nodes.places) <= 0.0).astype(float)
        own, rod = self.rods[number], effective(self.rods[number])
        derivatives = self.derivatives[number] if rod is own else self._derivatives_of(rod)
        swept = nodes.derivative(derivatives.at(nodes.cube), inside)
        return swept @ self.chain / region.volume

    @lazy
    def neighbors(self) -> list[tuple[float, Manipulator, Manipulator]]:
        """Designs on both sides along each real parameter, and how far they are apart."""
        parameters, pairs = self.problem.parameters, []
        for p in parameters.real:
            steps = np.array([1, -1]) * STEP * (p.high - p.low)
            ends = np.clip(float(self.values[p.name]) + steps, p.low, p.high).tolist()
            arms = (parameters.arm({**self.values, p.name: end}) for end in ends)
            pairs.append(((ends[0] - ends[1]) / (p.high - p.low), *arms))
        return pairs

    @property
    def chain(self) -> Array:
        """Change of parameters of the arm by unknowns, shape (parameter, real)."""
        return np.array([*self.moved.values()]).reshape(-1, len(self.problem.parameters.real))

    @lazy
    def moved(self) -> dict[str, Array]:
        """Parameters of the arm that move, and how with unknowns: by ranges and ties."""
        parameters = self.problem.parameters
        known = parameters_by_every_name(self.case.arm)
        names = [each.name for each in parameters.real]
        widths = dict(zip(names, np.diag(np.ptp(parameters.bounds, axis=1)), strict=True))
        rows = {name: row for name, row in widths.items() if name in known}
        for tie in parameters.ties:
            if tie.of in widths and tie.name in known:
                rows[tie.name] = tie.factor * widths[tie.of]
        return rows


EFFORTS = ("mean_effort", "worst_effort")
_FAR = 0.1  # over L or relative: room beyond which a rule is not differentiated
_ROOM = 0.98  # of the distance within which a tip must come to a place
_SPARE = 1e-4  # over L or relative, by which limits are kept
_TOUCHES = 1e-12
_POWER = 40  # of the mean that stands for the largest effort
_NOWHERE = 10.0  # L: a tip without a stable equilibrium


@dataclass(frozen=True)
class Part:
    """Equations or inequalities of one requirement, differentiated when they are used first."""

    name: str  # Of the requirement
    value: Array  # Shape (n,)
    slope: Callable[[], Array]  # Makes the derivatives by all unknowns, shape (n, unknowns)
    within: float = 0.0  # Distance to a place that is allowed, over L
    scale: float = 1.0  # Of what the requirement allows, per unit of the value
    unit: str = ""  # Unit of that; "" for that of the limit or measure


@dataclass(eq=False)
class Point:
    """A design with its poses: cost, equations and inequalities, each with all derivatives.

    Unknowns are the real parameters over their ranges, then the poses in the unit cube of the free
    inputs, one for each payload and place.
    """

    design: DesignPoint
    reals: Array
    poses: Array  # Shape (payloads · places, free inputs)
    goal: int
    floors: Sequence[float]

    @lazy
    def cost(self) -> float:
        """Cost of the goal."""
        goals = self.design.problem.goals
        return self._cost(goals[self.goal]) if goals else 0.0

    @lazy
    def cost_slope(self) -> Array:
        """Its derivatives."""
        goals = self.design.problem.goals
        return self._cost_slope(goals[self.goal]) if goals else np.zeros(self._size)

    @lazy
    def equations(self) -> tuple[Part, ...]:
        """Tips less the places that they must be at, over L."""
        return tuple(part for part in self._tips if part.within == 0.0)

    @lazy
    def inequalities(self) -> tuple[Part, ...]:
        """Quantities kept above 0: limits, measures, regions, other goals."""
        near = (_near_place(part) for part in self._tips if part.within > 0.0)
        return (*near, *self._rules(), *self._of_design())

    @property
    def _size(self) -> int:
        return len(self.reals) + self.poses.size

    def _cost(self, goal: Goal) -> float:
        name, of_poses = goal.name, goal.name in EFFORTS
        return -goal.sense * (self._effort(name)[0] if of_poses else self.design.value(name))

    def _cost_slope(self, goal: Goal) -> Array:
        slope = np.zeros(self._size)
        if goal.name in EFFORTS:
            slope = self._effort(goal.name)[1]
        else:
            slope[: len(self.reals)] = self.design.slope(goal.name)
        return -goal.sense * slope

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
        moves = weight[:, None] * gamma[:, box.free] / each[:, None] * widths
        return mean, np.concatenate([np.zeros(len(self.reals)), moves.ravel()])

    @lazy
    def _tips(self) -> list[Part]:
        needs, parts = self.design.problem.requirements, []
        for number, (rod, cube) in enumerate(self._by_payload()):
            tips = rod.tips(rod.box.from_free_cube(cube))
            gaps = np.nan_to_num((tips - needs.places) / rod.length, nan=_NOWHERE)
            slopes = cache(partial(self._tip_slopes, number))
            for k, (gap, near) in enumerate(zip(gaps, needs.within / rod.length, strict=True)):
                slope = partial(lambda of, k: of()[k], slopes, k)
                parts.append(Part(f"place {k + 1}", gap, slope, near, rod.length, "m"))
        return parts

    def _tip_slopes(self, number: int) -> Array:
        """Derivatives of tips over L under one payload, shape (place, 3, unknowns)."""
        rod, cube = self._by_payload()[number]
        box, count = rod.box, len(self.reals)
        _, slopes = rod.tips_and_slopes(box.from_free_cube(cube))
        result = np.zeros((len(cube), 3, self._size))
        result[:, :, :count] = self.design.derivatives[number].at(cube) @ self.design.chain
        for k, column in zip(box.free, self._columns(number), strict=True):
            result[np.arange(len(cube)), :, column] = slopes[:, :, k] * box.widths[k]
        return np.nan_to_num(result / rod.length)

    def _by_payload(self) -> list[tuple[TipMap, Array]]:
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
        needs = self.design.problem.requirements
        keeps = tuple(keep for keep in needs.keeps if keep.when == "targets")

        def rules_of(arm: Manipulator, number: int) -> PoseRules:
            laden = needs.under_payloads(arm)[number]
            like = self.design.rods[number]
            rod = like if arm is self.design.case.arm else in_steps(laden, like.steps, like)
            return PoseRules(laden, keeps, needs.limits.of_poses, np.inf, rod)

        for number, (_, cube) in enumerate(self._by_payload()):
            rules = rules_of(self.design.case.arm, number)
            if not len(rules):
                return
            value = _room(rules, cube)
            slopes = cache(partial(self._rule_slopes, rules_of, number, value))
            names = [*((keep.name, "m") for keep in keeps), *((name, "") for name in rules.limits)]
            for column, ((name, unit), scale) in enumerate(zip(names, rules.rooms[1], strict=True)):
                slope = partial(lambda of, k: of()[:, k], slopes, column)
                yield Part(name, value[:, column], slope, scale=float(scale), unit=unit)

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
            ends[:, :, j] = np.clip(cube[:, j] + np.array([[STEP], [-STEP]]), 0.0, 1.0)
            ahead, behind = (_room(rules.some(near), end) for end in ends)
            apart = (ends[0, :, j] - ends[1, :, j])[:, None]
            for place, at in enumerate(column):
                slope[place, near, at] = ((ahead - behind) / apart)[place]
        return slope

    def _of_design(self) -> Iterator[Part]:
        """Shares of regions, measures and limits of the design, and the costs of other goals."""
        needs, goals = self.design.problem.requirements, self.design.problem.goals
        for target, region in needs.regions:
            for number in range(len(self.design.rods)):
                share = self.design.share(number, region)
                slope = partial(self.design.share_slope, number, region)
                yield self._limit(target.name, -1.0, share, target.share, slope)
        ends = [(name, needs.measures[name]) for name in needs.measures if name in SETS]
        ends += [(name, (None, needs.limits.given.get(name))) for name in OF_ARM]
        for name, pair in ends:
            for sense, limit in zip((-1.0, 1.0), pair, strict=True):
                if limit is not None:
                    slope = partial(self.design.slope, name)
                    yield self._limit(name, sense, self.design.value(name), limit, slope)
        for k, (goal, floor) in enumerate(zip(goals, self.floors, strict=False)):
            if k != self.goal:
                scale = abs(floor) or 1.0
                value = np.array([(floor - self._cost(goal)) / scale])
                slope = partial(lambda g, s: -self._cost_slope(g)[None] / s, goal, scale)
                yield Part(goal.name, value, slope, scale=scale)

    def _limit(
        self, name: str, sense: float, value: float, limit: float, derived: Callable[[], Array]
    ) -> Part:
        """Room below a limit (sense 1) or above it (-1), relative."""
        scale = abs(limit) or 1.0

        def slope() -> Array:
            row = np.zeros((1, self._size))
            row[0, : len(self.reals)] = -sense * derived() / scale
            return row

        room = np.array([sense * (limit - value) / scale - _SPARE])
        return Part(name, room, slope, scale=scale)


def stacked(parts: Sequence[Part]) -> Array:
    """All values, shape (n,)."""
    return np.concatenate([np.empty(0), *(part.value for part in parts)])


def stacked_slopes(parts: Sequence[Part]) -> Array:
    """All derivatives, shape (n, unknowns)."""
    return np.concatenate([part.slope() for part in parts])


def _near_place(part: Part) -> Part:
    """Room on both sides along each axis in a cube within the distance that is allowed."""
    half, scale = _ROOM * part.within / np.sqrt(3.0), part.scale * np.sqrt(3.0) / _ROOM
    value = np.concatenate([half - part.value, half + part.value])
    slope = partial(lambda of: np.concatenate([-of(), of()]), part.slope)
    return Part(part.name, value, slope, scale=scale, unit=part.unit)


def _room(rules: PoseRules, cube: Array) -> Array:
    """Distances of poses from what the rules forbid, over L or the limit, shape (n, rule).

    With a little to spare, but for what touches at the base, which nothing moves.
    """
    value = rules.judged(rules.rod.box.from_free_cube(cube)).value
    most, scale = rules.rooms
    room = np.nan_to_num((most - value) / scale, nan=-1.0, neginf=-1.0, posinf=1.0)
    return np.where(np.abs(room) < _TOUCHES, 0.0, room - _SPARE)
