"""Values and derivatives of a polish against differences."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.optimization.free_parameters import free_parameters
from softreach.optimization.polish import point_of
from softreach.optimization.problem import Problem, goals
from softreach.optimization.program import DesignPoint, Point, stacked, stacked_slopes
from softreach.requirements import Box, Keep, Limits, Requirements, Sphere, Target

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


def problem(needs, free=FREE, **options):
    """A problem of the arm."""
    return Problem(
        parameters=free_parameters(ARM, free),
        requirements=needs,
        goals=goals(options.get("maximize", ()), options.get("minimize", ()), needs),
        accuracy=0.01,
        coarse=0.03,
    )


def moved(point: Point, unknowns):
    """The same program at other unknowns."""
    count = len(point.reals)
    parameters = point.design.problem.parameters
    low, high = parameters.bounds.T
    values = parameters.moved(point.design.values, low + unknowns[:count] * (high - low))
    design = DesignPoint(
        point.design.problem, values, point.design.accuracy, like=point.design.rods
    )
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
    of = Problem(
        parameters=free_parameters(arm, {"taper": (0.0, 0.05)}),
        requirements=needs,
        goals=goals("coverage", (), needs),
        accuracy=0.1,
        coarse=0.1,
    )
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
