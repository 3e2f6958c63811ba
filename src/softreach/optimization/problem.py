"""Problem of a search: goals and requirements, and how a design is judged by them."""

import hashlib
import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from softreach.arm.body import mass
from softreach.arm.manipulator import Manipulator
from softreach.atlas.metrics import Intermediates, Metric, MetricFailed, known_metric
from softreach.cloud import compute_cloud
from softreach.cloud.dexterity import dexterity
from softreach.cloud.redundancy import activation_distance
from softreach.optimization.free_parameters import FreeParameters, Values
from softreach.requirements.checks import Check, Sets, checked, sets_to
from softreach.requirements.findings import quick_excess
from softreach.requirements.requirements import Requirements
from softreach.stiffness import principal_compliances, tip_compliance
from softreach.support.arguments import as_given, as_names
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, InvalidInput, did_you_mean, no_warnings
from softreach.support.lazy import lazy
from softreach.workspace import ReachableSet
from softreach.workspace.measure import Estimate
from softreach.workspace.payload import payload_curve

SETS = {f"exact_{name}": name for name in ("volume", "convex_volume", "unreachability")}
"""Goals and measures of the reachable set, and what they are called there."""
NEAR = 0.1  # Relative distance within which objectives at the ends of polishes agree
Names = str | Metric | Sequence[str | Metric]
Fidelity = Literal["bounds", "coarse", "full"]  # By bounds alone, on coarse sets, as reported
_COARSE, _FINE = 1 << 12, 1 << 15  # samples of the cloud of coarse and of fine cases
_RADIUS = 0.1  # of neighbors for D̄, in L
_SHARE = 0.8  # of the volume, that the payload leaves


@dataclass(eq=False)
class DesignCase:
    """A design under requirements at one accuracy; its sets, cloud and check are computed once."""

    arm: Manipulator
    requirements: Requirements
    accuracy: float  # Relative error of volumes
    fine: bool = True  # Clouds have as many samples as numbers that are reported need

    @lazy
    def reached(self) -> ReachableSet:
        """The reachable set."""
        return self.set_of(self.arm)

    @lazy
    def set_of(self) -> Sets:
        """Reachable sets of the design and of it under payloads."""
        return sets_to(self.accuracy, quiet=not self.fine)

    @lazy
    def check(self) -> Check:
        """Requirements met and missed; on the way by poses that few descents find."""
        design = self.arm, self.requirements, self.accuracy, self.set_of
        with nullcontext() if self.fine else no_warnings():
            return checked(*design, quick=not self.fine)

    @lazy
    @no_warnings()
    def cloud(self) -> Any:
        """Samples of the activation box."""
        return compute_cloud(self.arm, self.samples, sampler="sobol")

    @property
    def samples(self) -> int:
        """Samples of a cloud."""
        return _FINE if self.fine else _COARSE

    @lazy
    def intermediates(self) -> Intermediates:
        """Intermediate results behind metrics of the atlas."""
        reached = partial(self.set_of, self.arm)
        return Intermediates.of_one(self.arm, self.samples, self.accuracy, reached)


@dataclass(frozen=True)
class Objective:
    """A number of a design that a search makes large or small."""

    name: str
    """Name, as `search` takes it."""
    unit: str
    """SI unit; "1" for none."""
    meaning: str
    """Meaning in a few words."""
    compute: Callable[[DesignCase], Estimate]
    """Function from a design to its number and the error of that."""
    asks: str = ""
    """Part of the requirements that it is about: "targets" or "regions"; "" for none."""
    smooth: bool = True
    """A polish knows its derivatives."""


class Goal(NamedTuple):
    """An objective, and whether it is to be large or small."""

    objective: Objective
    sense: float  # 1 to maximize, -1 to minimize

    @property
    def name(self) -> str:
        """Name of the objective."""
        return self.objective.name

    def value(self, case: DesignCase) -> Estimate:
        """Value of a design; NaN where it has none, as a flat set has no unreachability."""
        value = self.objective.compute(case)
        return value if math.isfinite(value.value) else Estimate(math.nan)


def goals(maximize: Names, minimize: Names, requirements: Requirements) -> tuple[Goal, ...]:
    """Objectives with their senses, in the order in which names or metrics are given.

    Those about targets or regions are refused where the requirements have none.
    """
    result = []
    for word, given, sense in (("maximize", maximize, 1.0), ("minimize", minimize, -1.0)):
        several = [given] if isinstance(given, Metric) else given
        if not (isinstance(several, list | tuple) and any(isinstance(x, Metric) for x in several)):
            several = as_names(word, several)
        result += [Goal(known_objective(word, each), sense) for each in several]
    names = [goal.name for goal in result]
    for goal in result:
        if names.count(goal.name) > 1:
            raise InvalidInput("objective", goal.name, "given once")
        if (asks := goal.objective.asks) and not getattr(requirements, asks):
            raise InvalidInput("objective", goal.name, f"left out: the requirements have no {asks}")
    return tuple(result)


def known_objective(word: str, given: str | Metric) -> Objective:
    """The objective of a name, or of a metric, which errors call by a word."""
    if isinstance(given, str) and given in OBJECTIVES:
        return OBJECTIVES[given]
    metric = given if isinstance(given, Metric) else known_metric(given)
    if metric is None:
        hint = did_you_mean(str(given), OBJECTIVES)
        allowed = f"one of {', '.join(OBJECTIVES)}, or a metric of the atlas"
        raise InvalidInput(word, as_given(given), allowed, hint)
    if metric.over:
        raise InvalidInput(word, metric.name, "a single number, no profile along the arm")
    compute = no_warnings()(lambda case: Estimate(float(metric.value(case.intermediates, {}))))
    return _rough(metric.name, metric.unit, metric.meaning, compute)


_rough = partial(Objective, smooth=False)


def _of_set(name: str) -> Callable[[DesignCase], Estimate]:
    return lambda case: Estimate(*(getattr(case.reached, x) for x in (name, f"{name}_error")))


def _coverage(case: DesignCase) -> Estimate:
    shares = [(each.share, each.error) for each in case.check.coverages]
    return Estimate(*np.mean(shares, axis=0).tolist())


def _effort(total: Callable[[Array], float]) -> Callable[[DesignCase], Estimate]:
    return lambda case: Estimate(float(total(case.check.effort)), 0.0)


def _sampled(values: Any) -> Estimate:
    """Mean of values over samples of the activation box, and its standard error."""
    known = np.asarray(values, float)
    if count := len(known := known[np.isfinite(known)]):
        return Estimate(float(known.mean()), float(known.std() / math.sqrt(count)))
    return Estimate(math.nan)


def _activation_distance(case: DesignCase) -> Estimate:
    radius = _RADIUS * case.arm.length
    return _sampled(activation_distance(case.cloud, radius, queries=min(4096, case.samples)))


def _compliance(case: DesignCase) -> Estimate:
    gamma = case.cloud.activation.values[:256]
    return _sampled(principal_compliances(tip_compliance(case.arm, gamma)).values[:, 0])


def _payload(case: DesignCase) -> Estimate:
    accuracy = max(case.accuracy, 0.01)
    most = payload_curve(case.arm, [], accuracy=accuracy).largest_payload(_SHARE, accuracy=accuracy)
    return Estimate(most.payload, most.payload_error)


_OBJECTIVES = (
    Objective("exact_volume", "m3", "volume of the reachable set", _of_set("volume")),
    Objective("exact_convex_volume", "m3", "volume of its convex hull", _of_set("convex_volume")),
    Objective("exact_unreachability", "1", "1 - volume / convex volume", _of_set("unreachability")),
    Objective("coverage", "1", "mean share of the regions that is reached", _coverage, "regions"),
    Objective("mean_effort", "1", "mean effort at the targets", _effort(np.mean), "targets"),
    Objective("worst_effort", "1", "largest effort at the targets", _effort(np.max), "targets"),
    _rough(
        "manipulability",
        "m3/input3",
        "mean √det(J Jᵀ) over the box",
        lambda case: _sampled(dexterity(case.cloud).manipulability),
    ),
    _rough(
        "dexterity",
        "1",
        "mean of 1 / condition of J over the box",
        lambda case: _sampled(1.0 / dexterity(case.cloud).condition),
    ),
    _rough("activation_distance", "input", "mean D̄ within L/10", _activation_distance),
    _rough("payload", "kg", "payload under which 80 % of the volume is left", _payload),
    _rough("compliance", "m/N", "mean of the largest compliance of the tip", _compliance),
    Objective("mass", "kg", "mass of the arm", lambda case: Estimate(mass(case.arm), 0.0)),
    Objective("actuators", "1", "number of inputs", lambda case: Estimate(case.arm.inputs, 0.0)),
)
OBJECTIVES = {each.name: each for each in _OBJECTIVES}  # beside the metrics of the atlas


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A design that was judged."""

    values: Values
    """Values of the free parameters."""
    objectives: tuple[Estimate, ...] = ()
    """One for each goal [its unit]; none where requirements are missed."""
    excess: float = 0.0
    """Sum of what is missed, over L or relative [-]; 0 if all requirements are met, infinite where
    no such arm can exist."""
    missed: Mapping[str, float] = field(default_factory=dict)
    """Share of `excess` [-] by requirement."""
    undecided: tuple[str, ...] = ()
    """Requirements whose margin is smaller than the error of that."""
    fidelity: Fidelity = "coarse"
    """Accuracy at which it was judged."""
    fault: str = ""
    """Reason why no such arm can exist, or why it has no such number."""
    designs: int = 1
    """Designs that were looked at for it."""

    @property
    def is_feasible(self) -> bool:
        """True of an arm that meets all requirements and has all objectives."""
        return self.excess == 0.0 and not self.fault

    def to_dict(self) -> dict[str, Any]:
        """All of it in plain values; `from_dict` makes an equal one."""
        objectives = [[*value] for value in self.objectives]
        return {**vars(self), "objectives": objectives, "undecided": [*self.undecided]}

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> Self:
        """The candidate that `to_dict` described."""
        objectives = tuple(Estimate(*pair) for pair in record["objectives"])
        return cls(**{**record, "objectives": objectives, "undecided": (*record["undecided"],)})


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Everything that decides which design is best."""

    parameters: FreeParameters
    requirements: Requirements
    goals: tuple[Goal, ...]
    accuracy: float  # Relative error of volumes that are reported
    coarse: float  # Relative error of volumes on the way

    @cached_property
    def digest(self) -> str:
        """Fingerprint of all that decides what a design is worth."""
        parameters, goals = self.parameters, [[goal.name, goal.sense] for goal in self.goals]
        record: Any = {"bases": {name: arm.to_toml() for name, arm in parameters.bases.items()}}
        record["free"] = [[p.name, p.low, p.high, [*p.choices]] for p in parameters.free]
        record["ties"] = [[t.name, t.of, t.factor, t.constant] for t in parameters.ties]
        record |= {"requirements": self.requirements.to_toml(), "goals": goals}
        text = json.dumps(record, default=str)
        return hashlib.sha256(text.encode()).hexdigest()

    def case(self, values: Values, accuracy: float) -> DesignCase:
        """The design with these values, to be asked to a relative error of volumes."""
        fine = accuracy <= self.accuracy
        return DesignCase(self.parameters.arm(values), self.requirements, accuracy, fine)

    def judge(self, values: Values, *, fine: bool = False, bounds: bool = True) -> Candidate:
        """A design against all requirements and goals; first by bounds, which cost next to nothing.

        Bounds discard a design only where it is not judged `fine`.
        """
        try:
            case = self.case(values, self.accuracy if fine else self.coarse)
        except InvalidDesign as error:
            return Candidate(values=values, excess=math.inf, fidelity="bounds", fault=str(error))
        findings = quick_excess(case.arm, self.requirements) if bounds and not fine else ()
        proved = {each.name: each.excess for each in findings if each.excess > 0.0}
        if total := sum(proved.values()):
            return Candidate(values=values, excess=total, missed=proved, fidelity="bounds")
        return self.judged(values, case)

    def judged(self, values: Values, case: DesignCase) -> Candidate:
        """A design of which a case is known."""
        fidelity: Fidelity = "full" if case.fine else "coarse"
        try:
            findings = case.check.findings
            missed = {each.name: each.excess for each in findings if each.excess > 0.0}
            unsure = tuple(each.name for each in findings if each.verdict == "undecided")
            known = {"values": values, "fidelity": fidelity, "undecided": unsure}
            if total := sum(missed.values()):
                return Candidate(excess=total, missed=missed, **known)
            objectives = tuple(goal.value(case) for goal in self.goals)
        except (InvalidInput, InvalidDesign, MetricFailed) as error:
            # Nothing stable under these loads, or a number that this kind of arm does not have.
            fault = str(error)
            return Candidate(values=values, excess=math.inf, fidelity=fidelity, fault=fault)
        pairs = zip(self.goals, objectives, strict=True)
        lacking = [goal.name for goal, (value, _) in pairs if not math.isfinite(value)]
        fault = f"no {', '.join(lacking)}" if lacking else ""
        return Candidate(objectives=objectives, fault=fault, **known)

    def costs(self, candidate: Candidate) -> tuple[float, ...]:
        """Objectives to be made small, of a feasible design."""
        pairs = zip(self.goals, candidate.objectives, strict=True)
        return tuple(-goal.sense * value.value for goal, value in pairs)

    def score(self, candidate: Candidate) -> tuple[bool, float, float]:
        """Place among others, the least first: by what is missed, then by the only goal.

        What bounds alone have judged misses no less than they say, so that it beats nothing.
        """
        if not candidate.is_feasible:
            return candidate.fidelity == "bounds", candidate.excess or math.inf, 0.0
        return False, 0.0, self.costs(candidate)[0] if self.goals else 0.0

    def front(self, candidates: Iterable[Candidate]) -> list[Candidate]:
        """Feasible designs that no other one beats in every goal; the best alone for one goal.

        Without a feasible design that which misses least.
        """
        every = list(candidates)
        feasible = [each for each in every if each.is_feasible]
        if not feasible or len(self.goals) < 2:
            return [min(feasible or every, key=self.score)] if every else []
        costs, kept = np.array([self.costs(each) for each in feasible]), []
        for k, own in enumerate(costs):
            is_beaten = (costs <= own).all(axis=1) & (costs < own).any(axis=1)
            if not (is_beaten.any() or (costs[:k] == own).all(axis=1).any()):
                kept.append(k)
        return [feasible[k] for k in sorted(kept, key=lambda k: tuple(costs[k]))]
