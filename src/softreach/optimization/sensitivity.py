"""Sensitivity of a search: what each parameter is worth, and which requirement decides."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from softreach.atlas.metrics import MetricFailed
from softreach.optimization.polish import point_of
from softreach.optimization.problem import SETS, Candidate, Problem
from softreach.optimization.program import Point, stacked_slopes
from softreach.optimization.result import Search
from softreach.support import parallel
from softreach.support.arguments import as_instance, as_integer
from softreach.support.arrays import Array, over
from softreach.support.errors import InvalidDesign, InvalidInput, NotPossible, no_warnings
from softreach.support.lazy import Dataset
from softreach.support.progress import Progress, as_progress
from softreach.support.quantity import quantity

_ACTIVE = 1e-3  # room below which a requirement may decide
_AT_END = 1e-6  # of a range
_CONFIDENCE = (0.025, 0.975)
_RESAMPLES = 400
_MOST = 1 << 16


class Multiplier(NamedTuple):
    """Price of a requirement: by how much the goal would be better if it allowed more."""

    name: str
    """Requirement, place of a target, or end of a parameter's range."""
    value: float
    """Gain of the goal per unit that is allowed more [goal per unit]; for a place per m that it
    comes nearer."""
    unit: str
    """Unit of what is allowed; "" where it is that of the limit."""


class VarianceShares(NamedTuple):
    """Share of a goal's variance over the searched ranges by each free parameter."""

    first: Array
    """Share of each parameter by itself [-]: Sobol's index of first order, shape (parameters,)."""
    first_error: Array
    """Half the confidence interval of 95 % [-], by bootstrap over the rows of designs."""
    total: Array
    """Share of each parameter together with others [-]: the total index, shape (parameters,)."""
    total_error: Array
    """Half the confidence interval of `total` [-], as of `first`."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Sensitivity:
    """Influences on a design: of parameters nearby and over their ranges, and of requirements."""

    goals: tuple[str, ...]
    """Names of the goals."""
    goal_units: tuple[str, ...]
    """Unit of each goal."""
    reals: tuple[str, ...]
    """Parameters that can change a little."""
    units: tuple[str, ...]
    """Unit of each of them."""
    parameters: tuple[str, ...]
    """All free parameters."""
    gradient: Array
    """Derivatives of the goals with poses that follow [goal per unit], (goals, reals); NaN of goals
    without derivatives."""
    gradient_error: Array
    """Errors of `gradient` [goal per unit], (goals, reals)."""
    multipliers: tuple[Multiplier, ...]
    """Prices of requirements for the first goal, those that decide most first."""
    residual: float
    """Share of the first goal's slope that no requirement explains [-]: 0 at an optimum, NaN
    without any."""
    variance: tuple[VarianceShares | None, ...]
    """Shares of variance for each goal; None if a design cannot exist or has no such number."""
    designs: int
    """Designs that were looked at."""

    def to_dataset(self) -> Dataset:
        """Gradients, shares of variance and multipliers, labeled."""
        import xarray as xr

        count = len(self.parameters)
        lacks = np.full((4, count), math.nan)
        each = [lacks if shares is None else shares for shares in self.variance]
        shares = np.array(each).reshape(-1, 4, count).swapaxes(0, 1)
        variances = dict(zip(VarianceShares._fields, shares, strict=True))
        at = ("goal", "real")
        values = over(at, gradient=self.gradient, gradient_error=self.gradient_error)
        values |= over(("goal", "parameter"), "1", **variances)
        values |= over("requirement", multiplier=[each.value for each in self.multipliers])
        names = {"goal": list(self.goals), "real": list(self.reals)}
        names |= over("goal", goal_unit=list(self.goal_units))
        names |= over("real", real_unit=list(self.units)) | {"parameter": list(self.parameters)}
        names |= {"requirement": [each.name for each in self.multipliers]}
        return xr.Dataset(values, names, {"residual": self.residual, "designs": self.designs})

    def __repr__(self) -> str:
        lines = [f"Sensitivity ({self.designs:,} designs):"]
        for k, goal in enumerate(self.goals):
            lines.append(f"{goal}:")
            slopes = (self.reals, self.units, self.gradient[k], self.gradient_error[k])
            for name, unit, value, error in zip(*slopes, strict=True):
                per = f"{self.goal_units[k].replace('m3', 'm³')}/{unit}"
                if np.isfinite(value):
                    lines.append(f"  by {name}: {quantity(value, per, error)}")
            if (share := self.variance[k]) is not None:
                each = []
                for j in np.argsort(-share.total, kind="stable"):
                    alone = f"{share.first[j]:.2f} ± {share.first_error[j]:.2f}"
                    total = f"{share.total[j]:.2f} ± {share.total_error[j]:.2f}"
                    each.append(f"{self.parameters[j]} {alone} ({total})")
                lines.append(f"  variance alone (in all): {', '.join(each)}")
        for each in self.multipliers:
            per = f"{self.goal_units[0]} per {each.unit or 'unit'}"
            lines.append(f"decides: {each.name}, {each.value:.4g} {per}")
        if np.isfinite(self.residual):
            lines.append(f"not explained by requirements: {100 * self.residual:.2g} % of the slope")
        return "\n  ".join(lines)


def sensitivity(
    of: Search | Problem,
    candidate: Candidate | None = None,
    *,
    n: int = 64,
    seed: int = 0,
    progress: Progress | None = None,
) -> Sensitivity:
    """Effect of each free parameter on the goals, and the requirements that decide.

    Derivatives at the design are exact; poses at the targets follow so that the tips stay where
    they must be. Multipliers explain the slope of the first goal by requirements that have no room
    left and by ends of ranges: nonnegative least squares of the conditions of Karush, Kuhn and
    Tucker, with the part that is left. Shares of variance are Sobol's indices of the goals, on
    coarse sets over all of the ranges and choices, whether or not requirements are met.

    Args:
        of: A search, or its problem.
        candidate: The design; by default the best of the search.
        n: Rows of designs for the shares of variance, a power of two; parameters + 2 designs each.
            0 for none.
        seed: Of these designs, and of the bootstrap.
        progress: Called with the number of designs looked at since its last call.

    Raises:
        InvalidInput: An n that is no power of two.
        NotPossible: A problem without a candidate.
        InvalidDesign: The candidate cannot exist.
    """
    as_instance("of", of, (Search, Problem), "a Search, or a Problem with a candidate")
    if isinstance(of, Search):
        problem, candidate = of.problem, of.best if candidate is None else candidate
    else:
        problem = of
        if candidate is None:
            raise NotPossible("give a candidate too: a problem has no best design")
    as_instance("candidate", candidate, Candidate, "a Candidate")
    n, seed = as_integer("n", n, 0, _MOST), as_integer("seed", seed, 0)
    if n & (n - 1):
        raise InvalidInput("n", n, "a power of two, or 0")
    progress = as_progress(progress)
    with no_warnings():
        gradient, error = _gradients(problem, candidate)
        multipliers, residual = _multipliers(problem, candidate)
        variance = (None,) * len(problem.goals)
        if n and variance:
            variance = _variances(problem, n, seed, progress)
    parameters, goals = problem.parameters, [goal.objective for goal in problem.goals]
    found: Any = {
        "gradient": gradient,
        "gradient_error": error,
        "variance": variance,
        "multipliers": multipliers,
        "residual": residual,
        "goals": tuple(goal.name for goal in goals),
        "parameters": parameters.names,
        "goal_units": tuple(goal.unit for goal in goals),
        "reals": tuple(each.name for each in parameters.real),
    }
    units = tuple(each.unit for each in parameters.real)
    return Sensitivity(units=units, designs=n * (len(parameters) + 2), **found)


def _gradients(problem: Problem, candidate: Candidate) -> tuple[Array, Array]:
    widths = np.ptp(problem.parameters.bounds, axis=1)
    values, errors = np.full((2, len(problem.goals), len(widths)), math.nan)
    for k, goal in enumerate(problem.goals):
        if goal.objective.smooth and len(widths):
            point = point_of(problem, candidate, problem.accuracy, k)
            slope, of_poses = np.split(point.cost_slope, [len(widths)])
            equations, moves = np.split(_equations(point), [len(widths)], axis=1)
            if len(equations) and np.any(of_poses):  # poses keep the tips where they are
                slope = slope + np.linalg.lstsq(moves.T, -of_poses, rcond=None)[0] @ equations
            values[k], errors[k] = -goal.sense * slope / widths, 0.0
            if goal.name in SETS:
                error = getattr(point.design.sets, f"{SETS[goal.name]}_error")
                errors[k] = error @ np.abs(point.design.chain) / widths
    return values, errors


def _multipliers(problem: Problem, candidate: Candidate) -> tuple[tuple[Multiplier, ...], float]:
    """Multipliers of the first goal, and the part of its slope that they do not explain."""
    from scipy.optimize import nnls

    if not problem.goals or not problem.goals[0].objective.smooth or not problem.parameters.real:
        return (), math.nan
    point = point_of(problem, candidate, problem.accuracy)
    slope, equations = point.cost_slope, _equations(point)
    size = float(np.linalg.norm(slope))
    rows = ((p, k) for p in point.inequalities for k in np.flatnonzero(p.value <= _ACTIVE))
    bounds = [(-p.slope()[k], Multiplier(p.name, 1.0 / p.scale, p.unit)) for p, k in rows]
    bounds += _ends(problem, point)
    columns = [*equations, *-equations, *(slope for slope, _ in bounds)]
    if not size or not columns:
        return (), float(bool(size))
    weights, rest = nnls(np.stack(columns, axis=1), -slope)
    there, back, others = np.split(weights, [len(equations), 2 * len(equations)])
    pulls = np.linalg.norm((there - back).reshape(-1, 3), axis=1).tolist()
    pairs = zip(pulls, point.equations, strict=True)
    each = [(part.name, part.unit, pull / part.scale) for pull, part in pairs]
    pairs = zip(others.tolist(), bounds, strict=True)
    each += [(name, unit, weight * gain) for weight, (_, (name, gain, unit)) in pairs]
    gains: dict[tuple[str, str], float] = {}
    for name, unit, gain in each:  # a place under several payloads counts with all of them
        gains[name, unit] = gains.get((name, unit), 0.0) + gain
    result = [Multiplier(name, gain, unit) for (name, unit), gain in gains.items() if gain]
    return tuple(sorted(result, key=lambda each: -each.value)), float(rest) / size


def _equations(point: Point) -> Array:
    parts = point.equations
    return stacked_slopes(parts) if parts else np.empty((0, len(point.cost_slope)))


def _ends(problem: Problem, point: Point) -> Iterator[tuple[Array, Multiplier]]:
    """Slopes of bounds of unknowns, and what these are worth per unit: nothing for a pose."""
    unknowns, reals = np.concatenate([point.reals, point.poses.ravel()]), problem.parameters.real
    for j, (place, row) in enumerate(zip(unknowns, np.eye(len(unknowns)), strict=True)):
        for end, sign, word in ((0.0, -1.0, "low"), (1.0, 1.0, "high")):
            if abs(place - end) <= _AT_END:
                worth = Multiplier("", 0.0, "")
                if j < len(reals):
                    gain = 1.0 / (reals[j].high - reals[j].low)
                    worth = Multiplier(f"{word} end of {reals[j].name}", gain, reals[j].unit)
                yield sign * row, worth


def _variances(
    problem: Problem, n: int, seed: int, progress: Progress
) -> tuple[VarianceShares | None, ...]:
    """Shares of variance of each goal, of designs on coarse sets [Saltelli2010]."""
    from scipy.stats import qmc

    free, rng = problem.parameters.free, np.random.default_rng(seed)
    known: list[list[float]] = []
    cube = qmc.Sobol(2 * len(free), rng=rng, bits=64).random(n)
    first, second = np.split(cube, 2, axis=1)
    mixed = np.where(np.eye(len(free), dtype=bool)[:, None], second, first)
    places = np.concatenate([first, second, *mixed]).tolist()
    designs = ({p.name: p.at(x) for p, x in zip(free, each, strict=True)} for each in places)
    tasks = (partial(_values, problem, design) for design in designs)
    for row in parallel.in_order(tasks):
        known.append(row)
        progress(1)
    values = np.array(known).reshape(-1, n, len(problem.goals))
    values -= values[:2].mean(axis=(0, 1))

    def indices(rows: Any) -> Array:
        """Of first order, and total ones, shape (2, parameter, goal); 0 of what never changes."""
        here, there, *between = values[:, rows]
        moved = np.array(between) - here
        parts = (there * moved).mean(axis=1), 0.5 * (moved**2).mean(axis=1)
        with np.errstate(all="ignore"):
            shares = np.array(parts) / np.var([here, there], axis=(0, 1))
        return np.where(np.isfinite(shares), shares, 0.0)

    again = [indices(rng.integers(n, size=n)) for _ in range(_RESAMPLES)]
    errors = 0.5 * np.ptp(np.quantile(again, _CONFIDENCE, axis=0), axis=0)
    shares = np.stack([indices(slice(None)), errors], axis=1).reshape(4, len(free), -1)
    is_known = np.isfinite(values).all(axis=(0, 1)).tolist()
    return tuple(VarianceShares(*shares[..., k]) if x else None for k, x in enumerate(is_known))


def _values(problem: Problem, values: Mapping[str, Any]) -> list[float]:
    """All goals of a design on coarse sets; NaN where it cannot exist or has no such number."""
    with parallel.undivided(), no_warnings():
        try:
            case = problem.case(values, problem.coarse)
            return [goal.value(case).value for goal in problem.goals]
        except (InvalidDesign, InvalidInput, MetricFailed):
            return [math.nan] * len(problem.goals)
