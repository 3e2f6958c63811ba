"""Objectives of arms as they are made: quantiles to first order, and arms really made."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.atlas.metric import MetricFailed
from softreach.optimization.deviations import NORMAL, Deviations, Spread, deviations_of
from softreach.optimization.objectives import SETS, DesignCase, Goal, Objective, Value
from softreach.requirements.requirements import Requirements
from softreach.support import parallel
from softreach.support.arrays import Array
from softreach.support.errors import InvalidDesign, InvalidInput, no_warnings
from softreach.workspace.gradient import volume_gradient

__all__ = ["margin", "robust_goals", "spreads_of"]

_ARMS = 200  # made to check what is reported
_POLISHED = (*SETS, "mass")  # whose quantiles are cheap enough to be differentiated again


def robust_goals(goals: Sequence[Goal], sigmas: Mapping[str, float]) -> tuple[Goal, ...]:
    """Goals that 5 % of the arms made are worse than, to first order.

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
    return Value(value - sense * margin(own, case), error)


@no_warnings()
def margin(objective: Objective, case: DesignCase) -> float:
    """Distance of the quantile from the design's own value, 1.645 ‖σ ∇f‖.

    Args:
        objective: With deviations.
        case: The design.
    """
    deviations = deviations_of(case.arm, objective.sigmas)
    if objective.name in SETS:
        gradient = volume_gradient(case.arm, deviations.names, accuracy=case.accuracy)
        slopes = getattr(gradient, SETS[objective.name]) * deviations.sigmas
    else:
        slopes = [
            _half_change(objective, case, deviations, k) for k in range(len(deviations.sigmas))
        ]
    return NORMAL * float(np.linalg.norm(slopes))


def _half_change(objective: Objective, case: DesignCase, deviations: Deviations, k: int) -> float:
    """Change of an objective by one deviation of a parameter: half of that by two."""
    change = np.eye(len(deviations.sigmas))[k] * deviations.sigmas
    if not change.any():
        return 0.0
    compute = (objective.nominal or objective).compute
    ends = [compute(_with(case, deviations.made(side * change))).value for side in (1, -1)]
    return 0.5 * (ends[0] - ends[1])


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
    """Spread of goals of the design itself: to first order, and of 200 arms made.

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
        away = margin(replace(goal.objective, sigmas=dict(sigmas)), case)
    except (InvalidDesign, InvalidInput, MetricFailed):
        away = math.nan
    return Spread(
        name=goal.name,
        unit=goal.objective.unit,
        nominal=nominal.value,
        mean=nominal.value,
        deviation=away / NORMAL,
        quantile=nominal.value - goal.sense * away,
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
