"""The one function that makes a tip map of an arm."""

from __future__ import annotations

import gc

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Loads, designs
from softreach.rod import tip_positions
from softreach.rod.free import FreeRod
from softreach.rod.inputs import activation_measures
from softreach.rod.rods import as_tip_map, free_bundles, in_steps, measured_bundles
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.bodies import rubber
from tests.inverse.test_units import CHAMBER, TENDONS, arm_of
from tests.laws import in_box


def test_equal_arms_and_tolerances_share_one_tip_map(trunk):
    rod = as_tip_map(trunk, 1e-7)
    assert as_tip_map(designs.minimal_trunk(), np.float64(1e-7)) is rod
    assert as_tip_map(rod) is as_tip_map(rod, 1e-3) is rod
    assert rod.rod == FreeRod(trunk, 1e-7)
    assert as_tip_map(trunk, 1e-8) is not rod
    assert as_tip_map(trunk.with_bounds((-1, 0)), 1e-7) is not rod


@pytest.mark.parametrize("loads", [None, Loads(payload=0.1)])
def test_maps_in_other_steps_are_other_maps(trunk, loads):
    arm = rubber(trunk, loads)
    rod, gamma = as_tip_map(arm), in_box(arm, 20)
    coarse = in_steps(arm, 3, rod)
    assert coarse != rod
    assert coarse == in_steps(arm, 3, rod)
    assert hash(coarse) == hash(in_steps(arm, 3, rod))
    apart = np.linalg.norm(coarse.tips(gamma) - rod.tips(gamma), axis=1)
    assert rod.tol * rod.length < apart.max() < 1e-2 * rod.length


def test_what_is_remembered_is_computed_once(trunk, monkeypatch):
    rod = as_tip_map(trunk, 3e-7)
    before = rod.tips([[-1.0, 0.0, -0.5]])

    def never(*_):
        raise AssertionError

    monkeypatch.setattr("softreach.rod.steps.tables", never)
    np.testing.assert_array_equal(tip_positions(trunk, [[-1.0, 0.0, -0.5]], 3e-7), before)


def test_many_arms_are_not_all_kept():
    for k in range(70):
        as_tip_map(designs.minimal_trunk(length=800.0 + k))
    gc.collect()
    kept = [one for one in gc.get_objects() if type(one) is FreeRod and one.length >= 800.0]
    assert len(kept) <= 64


@pytest.mark.parametrize("arm", [None, "trunk", 3.0, FreeRod])
def test_what_is_no_arm_is_refused(arm):
    with pytest.raises(InvalidInput, match="must be a Manipulator or a TipMap"):
        as_tip_map(arm)


def test_of_a_path_the_refusal_says_how_to_open_it(tmp_path):
    for path in ("arm.toml", tmp_path / "arm.toml"):
        for ask in (as_tip_map, sr.reachable_set, sr.describe):
            with pytest.raises(InvalidInput, match=r"; softreach\.Manipulator\.load opens"):
                ask(path)


def test_a_dataset_that_is_no_arm_is_named_and_not_printed(trunk):
    shape = sr.configuration(trunk, np.zeros(trunk.inputs))
    with pytest.raises(InvalidInput, match=r"^arm = <xarray\.Dataset> Size: \d+kB: must be a"):
        as_tip_map(shape)


def test_an_arm_beyond_the_theory_is_refused_every_time(trunk):
    for _ in range(2):
        with pytest.raises(InvalidDesign, match="must keep ζ > 0"):
            as_tip_map(trunk.with_bounds((-9.0, 0.0)))


# Activations of different units are compared in their own ranges


@pytest.mark.parametrize(
    ("arm", "measures"),
    [
        (designs.minimal_trunk(), [1, 1, 1]),
        (arm_of(TENDONS).with_bounds(((0, 8), (0, 4), (0, 2))), [8, 8, 8]),
        (arm_of(TENDONS, CHAMBER), [8, 8, 8, 5e4]),
    ],
    ids=["strains as they are", "one unit in proportion", "different units in their ranges"],
)
def test_activations_are_counted_in_their_measures(arm, measures):
    np.testing.assert_array_equal(activation_measures(arm), measures)
    of_strains = measured_bundles(as_tip_map(arm)) is as_tip_map(arm)
    assert of_strains == (max(measures) == 1)


@pytest.mark.parametrize("loads", [None, Loads(gravity=(0, 0, 0), tip_force=(0.02, 0, 0))])
def test_the_map_of_free_bundles_in_other_measures_is_the_same(loads):
    arm = arm_of(TENDONS, CHAMBER).with_bounds(((0, 8), (0, 4), (3, 3), (0, 5e4)))
    whole, free = as_tip_map(arm.replace(loads=loads)), [0, 1, 3]
    restricted, gamma = free_bundles(measured_bundles(whole)), in_box(arm, 20)
    measures = activation_measures(arm)[free]
    shares = gamma[:, free] / measures
    assert restricted.supports_unstable == (loads is not None)
    np.testing.assert_array_equal(restricted.status(shares), whole.status(gamma))
    np.testing.assert_allclose(restricted.tips(shares), whole.tips(gamma), atol=1e-12)
    slopes = whole.tips_and_slopes(gamma)[1][..., free] * measures
    np.testing.assert_allclose(restricted.tips_and_slopes(shares)[1], slopes, atol=1e-12)
    assert (restricted.box.widths <= 1.0).all()
    assert (activation_measures(arm) > 0).all()  # that of the held bundle, too


def test_a_large_unit_does_not_drown_the_others():
    found = sr.activation_distance(sr.compute_cloud(arm_of(TENDONS, CHAMBER), n=2_000), 0.02)
    assert found.attrs["units"] == "1"
    assert 0 < float(found.max()) < np.sqrt(4)  # no farther than corners of the unit cube
    alike = sr.activation_distance(sr.compute_cloud(arm_of(TENDONS), n=2_000), 0.02)
    assert alike.attrs["units"] == "N"
