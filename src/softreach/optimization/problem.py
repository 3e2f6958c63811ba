"""Problem of a search: free parameters, requirements and goals; a design judged by them."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Literal, NamedTuple, Self

import numpy as np

from softreach.atlas.metric import MetricFailed
from softreach.optimization.free_parameters import FreeParameters, Values
from softreach.optimization.objectives import SETS, DesignCase, Goal, Value
from softreach.requirements.findings import quick_excess
from softreach.requirements.requirements import Requirements
from softreach.support.errors import InvalidDesign, InvalidInput

NEAR = 0.1
"""Relative distance within which objectives at the ends of polishes agree."""

Fidelity = Literal["bounds", "coarse", "full"]
"""A design is judged by bounds alone, on coarse sets, or to the accuracy that is reported."""


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A design that was judged."""

    values: Values
    """Its free parameters."""
    objectives: tuple[Value, ...] = ()
    """One for each goal; none where requirements are missed."""
    excess: float = 0.0
    """Sum of what is missed, over L or relative; 0 if all requirements are met, infinite where no
    such arm can exist."""
    missed: Mapping[str, float] = field(default_factory=dict)
    """Part of it by requirement."""
    undecided: tuple[str, ...] = ()
    """Requirements whose margin is smaller than the error of that."""
    fidelity: Fidelity = "coarse"
    fault: str = ""
    """Reason why no such arm can exist, or why it has no such number."""
    designs: int = 1
    """Designs that were looked at for it."""

    @property
    def is_feasible(self) -> bool:
        """True of an arm that meets all requirements and has all objectives."""
        known = all(math.isfinite(value.value) for value in self.objectives)
        return self.excess == 0.0 and not self.fault and known

    def to_dict(self) -> dict[str, Any]:
        """All of it in plain values; `from_dict` makes an equal one."""
        objectives = [[*value] for value in self.objectives]
        return {**vars(self), "objectives": objectives, "undecided": [*self.undecided]}

    @classmethod
    def from_dict(cls, record: Mapping[str, Any]) -> Self:
        """The candidate that `to_dict` described."""
        objectives = tuple(Value(*pair) for pair in record["objectives"])
        return cls(**{**record, "objectives": objectives, "undecided": (*record["undecided"],)})


class Score(NamedTuple):
    """Order of candidates of one goal, or of none: the least first."""

    bound: bool
    """True of what bounds alone have judged: its excess is no less, so that it beats nothing."""
    excess: float
    cost: float


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """Everything that decides which design is best."""

    parameters: FreeParameters
    requirements: Requirements
    goals: tuple[Goal, ...]
    accuracy: float
    """Relative error of volumes that are reported."""
    coarse: float
    """Relative error of volumes on the way."""

    @cached_property
    def digest(self) -> str:
        """Fingerprint of all that decides what a design is worth."""
        parameters = self.parameters
        record = {
            "bases": {name: arm.to_toml() for name, arm in parameters.bases.items()},
            "free": [[p.name, p.low, p.high, [*p.choices]] for p in parameters.free],
            "ties": [[t.name, t.of, t.factor, t.constant] for t in parameters.ties],
            "requirements": self.requirements.to_toml(),
            "goals": [[goal.name, goal.sense] for goal in self.goals],
        }
        text = json.dumps(record, default=str)
        return hashlib.sha256(text.encode()).hexdigest()

    @property
    def is_finer_on_finer_sets(self) -> bool:
        """True if reachable sets decide, so that what is best depends on their accuracy."""
        names = {goal.name for goal in self.goals} | {*self.requirements.measures}
        regions = any(target.region is not None for target in self.requirements.targets)
        return regions or not names.isdisjoint(SETS)

    def case(self, values: Values, accuracy: float) -> DesignCase:
        """The design with these values, to be asked to a relative error of volumes.

        Raises:
            InvalidDesign: No such arm can exist.
        """
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
        lacking = [
            goal.name
            for goal, value in zip(self.goals, objectives, strict=True)
            if not math.isfinite(value.value)
        ]
        fault = f"no {', '.join(lacking)}" if lacking else ""
        return Candidate(objectives=objectives, fault=fault, **known)

    def costs(self, candidate: Candidate) -> tuple[float, ...]:
        """Objectives to be made small, of a feasible design."""
        pairs = zip(self.goals, candidate.objectives, strict=True)
        return tuple(-goal.sense * value.value for goal, value in pairs)

    def score(self, candidate: Candidate) -> Score:
        """Place among others: what is missed first, then the only goal."""
        if not candidate.is_feasible:
            return Score(candidate.fidelity == "bounds", candidate.excess or math.inf, 0.0)
        return Score(False, 0.0, self.costs(candidate)[0] if self.goals else 0.0)

    def front(self, candidates: Iterable[Candidate]) -> list[Candidate]:
        """Feasible designs that no other one beats in every goal; the best alone for one goal.

        Without a feasible design that which misses least.
        """
        every = list(candidates)
        feasible = [each for each in every if each.is_feasible]
        if not feasible or len(self.goals) < 2:
            return [min(feasible or every, key=self.score)] if every else []
        costs = np.array([self.costs(each) for each in feasible])
        kept = [
            k
            for k, own in enumerate(costs)
            if not ((costs <= own).all(axis=1) & (costs < own).any(axis=1)).any()
            and not (costs[:k] == own).all(axis=1).any()
        ]
        kept.sort(key=lambda k: tuple(costs[k]))
        return [feasible[k] for k in kept]
