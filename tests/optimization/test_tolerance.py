"""Tolerance of a design: closed forms of moving boundaries, and arms that are really made."""

from functools import cache

import numpy as np
import pytest

from softreach.arm import Base, Manipulator, designs
from softreach.arm.parameters import changed, find_parameter, find_parameters
from softreach.optimization import Tolerance, tolerance
from softreach.optimization.tolerance import Spread, deviations_of
from softreach.requirements import Box, Requirements, Target
from softreach.rod.kinematics import tip_positions
from softreach.support.errors import InvalidInput, NotPossible
from softreach.workspace import reachable_set
from softreach.workspace.gradient import MovingBoundary

TRUNK = designs.minimal_trunk()
NARROW = TRUNK.with_bounds((-0.9, -0.3))
"""One to one, where the trunk itself folds."""
BOTH = pytest.mark.parametrize("arm", [NARROW, TRUNK], ids=["flux", "raster"])
SIGMAS = {"length": 0.003, "taper": 0.001, "left.revolution": 0.02, "left.offset": 0.01}


def boundary(arm: Manipulator, *names: str, accuracy: float = 1e-2) -> tuple[MovingBoundary, float]:
    solid = reachable_set(arm, accuracy=accuracy)
    assert solid.dimension == 3
    known = find_parameters(arm, names)
    return MovingBoundary.of(solid, [known[name] for name in names]), solid.volume


@BOTH
def test_an_arm_twice_as_large_sweeps_three_times_its_volume(arm):
    moving, volume = boundary(arm, "length", "outer_radius")
    sizes = np.array([find_parameter(arm, name).value(arm) for name in ("length", "outer_radius")])
    assert moving.growth @ sizes == pytest.approx(3.0 * volume, rel=0.02)
    # Each triangle as well, by its own flux of the place.
    moves = (moving.swept @ sizes) / moving.area
    assert np.abs(moves).max() < 1.2 * np.linalg.norm(moving.places, axis=1).max()


@BOTH
def test_what_a_shift_of_the_base_loses_at_one_side_it_gains_at_the_other(arm):
    placed = arm.replace(base=Base(position=(0.1, 0.0, 0.0)))
    moving, volume = boundary(placed, "base.position[0]")
    there, back = moving.lost(np.array([[1e-3], [-1e-3]]))
    assert there == pytest.approx(back, rel=0.02)
    assert there > 1e-3 * volume ** (2 / 3)
    assert np.abs(moving.growth[0]) < 0.02 * there / 1e-3


def test_the_mean_of_normal_changes_is_that_of_their_samples():
    moving, _ = boundary(NARROW, *SIGMAS)
    sigmas = np.array([*SIGMAS.values()])
    changes = np.random.default_rng(1).standard_normal((4000, 4)) * sigmas
    lost = moving.lost(changes)
    error = lost.std() / np.sqrt(len(lost))
    assert abs(lost.mean() - moving.mean_lost(sigmas)) < 4.0 * error


@cache
def tolerated(arm: Manipulator, checked: int = 16) -> Tolerance:
    inside = tip_positions(arm, arm.bounds.mean(axis=1)[None])
    box = Box(tuple(inside[0] - 0.1), tuple(inside[0] + 0.1))
    needs = Requirements(targets=(Target(inside, name="middle"), Target(region=box, name="box")))
    return tolerance(arm, SIGMAS, needs, samples=2000, checked=checked, accuracy=3e-2)


@pytest.mark.parametrize(
    "arm", [NARROW, pytest.param(TRUNK, marks=pytest.mark.large)], ids=["flux", "raster"]
)
def test_the_first_order_agrees_with_arms_that_are_made(arm):
    result = tolerated(arm)
    assert result.made == 16
    assert result.impossible == 0
    assert result.kept.agrees
    assert result.volume.agrees
    assert result.targets[0].agrees
    assert 0.5 < result.kept.quantile < result.kept.mean < 1.0


@pytest.mark.large
@BOTH
def test_the_first_order_is_near_ten_thousand_arms(arm):
    half = {name: 0.5 * sigma for name, sigma in SIGMAS.items()}
    result = tolerance(arm, half, samples=10_000, checked=10_000, accuracy=3e-2)
    lost, made = 1.0 - result.kept.mean, 1.0 - result.kept.made_mean
    assert lost == pytest.approx(made, rel=0.1)
    assert 1.0 - result.kept.quantile == pytest.approx(1.0 - result.kept.made_quantile, rel=0.1)
    assert result.volume.deviation == pytest.approx(result.volume.made_deviation, rel=0.05)


def test_what_does_not_deviate_keeps_everything():
    place = tip_positions(NARROW, np.full((1, 3), -0.6))
    needs = Requirements(targets=(Target(place), Target(place + 10.0)))
    result = tolerance(NARROW, {"taper": 0.0}, needs, samples=100, checked=2)
    assert result.kept.mean == result.kept.quantile == result.kept.made_mean == 1.0
    assert result.volume.deviation == result.volume.made_deviation == 0.0
    assert [each.probability[0] for each in result.targets] == [1.0, 0.0]
    assert [each.made[0] for each in result.targets] == [1.0, 0.0]


def test_parameters_that_mirror_each_other_cost_the_same():
    sigmas = {"left.revolution": 0.02, "right.revolution": 0.02}
    result = tolerance(NARROW, sigmas, samples=100, checked=0)
    assert result.costs[0] == pytest.approx(result.costs[1], rel=1e-3)
    assert result.made == 0
    assert not result.agrees


def test_larger_deviations_of_one_parameter_lose_in_proportion():
    each = (tolerance(NARROW, {"taper": s}, samples=100, checked=0) for s in (1e-4, 3e-4))
    few, many = (1.0 - result.kept.mean for result in each)
    assert many == pytest.approx(3.0 * few, rel=1e-6)


def test_it_says_what_costs_most_and_can_be_passed_on():
    result = tolerated(NARROW)
    worst = result.parameters[int(result.costs.argmax())]
    assert f"lost by each alone  {worst}" in repr(result)
    data = result.to_dataset()
    assert data.cost.sel(parameter="taper") == result.costs[result.parameters.index("taper")]
    assert "agrees" in repr(result)
    assert data.sizes["number"] == 4


@pytest.mark.large
def test_arms_that_cannot_exist_are_counted():
    ratio = changed(NARROW, {"rings[0].inner_ratio": 0.995})
    result = tolerance(ratio, {"rings[0].inner_ratio": 0.01}, samples=100, checked=4, accuracy=0.2)
    assert 0 < result.impossible < 4
    assert result.made + result.impossible == 4
    assert "cannot exist" in repr(result)


def test_deviations_add_up_in_parts_that_share_them():
    made = deviations_of(TRUNK, {"lower": 0.1}).made(np.array([0.05]))
    assert made.bounds[:, 0] == pytest.approx(TRUNK.bounds[:, 0] + 0.05)


def test_a_spread_of_normal_numbers_agrees_and_another_one_does_not():
    values = np.random.default_rng(2).normal(3.0, 0.5, 400)
    spread = Spread(name="x", unit="m", nominal=3.0, mean=3.0, deviation=0.5, quantile=2.178)
    assert spread.with_made(values).agrees
    assert not spread.with_made(values + 0.2).agrees
    assert not spread.with_made(3.0 + 2.0 * (values - 3.0)).agrees
    assert spread.with_made(values).made_quantile == pytest.approx(2.178, abs=0.1)


@pytest.mark.parametrize("sigmas", [{}, {"tapper": 0.1}, {"taper": np.nan}], ids=str)
def test_deviations_that_make_no_sense_are_refused(sigmas):
    with pytest.raises(InvalidInput, match=next(iter(sigmas), "none")):
        tolerance(NARROW, sigmas)


def test_fewer_than_three_free_bundles_are_refused():
    held = TRUNK.with_bounds([(-1.0, -1.0), (-1.0, 0.0), (-1.0, 0.0)])
    with pytest.raises(NotPossible, match="three free bundles or more"):
        tolerance(held, {"taper": 0.001})
