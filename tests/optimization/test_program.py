"""The program of a design: derivatives against differences, and what they say of an optimum."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import softreach as sr
from softreach.arm.body import mass
from softreach.arm.parameters import changed, find_parameter
from softreach.optimization import sensitivity
from softreach.optimization.free_parameters import free_parameters
from softreach.optimization.polish import point_of
from softreach.optimization.problem import Candidate, DesignCase, Goal, Objective, Problem, goals
from softreach.optimization.program import DesignPoint, Point, stacked, stacked_slopes
from softreach.requirements import Box, Keep, Limits, Requirements, Sphere, Target
from softreach.support.errors import InvalidInput, NotPossible
from softreach.workspace import volume_gradient
from softreach.workspace.measure import Estimate

ARM = sr.designs.minimal_trunk(revolution=np.radians(40), taper=np.radians(2))
PLACES = sr.tip_positions(ARM, [[-0.4, -0.7, -0.2], [-0.9, -0.2, -0.6]])
FREE = {
    "taper": (0.0, 0.05),
    "left.revolution": (-1.5, -0.2),
    "right.revolution": "-left.revolution",
    "lower": (-2.0, -1.0),
}
NEEDS = Requirements(
    targets=[Target(PLACES[:1]), Target(PLACES[1:] + 0.002, within=0.01)],
    keeps=[
        Keep(Box((-2, -2, -0.2), (2, 2, 1.02)), inside=True, of="arm"),
        Keep(Sphere(tuple(PLACES[0] + (0.0, 0.0, 0.2)), 0.12), inside=False, of="tip"),
    ],
    limits=Limits(shortening=0.45, bending=0.4),
)


def problem(needs, free=FREE, arm=ARM, coarse=0.03, **options):
    """A problem of the arm."""
    return Problem(
        parameters=free_parameters(arm, free),
        requirements=needs,
        goals=goals(options.get("maximize", ()), options.get("minimize", ()), needs),
        accuracy=0.01,
        coarse=coarse,
    )


def moved(point: Point, unknowns):
    """The same program at other unknowns."""
    count = len(point.reals)
    parameters = point.design.problem.parameters
    low, high = parameters.bounds.T
    values = parameters.moved(point.design.values, low + unknowns[:count] * (high - low))
    of = point.design
    design = DesignPoint(of.problem, values, of.accuracy, like=of.rods)
    poses = unknowns[count:].reshape(point.poses.shape)
    return Point(design, unknowns[:count], poses, point.goal, point.floors)


def differences(point: Point, value, step=1e-4):
    """Derivatives of fourth order of some values by all unknowns."""
    at = np.concatenate([point.reals, point.poses.ravel()])
    columns = []
    for k in range(len(at)):
        total = 0.0
        for offset, weight in ((-2, 1 / 12), (-1, -8 / 12), (1, 8 / 12), (2, -1 / 12)):
            other = at.copy()
            other[k] += offset * step
            total = total + weight * np.asarray(value(moved(point, other))) / step
        columns.append(total)
    return np.stack(columns, axis=-1)


@pytest.fixture(scope="module")
def start():
    """Where the program of two places is differentiated."""
    of = problem(NEEDS, minimize="mean_effort")
    candidate = of.judge(of.parameters.start())
    return point_of(of, candidate, 0.03)


@pytest.mark.parametrize("name", ["mean_effort", "worst_effort"])
def test_efforts_are_differentiated_to_a_millionth(name):
    of = problem(NEEDS, minimize=name)
    point = point_of(of, of.judge(of.parameters.start()), 0.03)
    wanted = differences(point, lambda each: each.cost)
    np.testing.assert_allclose(point.cost_slope, wanted, atol=1e-6 * np.abs(wanted).max())


def test_tips_at_the_places_are_differentiated_to_a_millionth(start):
    wanted = differences(start, lambda each: stacked(each.equations))
    slopes = stacked_slopes(start.equations)
    np.testing.assert_allclose(slopes, wanted, atol=1e-6 * np.abs(wanted).max())


def test_rooms_are_differentiated(start):
    wanted = differences(start, lambda each: stacked(each.inequalities))
    slopes, near = stacked_slopes(start.inequalities), stacked(start.inequalities) < 0.1
    assert near.sum() > 6
    np.testing.assert_allclose(slopes[near], wanted[near], atol=2e-4 * np.abs(wanted).max())


def test_coverage_of_a_region_is_differentiated_by_what_the_boundary_sweeps(monkeypatch):
    # as many places as the differences need
    monkeypatch.setattr("softreach.optimization.program._PLACES", 1 << 16)
    needs = Requirements(targets=[Target(region=Sphere(tuple(PLACES[0]), 0.3), share=0.1)])
    of = problem(needs, {"length": (0.8, 1.2), "lower": (-2.0, -1.0)}, maximize="coverage")
    values = {"length": 1.0, "lower": -5.0 / 3.0}
    design = DesignPoint(of, values, 0.003)
    share, slopes = design.value("coverage"), design.slope("coverage")
    assert 0.1 < share < 0.95
    for k, (name, step) in enumerate((("length", 0.02), ("lower", 0.1))):
        ends = [DesignPoint(of, values | {name: values[name] + s}, 0.003) for s in (step, -step)]
        there, back = (end.value("coverage") for end in ends)
        wanted = (there - back) / (2 * step) * np.ptp(of.parameters.bounds[k])
        assert slopes[k] == pytest.approx(wanted, abs=0.05 * np.abs(slopes).max())


def test_poses_and_shares_are_those_of_the_arm_under_each_payload():
    rubber = sr.Material(young_modulus=1e6, density=1000.0)
    arm = sr.designs.minimal_trunk(length=0.3, material=rubber)
    needs = Requirements(targets=[Target(region=Sphere((0, 0, 0.2), 0.1))], payloads=(0.0, 0.1))
    of = problem(needs, {"taper": (0.0, 0.05)}, arm, 0.1, maximize="coverage")
    design = DesignPoint(of, {"taper": 0.01}, 0.1)
    gamma = np.array([[-0.4, -0.7, -0.2]])
    for rod, payload in zip(design.rods, needs.payloads, strict=True):
        loads = sr.Loads(payload=payload) if payload else None
        expected = sr.tip_positions(design.case.arm.replace(loads=loads), gamma)
        np.testing.assert_allclose(rod.tips(gamma), expected, atol=1e-6)
    checked = [each.share for each in design.case.check.coverages]
    shares = [design.share(number, needs.targets[0].region) for number in range(2)]
    assert shares[0] != shares[1]
    np.testing.assert_allclose(shares, checked, atol=0.15)


NARROW = sr.designs.minimal_trunk(
    material=sr.Material(young_modulus=1e6, density=1000.0)
).with_bounds((-0.9, -0.3))
"""One to one: its volume is exact."""


def within(free, needs=None, **options):
    """A problem of the narrow arm."""
    return problem(needs or Requirements(), free, NARROW, coarse=0.05, **options)


def test_a_multiplier_is_the_derivative_of_the_optimum_by_its_requirement():
    radius = find_parameter(NARROW, "outer_radius").value(NARROW)
    ends = (0.95 * radius, 1.05 * radius)
    limit = mass(NARROW)

    def best(most):
        size: Any = brentq(lambda r: mass(changed(NARROW, {"outer_radius": r})) - most, *ends)
        return sr.reachable_set(changed(NARROW, {"outer_radius": size})).volume

    # The volume falls as the arm becomes thicker: the least is where its mass ends.
    needs = Requirements(limits=Limits(mass=limit))
    asked = within({"outer_radius": ends}, needs, minimize="exact_volume")
    result = sensitivity(asked, Candidate(values={"outer_radius": radius}), n=0)
    (multiplier,) = result.multipliers
    expected = (best(1.01 * limit) - best(0.99 * limit)) / (0.02 * limit)
    assert multiplier.name == "mass"
    assert multiplier.value == pytest.approx(-expected, rel=1e-3)
    assert result.residual < 1e-6


def test_an_end_of_a_range_decides_where_nothing_else_does():
    value = find_parameter(NARROW, "taper").value(NARROW)
    asked = within({"taper": (value, value + 0.01)}, minimize="exact_volume")
    result = sensitivity(asked, Candidate(values={"taper": value}), n=0)
    slope = volume_gradient(NARROW, "taper").volume[0]
    names = [each.name for each in result.multipliers]
    assert names == (["low end of taper"] if slope > 0 else [])
    assert result.gradient[0, 0] == pytest.approx(slope, rel=1e-3)


def test_a_target_on_the_boundary_decides_by_one_number():
    place = sr.tip_positions(NARROW, [[-0.9, -0.5, -0.6]])
    needs = Requirements(targets=(Target(place),))
    asked = within({"length": (0.9, 1.1)}, needs, minimize="mean_effort")
    result = sensitivity(asked, Candidate(values={"length": NARROW.length}), n=0)
    assert "place 1" in {each.name for each in result.multipliers}
    assert all(each.value > 0.0 for each in result.multipliers)


def test_effort_is_differentiated_with_poses_that_follow():
    place = sr.tip_positions(NARROW, [[-0.7, -0.5, -0.6]])
    needs = Requirements(targets=(Target(place),))
    asked = within({"length": (0.9, 1.1)}, needs, minimize="mean_effort")
    result = sensitivity(asked, Candidate(values={"length": NARROW.length}), n=0)
    step = 1e-3
    arms = (changed(NARROW, {"length": NARROW.length + side}) for side in (-step, step))
    back, there = (DesignCase(arm, needs, 1e-2).check.effort.mean() for arm in arms)
    assert result.gradient[0, 0] == pytest.approx((there - back) / (2 * step), rel=1e-3)


def of_design(name, compute):
    """A goal that is a function of the arm."""
    return Goal(Objective(name, "1", "", lambda case: compute(case.arm), smooth=False), 1.0)


def test_indices_of_a_sum_are_shares_of_its_variances():
    ends = {"length": (0.9, 1.1), "taper": (0.0, 0.01)}
    known = {name: find_parameter(NARROW, name) for name in ends}

    def total(arm):
        pairs = ((known[name].value(arm), *own) for name, own in ends.items())
        first, second = ((value - low) / (high - low) for value, low, high in pairs)
        return Estimate(2.0 * first + second)

    both = of_design("sum", total), of_design("1", lambda _: Estimate(1.0))
    asked = replace(within(ends), goals=both)
    best = Candidate(values={"length": 1.0, "taper": 0.005})
    shares, constant = sensitivity(asked, best, n=256).variance
    expected = np.array([0.8, 0.2])
    for got, error in ((shares.first, shares.first_error), (shares.total, shares.total_error)):
        assert (np.abs(got - expected) < np.maximum(3.0 * error, 0.02)).all()
        assert (error < 0.2).all()
    assert not constant.total.any()


def test_no_shares_are_said_of_ranges_in_which_a_design_cannot_exist():
    asked = within({"rings[0].inner_ratio": (0.5, 0.9), "taper": (0.0, 0.12)}, maximize="mass")
    best = Candidate(values={"rings[0].inner_ratio": 0.7, "taper": 0.01})
    assert sensitivity(asked, best, n=16).variance == (None,)
    ends = {"rings[0].inner_ratio": (0.5, 0.9), "taper": (0.0, 0.02)}
    existing = replace(asked, parameters=free_parameters(NARROW, ends))
    (shares,) = sensitivity(existing, best, n=16).variance
    assert shares.total[1] > 0.5
    assert shares.total[0] == pytest.approx(0.0, abs=1e-9)


def test_a_problem_needs_a_design_and_rows_a_power_of_two():
    asked = within({"taper": (0.0, 0.02)}, maximize="mass")
    with pytest.raises(NotPossible, match="candidate"):
        sensitivity(asked)
    with pytest.raises(InvalidInput, match="power of two"):
        sensitivity(asked, Candidate(values={"taper": 0.01}), n=12)


def test_the_same_seed_gives_the_same_error_bars():
    asked = within({"taper": (0.0, 0.02), "length": (0.9, 1.1)}, maximize="mass")
    best = Candidate(values={"taper": 0.01, "length": 1.0})
    (one,), (other,), (third,) = (sensitivity(asked, best, n=4, seed=s).variance for s in (5, 5, 6))
    for name in one._fields:
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
    assert (one.total_error != third.total_error).any()
