"""Fiber architectures: what is refused, how they wind, where their bundles lie, how they split."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.rod.kinematics import tip_positions
from softreach.rod.summary import describe
from softreach.support.errors import InvalidInput
from tests.laws import arm_of, arms, in_box


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"helical_angle": math.pi / 2}, "helical_angle = 1.5708"),
        ({"extent": 0.0}, "extent = 0: .*> 0"),
        ({"extent": 7.0}, "extent = 7: .*<= 6.28319 rad"),
        ({"bundles": 0}, "whole number >= 1"),
        ({"bundles": 1.5}, "whole number >= 1"),
        ({"bundles": True}, "whole number >= 1"),
        ({"offset": math.inf}, "offset = inf: must be a finite number in rad"),
        ({"revolution": 1.0, "helical_angle": 0.2}, "exactly one of helical_angle and revolution"),
        ({"revolution": None, "helical_angle": None}, "exactly one"),
        ({"extent": None}, "extent: must be a finite number > 0"),
        ({"offset": None}, "offset: must be a finite number"),
        ({"offset": "0"}, "offset = '0'"),
        ({"bundles": None}, "bundles: must be a whole number >= 1"),
        ({"name": 3}, "name = 3: must be text"),
        ({"name": None}, "name: must be text"),
        ({"activation_bounds": (1, 0)}, "lower <= upper"),
        ({"activation_bounds": ((-1, 0),) * 2}, "must be one pair"),
        ({"activation_bounds": ("a", "b")}, "must be a pair"),
        ({"activation_bounds": None}, "activation_bounds: must be a pair"),
    ],
)
def test_an_impossible_fiber_is_refused(change, message):
    with pytest.raises(sr.InvalidDesign, match=message):
        sr.FiberArchitecture(**({"extent": 0.5, "helical_angle": 0.1} | change))


def test_numpy_scalars_are_taken_as_numbers():
    fiber = sr.FiberArchitecture(
        helical_angle=np.float64(0.1), extent=np.float32(0.5), bundles=np.int64(2)
    )
    assert (type(fiber.extent), type(fiber.bundles)) == (float, int)


def test_replacing_an_angle_by_a_revolution_and_back():
    fiber = sr.FiberArchitecture(helical_angle=0.1, extent=0.5)
    wound = fiber.replace(revolution=1.0)
    assert (wound.helical_angle, wound.revolution) == (None, 1.0)
    assert wound.replace(helical_angle=0.1) == fiber


@given(arm=arms())
def test_revolution_and_helical_angle_say_the_same(arm):
    facts = describe(arm)
    by_angle = tuple(
        fiber.replace(helical_angle=float(angle))
        for fiber, angle in zip(arm.fibers, facts.helical_angles, strict=True)
    )
    np.testing.assert_allclose(
        describe(arm.replace(actuators=by_angle)).revolutions, facts.revolutions, atol=1e-12
    )
    np.testing.assert_allclose(facts.revolutions, [f.revolution for f in arm.fibers], atol=1e-12)


def test_bounds_are_one_pair_where_all_bundles_share_it():
    pair = FiberArchitecture(
        helical_angle=0.0, extent=0.3, bundles=2, activation_bounds=np.array([[-1, 0], [-1, 0]])
    )
    assert pair.activation_bounds == (-1.0, 0.0)
    np.testing.assert_array_equal(pair.bounds, [[-1, 0], [-1, 0]])
    assert pair.with_bounds(((-1, 0), (0, 1))).activation_bounds == ((-1.0, 0.0), (0.0, 1.0))


@given(arm=arms())
def test_an_outline_turns_by_the_revolution(arm):
    start, end = arm.outline([0.0, arm.length]).center
    each = np.repeat(describe(arm).revolutions, [fiber.bundles for fiber in arm.fibers])
    np.testing.assert_allclose(end - start, each, atol=1e-12)


def test_bundle_geometry_follows_the_architecture():
    arm = arm_of(
        sr.FiberArchitecture(helical_angle=0.0, extent=0.3, offset=0.2, bundles=3, name="ring")
    )
    outline = arm.outline([0.0])
    np.testing.assert_allclose(outline.center[0], 0.2 + 2 * np.pi / 3 * np.arange(3))
    np.testing.assert_array_equal(outline.extent, [0.3] * 3)
    np.testing.assert_array_equal(outline.inner_ratio[0], [arm.section.rings[0].inner_ratio] * 3)
    np.testing.assert_array_equal(outline.outer_ratio[0], [1.0] * 3)
    assert arm.bundle_names == ("ring 1", "ring 2", "ring 3")


def test_the_longitudinal_fiber_split_in_two_is_the_paper_s_redundant_design(trunk):
    assert trunk.split("longitudinal", 2) == designs.redundant_trunk()
    assert trunk.split(2, 2) == designs.redundant_trunk()


@given(st.integers(1, 6), st.booleans(), st.floats(-3, 3))
def test_the_parts_lie_side_by_side_about_the_original(count, keep_extent, revolution):
    whole = arm_of(FiberArchitecture(revolution=revolution, offset=0.7, extent=0.1))
    arm = whole.split(0, count, keep_extent=keep_extent)
    offsets = [fiber.offset for fiber in arm.fibers]
    extent = 0.1 if keep_extent else 0.1 / count
    assert len(offsets) == count
    assert np.mean(offsets) == pytest.approx(whole.fibers[0].offset)
    np.testing.assert_allclose(np.diff(offsets), extent, rtol=1e-9)
    np.testing.assert_allclose(arm.outline(0.0).extent, extent)
    np.testing.assert_allclose(describe(arm).revolutions, revolution, atol=1e-12)


def test_parts_that_fill_the_sector_move_the_arm_as_the_whole_did(trunk):
    arm = trunk.split("right", 3, keep_extent=False)
    gamma = in_box(trunk, 20)
    same = np.repeat(gamma, [1, 3, 1], axis=1)
    np.testing.assert_allclose(
        tip_positions(arm, same), tip_positions(trunk, gamma), rtol=0, atol=1e-6
    )


def test_parts_have_names_and_the_bounds_of_the_original():
    fibers = (
        FiberArchitecture(revolution=1.0, extent=0.3),
        FiberArchitecture(revolution=0.0, extent=0.3, bundles=2, name="pair"),
    )
    arm = arm_of(*fibers, activation_bounds=((-1, 0), (-0.5, 0), (-0.25, 0.25)))
    split = arm.split(0, 2)
    assert split.bundle_names == ("fiber 1 1", "fiber 1 2", "pair 1", "pair 2")
    np.testing.assert_array_equal(split.bounds, arm.bounds[[0, 0, 1, 2]])


def test_one_part_is_the_whole(trunk):
    assert trunk.split("left", 1) == trunk


@pytest.mark.parametrize("fiber", ["middle", 3, -1, True, 1.0, None])
def test_an_unknown_fiber_is_refused_with_those_there_are(trunk, fiber):
    with pytest.raises(
        InvalidInput, match=r"fiber = .*0 \(left\), 1 \(right\), 2 \(longitudinal\)"
    ):
        trunk.split(fiber, 2)


@pytest.mark.parametrize("count", [0, -2, 1.5, True])
def test_other_counts_are_refused(trunk, count):
    with pytest.raises(InvalidInput, match=r"count = .*whole number, from 1"):
        trunk.split("left", count)


def test_an_architecture_of_several_bundles_is_refused():
    pair = FiberArchitecture(revolution=0.0, extent=0.3, bundles=2)
    with pytest.raises(InvalidInput, match=r"fiber 1\.bundles = 2.*independent already"):
        arm_of(pair).split(0, 2)


def test_the_parts_of_a_fiber_without_a_name_have_none():
    parts = FiberArchitecture(helical_angle=0.0, extent=0.3).split(2)
    assert [part.name for part in parts] == ["", ""]
    assert arm_of(*parts).bundle_names == ("fiber 1", "fiber 2")
