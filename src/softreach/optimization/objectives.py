"""Objectives of a search: numbers of a design, what they need, and what can be differentiated."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softreach.arm.body import mass
from softreach.arm.manipulator import Manipulator
from softreach.atlas.intermediates import Intermediates
from softreach.atlas.metric import Metric
from softreach.atlas.metrics import known_metric
from softreach.requirements.checks import Check, Sets, checked, quick_check, sets_to
from softreach.requirements.requirements import Requirements
from softreach.support.arguments import as_given, as_names
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, did_you_mean, no_warnings
from softreach.support.lazy import lazy

if TYPE_CHECKING:
    import xarray as xr

    from softreach.workspace import ReachableSet

SETS = {
    "exact_volume": "volume",
    "exact_convex_volume": "convex_volume",
    "exact_unreachability": "unreachability",
}
"""Goals and measures of the reachable set, and what they are called there."""

_COARSE, _FINE = 1 << 12, 1 << 15
"""Samples of the cloud of coarse and of fine cases."""
_RADIUS = 0.1  # of neighbors for D̄, in L
_SHARE = 0.8  # of the volume, that the payload leaves


class Value(NamedTuple):
    """A number and how far off it may be."""

    value: float
    error: float = math.nan


@dataclass(eq=False)
class DesignCase:
    """A design under requirements at one accuracy; its sets, cloud and check are computed once."""

    arm: Manipulator
    requirements: Requirements
    accuracy: float
    """Relative error of volumes."""
    fine: bool = True
    """Clouds have as many samples as numbers that are reported need."""

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
        if self.fine:
            return checked(self.arm, self.requirements, self.accuracy, self.set_of)
        with no_warnings():
            return quick_check(self.arm, self.requirements, self.accuracy, self.set_of)

    @lazy
    @no_warnings()
    def cloud(self) -> xr.Dataset:
        """Samples of the activation box."""
        from softreach.cloud import compute_cloud

        return compute_cloud(self.arm, self.samples, sampler="sobol")

    @property
    def samples(self) -> int:
        """Samples of a cloud."""
        return _FINE if self.fine else _COARSE

    @no_warnings()
    def metric(self, metric: Metric) -> float:
        """A metric of the atlas."""
        return float(metric.value(self._intermediates, {}))

    @lazy
    def _intermediates(self) -> Intermediates:
        return Intermediates.of_one(
            self.arm, self.samples, self.accuracy, partial(self.set_of, self.arm)
        )


@dataclass(frozen=True, kw_only=True)
class Objective:
    """A number of a design that a search makes large or small."""

    name: str
    unit: str
    meaning: str
    compute: Callable[[DesignCase], Value]
    asks: str = ""
    """Part of the requirements that it is about: "targets" or "regions"; "" for none."""
    smooth: bool = False
    """A polish knows its derivatives."""


class Goal(NamedTuple):
    """An objective, and whether it is to be large or small."""

    objective: Objective
    sense: float
    """1 to maximize, -1 to minimize."""

    @property
    def name(self) -> str:
        """Name of the objective."""
        return self.objective.name

    def value(self, case: DesignCase) -> Value:
        """Value of a design; NaN where it has none, as a flat set has no unreachability."""
        value = self.objective.compute(case)
        return value if math.isfinite(value.value) else Value(math.nan)


def goals(
    maximize: str | Metric | Sequence[str | Metric],
    minimize: str | Metric | Sequence[str | Metric],
    requirements: Requirements,
) -> tuple[Goal, ...]:
    """Objectives with their senses, in the order in which they are given.

    Args:
        maximize: Names of objectives, or metrics of your own.
        minimize: The same.
        requirements: What some of them are about.

    Raises:
        InvalidInput: An unknown one, one that is given twice, or one about targets or regions that
            the requirements do not have.
    """
    result = []
    for word, given, sense in (("maximize", maximize, 1.0), ("minimize", minimize, -1.0)):
        several = [given] if isinstance(given, Metric) else given
        if not (isinstance(several, list | tuple) and any(isinstance(x, Metric) for x in several)):
            several = as_names(word, several)
        result += [Goal(known_objective(word, each), sense) for each in several]
    names = [goal.name for goal in result]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInput("objective", twice[0], "given once")
    has = {
        "targets": bool(requirements.targets),
        "regions": any(target.region is not None for target in requirements.targets),
    }
    for goal in result:
        if goal.objective.asks and not has[goal.objective.asks]:
            allowed = f"left out: the requirements have no {goal.objective.asks}"
            raise InvalidInput("objective", goal.name, allowed)
    return tuple(result)


def known_objective(word: str, given: str | Metric) -> Objective:
    """The objective of a name, or of a metric.

    Args:
        word: What errors call it.
        given: Its name, or a metric.

    Raises:
        InvalidInput: There is none.
    """
    if isinstance(given, str) and given in OBJECTIVES:
        return OBJECTIVES[given]
    metric = given if isinstance(given, Metric) else known_metric(given)
    if metric is None:
        hint = did_you_mean(str(given), OBJECTIVES)
        allowed = f"one of {', '.join(OBJECTIVES)}, or a metric of the atlas"
        raise InvalidInput(word, as_given(given), allowed, hint)
    if metric.over:
        raise InvalidInput(word, metric.name, "a single number, no profile along the arm")
    return Objective(
        name=metric.name,
        unit=metric.unit,
        meaning=metric.meaning,
        compute=lambda case: Value(case.metric(metric)),
    )


def _of_set(name: str, case: DesignCase) -> Value:
    return Value(getattr(case.reached, name), getattr(case.reached, f"{name}_error"))


def _coverage(case: DesignCase) -> Value:
    covered = case.check.coverages
    shares = [each.share for each in covered]
    return Value(float(np.mean(shares)), float(np.mean([each.error for each in covered])))


def _effort(total: Callable[[Array], float], case: DesignCase) -> Value:
    return Value(float(total(case.check.effort)), 0.0)


def _sampled(values: Any) -> Value:
    """Mean of values over samples of the activation box, and its standard error."""
    known = np.asarray(values, float)
    known = known[np.isfinite(known)]
    if not len(known):
        return Value(math.nan)
    return Value(float(known.mean()), float(known.std() / math.sqrt(len(known))))


def _dexterity(case: DesignCase) -> xr.Dataset:
    from softreach.cloud.dexterity import dexterity

    return dexterity(case.cloud)


def _activation_distance(case: DesignCase) -> Value:
    from softreach.cloud.redundancy import activation_distance

    radius = _RADIUS * case.arm.length
    return _sampled(activation_distance(case.cloud, radius, queries=min(4096, case.samples)))


def _compliance(case: DesignCase) -> Value:
    from softreach.stiffness import principal_compliances, tip_compliance

    gamma = case.cloud.activation.values[:256]
    return _sampled(principal_compliances(tip_compliance(case.arm, gamma)).values[:, 0])


def _payload(case: DesignCase) -> Value:
    from softreach.workspace.payload import payload_curve

    accuracy = max(case.accuracy, 0.01)
    most = payload_curve(case.arm, [], accuracy=accuracy).largest_payload(_SHARE, accuracy=accuracy)
    return Value(most.payload, most.payload_error)


_ROWS: tuple[tuple[str, str, str, Callable[[DesignCase], Value]], ...] = (
    ("exact_volume", "m3", "volume of the reachable set", partial(_of_set, "volume")),
    ("exact_convex_volume", "m3", "volume of its convex hull", partial(_of_set, "convex_volume")),
    ("exact_unreachability", "1", "1 - volume / convex volume", partial(_of_set, "unreachability")),
    ("coverage", "1", "mean share of the regions that is reached", _coverage),
    ("mean_effort", "1", "mean effort at the targets", partial(_effort, np.mean)),
    ("worst_effort", "1", "largest effort at the targets", partial(_effort, np.max)),
    (
        "manipulability",
        "m3/input3",
        "mean √det(J Jᵀ) over the box",
        lambda case: _sampled(_dexterity(case).manipulability),
    ),
    (
        "dexterity",
        "1",
        "mean of 1 / condition of J over the box",
        lambda case: _sampled(1.0 / _dexterity(case).condition),
    ),
    ("activation_distance", "input", "mean D̄ within L/10", _activation_distance),
    ("payload", "kg", "payload under which 80 % of the volume is left", _payload),
    ("compliance", "m/N", "mean of the largest compliance of the tip", _compliance),
    ("mass", "kg", "mass of the arm", lambda case: Value(mass(case.arm), 0.0)),
    ("actuators", "1", "number of inputs", lambda case: Value(float(case.arm.inputs), 0.0)),
)
_ASKS = {"coverage": "regions", "mean_effort": "targets", "worst_effort": "targets"}
_ROUGH = {"manipulability", "dexterity", "activation_distance", "payload", "compliance"}
"""Objectives without derivatives."""

OBJECTIVES = {
    name: Objective(
        name=name,
        unit=unit,
        meaning=meaning,
        compute=compute,
        asks=_ASKS.get(name, ""),
        smooth=name not in _ROUGH,
    )
    for name, unit, meaning, compute in _ROWS
}
"""Objectives by name, beside the metrics of the atlas."""
