"""A split fiber: what stays, what is spread, what is refused."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.errors import InvalidDesign, InvalidInput
from softreach.rod.kinematics import tip_positions
from tests.laws import arm_of, in_box


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
    np.testing.assert_allclose(arm.bundle_extents, extent)
    np.testing.assert_allclose(arm.revolutions, revolution, atol=1e-12)


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


@pytest.mark.parametrize("fiber", ["middle", 3, -1, True])
def test_an_unknown_fiber_is_refused_with_those_there_are(trunk, fiber):
    with pytest.raises(
        InvalidInput, match=r"fiber = .*0 \(left\), 1 \(right\), 2 \(longitudinal\)"
    ):
        trunk.split(fiber, 2)


@pytest.mark.parametrize("count", [0, -2, 1.5, True])
def test_other_counts_are_refused(trunk, count):
    with pytest.raises(InvalidInput, match=r"count = .*whole number >= 1"):
        trunk.split("left", count)


def test_an_architecture_of_several_bundles_is_refused():
    pair = FiberArchitecture(revolution=0.0, extent=0.3, bundles=2)
    with pytest.raises(InvalidInput, match=r"fibers\[0\].bundles = 2.*independent already"):
        arm_of(pair).split(0, 2)


def test_more_muscle_than_the_arm_bears_is_refused(trunk):
    with pytest.raises(InvalidDesign, match="extension"):
        trunk.split("longitudinal", 100)
