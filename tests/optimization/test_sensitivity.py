"""Sensitivity: against closed forms, differences, and optima of shifted requirements."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from softreach.arm import Material, designs
from softreach.arm.body import mass
from softreach.arm.parameters import changed, find_parameter
from softreach.optimization import sensitivity
from softreach.optimization.free_parameters import free_parameters
from softreach.optimization.objectives import DesignCase, Goal, Objective, Value, goals
from softreach.optimization.problem import Candidate, Problem
from softreach.requirements import Limits, Requirements, Target
from softreach.rod.kinematics import tip_positions
from softreach.support.errors import InvalidInput, NotPossible
from softreach.workspace import reachable_set, volume_gradient

ARM = designs.minimal_trunk(material=Material(young_modulus=1e6, density=1000.0)).with_bounds(
    (-0.9, -0.3)
)
"""One to one: its volume is exact."""


def problem(free, needs=None, maximize=(), minimize=(), accuracy=1e-2) -> Problem:
    needs = needs or Requirements()
    return Problem(
        parameters=free_parameters(ARM, free),
        requirements=needs,
        goals=goals(maximize, minimize, needs),
        accuracy=accuracy,
        coarse=0.05,
    )


def test_a_multiplier_is_the_derivative_of_the_optimum_by_its_requirement():
    radius = find_parameter(ARM, "outer_radius").value(ARM)
    ends = (0.95 * radius, 1.05 * radius)
    limit = mass(ARM)

    def best(most):
        size: Any = brentq(lambda r: mass(changed(ARM, {"outer_radius": r})) - most, *ends)
        return reachable_set(changed(ARM, {"outer_radius": size})).volume

    # The volume falls as the arm becomes thicker: the least is where its mass ends.
    needs = Requirements(limits=Limits(mass=limit))
    asked = problem({"outer_radius": ends}, needs, minimize="exact_volume")
    result = sensitivity(asked, Candidate(values={"outer_radius": radius}), n=0)
    (multiplier,) = result.multipliers
    expected = (best(1.01 * limit) - best(0.99 * limit)) / (0.02 * limit)
    assert multiplier.name == "mass"
    assert multiplier.value == pytest.approx(-expected, rel=1e-3)
    assert result.residual < 1e-6


def test_an_end_of_a_range_decides_where_nothing_else_does():
    value = find_parameter(ARM, "taper").value(ARM)
    asked = problem({"taper": (value, value + 0.01)}, minimize="exact_volume")
    result = sensitivity(asked, Candidate(values={"taper": value}), n=0)
    slope = volume_gradient(ARM, "taper").volume[0]
    names = [each.name for each in result.multipliers]
    assert names == (["low end of taper"] if slope > 0 else [])
    assert result.gradient[0, 0] == pytest.approx(slope, rel=1e-3)


def test_a_target_on_the_boundary_decides_by_one_number():
    place = tip_positions(ARM, [[-0.9, -0.5, -0.6]])
    needs = Requirements(targets=(Target(place),))
    asked = problem({"length": (0.9, 1.1)}, needs, minimize="mean_effort")
    result = sensitivity(asked, Candidate(values={"length": ARM.length}), n=0)
    assert "place 1" in {each.name for each in result.multipliers}
    assert all(each.value > 0.0 for each in result.multipliers)


def test_effort_is_differentiated_with_poses_that_follow():
    place = tip_positions(ARM, [[-0.7, -0.5, -0.6]])
    needs = Requirements(targets=(Target(place),))
    asked = problem({"length": (0.9, 1.1)}, needs, minimize="mean_effort")
    result = sensitivity(asked, Candidate(values={"length": ARM.length}), n=0)
    step = 1e-3
    ends = [
        DesignCase(changed(ARM, {"length": ARM.length + side}), needs, 1e-2).check.effort.mean()
        for side in (-step, step)
    ]
    assert result.gradient[0, 0] == pytest.approx((ends[1] - ends[0]) / (2 * step), rel=1e-3)


def of_design(name, compute):
    """A goal that is a function of the arm."""
    return Goal(
        Objective(name=name, unit="1", meaning="", compute=lambda case: compute(case.arm)), 1.0
    )


def test_indices_of_a_sum_are_shares_of_its_variances():
    ends = {"length": (0.9, 1.1), "taper": (0.0, 0.01)}
    known = {name: find_parameter(ARM, name) for name in ends}

    def total(arm):
        first, second = (
            (known[name].value(arm) - low) / (high - low) for name, (low, high) in ends.items()
        )
        return Value(2.0 * first + second)

    asked = replace(
        problem(ends), goals=(of_design("sum", total), of_design("1", lambda _: Value(1.0)))
    )
    best = Candidate(values={"length": 1.0, "taper": 0.005})
    shares, constant = sensitivity(asked, best, n=256).variance
    expected = np.array([0.8, 0.2])
    for got, error in ((shares.first, shares.first_error), (shares.total, shares.total_error)):
        assert (np.abs(got - expected) < np.maximum(3.0 * error, 0.02)).all()
        assert (error < 0.2).all()
    assert not constant.total.any()


def test_all_variance_is_that_of_the_only_parameter():
    best = Candidate(values={"taper": 0.01})
    (shares,) = sensitivity(problem({"taper": (0.0, 0.02)}, maximize="mass"), best, n=64).variance
    assert shares.total == pytest.approx(1.0, abs=0.05)


def test_no_shares_are_said_of_ranges_in_which_a_design_cannot_exist():
    asked = problem({"rings[0].inner_ratio": (0.5, 0.9), "taper": (0.0, 0.12)}, maximize="mass")
    best = Candidate(values={"rings[0].inner_ratio": 0.7, "taper": 0.01})
    assert sensitivity(asked, best, n=16).variance == (None,)
    existing = replace(
        asked,
        parameters=free_parameters(ARM, {"rings[0].inner_ratio": (0.5, 0.9), "taper": (0.0, 0.02)}),
    )
    (shares,) = sensitivity(existing, best, n=16).variance
    assert shares.total[1] > 0.5
    assert shares.total[0] == pytest.approx(0.0, abs=1e-9)


def test_a_problem_needs_a_design_and_rows_a_power_of_two():
    asked = problem({"taper": (0.0, 0.02)}, maximize="mass")
    with pytest.raises(NotPossible, match="candidate"):
        sensitivity(asked)
    with pytest.raises(InvalidInput, match="power of two"):
        sensitivity(asked, Candidate(values={"taper": 0.01}), n=12)
