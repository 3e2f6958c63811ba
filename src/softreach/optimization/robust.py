"""Objectives of arms as they are made: quantiles to second order, and arms really made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.atlas.metric import MetricFailed
from softreach.optimization.deviations import NORMAL, Deviations, Spread, deviations_of
from softreach.optimization.objectives import SETS, DesignCase, Goal, Objective, Value
from softreach.requirements.requirements import Requirements
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, InvalidInput, no_warnings

__all__ = ["Moments", "margin", "moments", "robust_goals", "spreads_of"]

_ARMS = 200  # made to check what is reported
_POLISHED = (*SETS, "mass")  # whose quantiles are cheap enough to be differentiated again


def robust_goals(goals: Sequence[Goal], sigmas: Mapping[str, float]) -> tuple[Goal, ...]:
    """Goals that 5 % of the arms made are worse than, to second order.

    Args:
        goals: Goals of the design itself.
        sigmas: Parameter -> standard deviation [its unit].
    """
    return tuple(goal._replace(objective=_robust(goal, sigmas)) for goal in goals)


def _robust(goal: Goal, sigmas: Mapping[str, float]) -> Objective:
    own = replace(goal.objective, sigmas=dict(sigmas))
    share = "5 %" if goal.sense > 0.0 else "95 %"
    return replace(
        own,
        nominal=goal.objective,
        meaning=f"{share} quantile of the {own.meaning}",
        compute=partial(_quantile, own, goal.sense),
        smooth=own.smooth and own.name in _POLISHED,
    )


def _quantile(own: Objective, sense: float, case: DesignCase) -> Value:
    value, error = own.compute(case)
    return Value(value - margin(Goal(own, sense), case), error)


class Moments(NamedTuple):
    """Mean and standard deviation of an objective of arms made, to second order."""

    shift: float
    """Mean less the design's own value."""
    deviation: float

    def margin(self, sense: float) -> float:
        """Distance of the 5 % quantile of what is to be large (1), or of -f (-1), from f."""
        return NORMAL * self.deviation - sense * self.shift


def margin(goal: Goal, case: DesignCase) -> float:
    """By how much the quantile of a goal is worse, in its unit, than the design's own value."""
    return goal.sense * moments(goal.objective, case).margin(goal.sense)


@no_warnings()
def moments(objective: Objective, case: DesignCase) -> Moments:
    """Moments by arms one deviation of each parameter away.

    First order alone would take the top of a hill for a place where nothing changes: with slopes s
    and curvatures c per deviation, the mean is f + Σ c / 2 and the variance Σ s² + Σ c² / 2.

    Args:
        objective: With deviations.
        case: The design.

    Raises:
        InvalidDesign: One of these arms cannot exist.
    """
    deviations = deviations_of(case.arm, objective.sigmas)
    compute = (objective.nominal or objective).compute
    value, slopes, curvatures = compute(case).value, [], []
    for change in np.diag(deviations.sigmas):
        if change.any():
            ahead, behind = (
                compute(_with(case, deviations.made(side * change))).value for side in (1, -1)
            )
            slopes.append(0.5 * (ahead - behind))
            curvatures.append(ahead + behind - 2.0 * value)
    variance = np.dot(slopes, slopes) + 0.5 * np.dot(curvatures, curvatures)
    return Moments(0.5 * float(np.sum(curvatures)), math.sqrt(float(variance)))


def _with(case: DesignCase, arm: Manipulator) -> DesignCase:
    """The same questions to another arm."""
    return DesignCase(arm, case.requirements, case.accuracy, case.fine)


def spreads_of(
    goals: Sequence[Goal],
    arm: Manipulator,
    requirements: Requirements,
    accuracy: float,
    sigmas: Mapping[str, float],
    seed: int,
) -> tuple[Spread, ...]:
    """Spread of goals of the design itself: to second order, and of 200 arms made.

    Args:
        goals: Goals of the design itself.
        arm: The design.
        requirements: What some goals are about.
        accuracy: Relative error of volumes.
        sigmas: Parameter -> standard deviation [its unit].
        seed: Of the deviations.
    """
    deviations = deviations_of(arm, sigmas)
    case = DesignCase(arm, requirements, accuracy)
    tasks = (partial(_values, goals, case, deviations, x) for x in deviations.draws(_ARMS, seed))
    made = np.array([*parallel.in_order(tasks)]).reshape(_ARMS, len(goals))
    return tuple(
        _spread(goal, case, sigmas).with_made(column)
        for goal, column in zip(goals, made.T, strict=True)
    )


def _spread(goal: Goal, case: DesignCase, sigmas: Mapping[str, float]) -> Spread:
    nominal = goal.value(case)
    try:
        both = moments(replace(goal.objective, sigmas=dict(sigmas)), case)
    except (InvalidDesign, InvalidInput, MetricFailed):
        both = Moments(math.nan, math.nan)
    return Spread(
        name=goal.name,
        unit=goal.objective.unit,
        nominal=nominal.value,
        mean=nominal.value + both.shift,
        deviation=both.deviation,
        quantile=nominal.value - goal.sense * both.margin(goal.sense),
        error=0.0 if math.isnan(nominal.error) else nominal.error,
        sense=goal.sense,
    )


def _values(
    goals: Sequence[Goal], case: DesignCase, deviations: Deviations, change: Array
) -> list[float]:
    """Goals of an arm that was made; NaN where it cannot exist or has no such number."""
    with parallel.undivided(), no_warnings():
        try:
            made = _with(case, deviations.made(change))
            return [goal.value(made).value for goal in goals]
        except (InvalidDesign, InvalidInput, MetricFailed):
            return [math.nan] * len(goals)
