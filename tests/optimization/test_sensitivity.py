"""Sensitivity: against closed forms, differences, and optima of shifted requirements."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from softreach.arm import Material, designs
from softreach.arm.parameters import changed, find_parameter
from softreach.arm.summary import mass
from softreach.optimization import sensitivity
from softreach.optimization.free_parameters import free_parameters
from softreach.optimization.objectives import DesignCase, Objective, Value, goals
from softreach.optimization.problem import Candidate, Problem
from softreach.optimization.robust import moments, robust_goals, spreads_of
from softreach.optimization.sensitivity import variance_shares
from softreach.requirements import Limits, Requirements, Target
from softreach.rod.kinematics import tip_positions
from softreach.sampling import sample_cube
from softreach.support.errors import InvalidInput
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


def test_indices_of_a_sum_are_shares_of_its_variances():
    cube = sample_cube("sobol", 1024, 4, 1)
    a, b = cube[:, :2], cube[:, 2:]
    mixed = [np.stack([b[:, 0], a[:, 1]], 1), np.stack([a[:, 0], b[:, 1]], 1)]
    values = np.array([x @ [2.0, 1.0] for x in (a, b, *mixed)])
    shares = variance_shares(values)
    expected = np.array([0.8, 0.2])
    for got, error in ((shares.first, shares.first_error), (shares.total, shares.total_error)):
        assert (np.abs(got - expected) < np.maximum(3.0 * error, 0.02)).all()
        assert (error < 0.2).all()


def test_designs_that_cannot_exist_are_replaced_and_counted():
    asked = problem({"rings[0].inner_ratio": (0.5, 0.9), "taper": (0.0, 0.12)}, maximize="mass")
    best = Candidate(values={"rings[0].inner_ratio": 0.7, "taper": 0.01})
    (shares,) = sensitivity(asked, best, n=16).variance
    assert shares is not None
    assert shares.rows == 16
    assert shares.replaced > 0
    assert shares.total[1] > 0.5
    assert shares.total[0] == pytest.approx(0.0, abs=1e-9)


def test_a_robust_goal_is_worse_by_what_its_slope_tells():
    sigmas = {"taper": 1e-5, "left.revolution": 2e-4}
    (goal,) = goals("exact_volume", (), Requirements())
    (robust,) = robust_goals([goal], sigmas)
    case = DesignCase(ARM, Requirements(), 1e-2)
    slopes = volume_gradient(ARM, [*sigmas], accuracy=1e-2).volume * [*sigmas.values()]
    loss = goal.value(case).value - robust.value(case).value
    assert loss == pytest.approx(1.6448536 * np.linalg.norm(slopes), rel=1e-3)
    assert robust.objective.sigmas == sigmas


@pytest.mark.parametrize("way", ["maximize", "minimize"])
def test_a_robust_goal_is_the_quantile_of_arms_that_are_made(way):
    asked = {"maximize": (), "minimize": (), way: "mass"}
    plain = goals(asked["maximize"], asked["minimize"], Requirements())
    sigmas = {"outer_radius": 0.05 * find_parameter(ARM, "outer_radius").value(ARM)}
    (spread,) = spreads_of(plain, ARM, Requirements(), 1e-2, sigmas, 3)
    (robust,) = robust_goals(plain, sigmas)
    case = DesignCase(ARM, Requirements(), 1e-2)
    assert robust.value(case).value == pytest.approx(spread.quantile)
    assert abs(spread.quantile - spread.made_quantile) < 4.0 * spread.quantile_error
    assert (spread.quantile < spread.nominal) == (way == "maximize")
    assert spread.agrees


def test_a_robust_goal_sees_the_curvature_where_there_is_no_slope():
    hill = Objective(
        name="hill",
        unit="1",
        meaning="a hill",
        compute=lambda case: Value(-((case.arm.length - ARM.length) ** 2)),
        sigmas={"length": 0.1},
    )
    both = moments(hill, DesignCase(ARM, Requirements(), 1e-2))
    # Of -x² with x of σ: mean -σ², standard deviation √2 σ².
    assert both.shift == pytest.approx(-0.01)
    assert both.deviation == pytest.approx(np.sqrt(2.0) * 0.01)


def test_a_problem_needs_a_design_and_rows_a_power_of_two():
    asked = problem({"taper": (0.0, 0.02)}, maximize="mass")
    with pytest.raises(InvalidInput, match="candidate"):
        sensitivity(asked)
    with pytest.raises(InvalidInput, match="power of two"):
        sensitivity(asked, Candidate(values={"taper": 0.01}), n=12)
