"""Laws of the steps: their order, and a tolerance that no activation exceeds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.arm import FiberArchitecture, designs
from softreach.kernels.rod import tips as rod
from softreach.rod.free import FreeRod
from softreach.support.errors import InvalidInput
from tests.laws import arm_of, arms, in_box


@pytest.mark.parametrize("taper", [-0.05, 0.0, 0.02, 0.05])
def test_the_error_falls_with_the_sixth_power_of_the_steps(taper):
    arm = designs.minimal_trunk(taper=taper)
    gamma = in_box(arm, 50)
    rule = FreeRod(arm).rule

    def tips(steps):
        out = np.empty((len(gamma), 3))
        rod.tips(rule.packed(rule.edges(steps)), gamma, out)
        return out

    exact, steps = tips(256), [16, 20, 24, 28, 32]
    errors = [np.abs(tips(k) - exact).max() for k in steps]
    order = -np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 5.7 < order < 6.6


@given(arm=arms())
def test_a_smaller_tolerance_takes_no_fewer_steps(arm):
    steps = [FreeRod(arm, tol).steps for tol in (1e-3, 1e-5, 1e-7, 1e-9)]
    assert steps == sorted(steps)


@given(arm=arms(), factor=st.floats(0.01, 100))
def test_the_size_of_an_arm_does_not_change_its_steps(arm, factor):
    lengths = {name: factor * getattr(arm.profile, name) for name in ("length", "outer_radius")}
    scaled = arm.replace(profile=arm.profile.replace(**lengths))
    assert abs(FreeRod(scaled).steps - FreeRod(arm).steps) <= 1  # rounding at a threshold


@given(arm=arms())
def test_a_grid_with_given_stations_has_no_longer_steps(arm):
    rule = FreeRod(arm).rule
    stations = arm.length * np.array([0.0, 0.11, 0.11, 0.5, 0.93])
    edges = rule.edges(7, stations)
    measure, ends = rule.nodes(edges)[0], rule.packed_stations(stations, 7)[1]
    reached = [measure[:end].sum(axis=0) @ [5 / 18, 8 / 18, 5 / 18] for end in ends]
    np.testing.assert_allclose(reached, stations, atol=1e-6 * arm.length)  # Gauss's rule
    assert len(measure) == ends[-1]
    starts = np.concatenate([[0], np.cumsum(measure @ [5 / 18, 8 / 18, 5 / 18])])
    widths = np.diff(arm.profile.slender_coordinate(starts))
    assert (widths <= arm.profile.slender_length / 7 * (1 + 1e-6)).all()


def test_steps_beyond_the_largest_number_are_refused_with_what_to_do(trunk, monkeypatch):
    monkeypatch.setattr("softreach.rod.steps._MOST_STEPS", 8)
    with pytest.raises(InvalidInput, match="reachable within 8 steps; use a larger one"):
        FreeRod(trunk).steps  # noqa: B018


def families(bundles, seed):
    """An arm of many narrow bundles, longitudinal and helical, and bounds of both signs."""
    rng = np.random.default_rng(seed)
    each = {12: 3, 24: 4, 60: 6}[bundles]
    fibers = tuple(
        FiberArchitecture(
            revolution=rng.choice([0.0, rng.uniform(-3, 3)]),
            offset=rng.uniform(0, 2 * np.pi),
            extent=rng.uniform(1, 3) / bundles,
            bundles=each,
        )
        for _ in range(bundles // each)
    )
    bounds = np.sort(rng.uniform(-1.0, 0.6, (bundles, 2)), axis=1)
    return arm_of(*fibers, taper=rng.uniform(0, 0.05), activation_bounds=bounds)


def tip_error(arm, tol):
    """(activations) -> distances [L] from the tips with four times as many steps."""
    found = FreeRod(arm, tol)
    exact = found.rule.packed(found.rule.edges(4 * found.steps + 16))

    def error(gamma):
        truth = np.empty((len(gamma), 3))
        rod.tips(exact, gamma, truth)
        return np.linalg.norm(found.tips(gamma) - truth, axis=1) / arm.length

    return error


def shape_error(arm, tol):
    """(activations) -> largest distances [L] along the centerlines of much finer ones."""
    found, exact = FreeRod(arm, tol), FreeRod(arm, 1e-3 * tol)
    stations = np.linspace(0, arm.length, 12)[1:]

    def error(gamma):
        apart = found.frames(gamma, stations).position - exact.frames(gamma, stations).position
        return np.linalg.norm(apart, axis=-1).max(axis=1) / arm.length

    return error


def largest_found(arm, error, starts=4, rounds=40, seed=0):
    """The largest error that flips of single bundles find, from random corners uphill."""
    rng = np.random.default_rng(seed)
    low, high = arm.bounds.T
    largest = 0.0
    for _ in range(starts):
        upper = rng.random(arm.bundles) < rng.random()
        here = error(np.where(upper, high, low)[None])[0]
        for _ in range(rounds):
            flipped = upper ^ np.eye(arm.bundles, dtype=bool)
            errors = error(np.where(flipped, high, low))
            if errors.max() <= here:
                break
            here, upper = errors.max(), flipped[errors.argmax()]
        largest = max(largest, here)
    return largest


@pytest.mark.parametrize("tol", [1e-5, 1e-9])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("bundles", [12, 24, 60])
def test_no_corner_that_a_search_finds_exceeds_the_tolerance(bundles, seed, tol):
    arm = families(bundles, seed)
    assert largest_found(arm, tip_error(arm, tol)) <= tol


@pytest.mark.parametrize("bundles", [12, 24, 60])
def test_nor_does_any_place_along_the_arm(bundles):
    arm = families(bundles, seed=5)
    assert largest_found(arm, shape_error(arm, 1e-6), starts=2) <= 1e-6


def test_bundles_that_all_bend_one_way_keep_the_tolerance():
    """Ten families of six longitudinal bundles: chance alone never draws their worst corner."""
    fibers = tuple(
        FiberArchitecture(helical_angle=0.0, extent=0.1, offset=2 * np.pi * k / 60, bundles=6)
        for k in range(10)
    )
    arm = arm_of(*fibers, activation_bounds=(-0.5, 0.5))
    angles = arm.outline(0.0).center[0]
    gamma = np.where(np.cos(angles - 0.3) > 0, 0.5, -0.5)[None]
    assert tip_error(arm, 1e-9)(gamma).max() <= 1e-9
    assert largest_found(arm, tip_error(arm, 1e-9), starts=2) <= 1e-9
    assert shape_error(arm, 1e-7)(gamma).max() <= 1e-7
