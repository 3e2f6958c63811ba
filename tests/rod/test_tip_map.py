"""The one function that makes a tip map of an arm."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from softreach.arm import designs
from softreach.rod import tip_positions
from softreach.rod.free import FreeRod
from softreach.rod.rods import tip_map
from softreach.support.errors import InvalidDesign, InvalidInput


def test_an_arm_without_loads_is_a_free_rod(trunk):
    assert tip_map(trunk) == FreeRod(trunk, 1e-6)


def test_equal_arms_and_tolerances_share_one_tip_map(trunk):
    rod = tip_map(trunk, 1e-7)
    assert tip_map(designs.minimal_trunk(), np.float64(1e-7)) is rod
    assert tip_map(rod) is rod
    assert tip_map(trunk, 1e-8) is not rod
    assert tip_map(trunk.with_bounds((-1, 0)), 1e-7) is not rod


def test_what_is_remembered_is_computed_once(trunk, monkeypatch):
    rod = tip_map(trunk, 3e-7)
    before = rod.tips([[-1.0, 0.0, -0.5]])

    def never(*_):
        raise AssertionError

    monkeypatch.setattr("softreach.rod.steps.tables", never)
    np.testing.assert_array_equal(tip_positions(trunk, [[-1.0, 0.0, -0.5]], 3e-7), before)


def test_many_arms_are_not_all_kept():
    for k in range(70):
        tip_map(designs.minimal_trunk(length=1.0 + k))
    gc.collect()
    kept = [one for one in gc.get_objects() if type(one) is FreeRod and one.length > 1.0]
    assert len(kept) <= 64


@pytest.mark.parametrize("arm", [None, "trunk", 3.0, FreeRod])
def test_what_is_no_arm_is_refused(arm):
    with pytest.raises(InvalidInput, match="must be a Manipulator or a TipMap"):
        tip_map(arm)


@pytest.mark.parametrize("tol", [0, 1e-13, -1, np.nan, np.inf, None, "small", True])
def test_a_tolerance_out_of_range_is_refused(trunk, tol):
    with pytest.raises(InvalidInput, match="tol = "):
        tip_map(trunk, tol)


def test_an_arm_beyond_the_theory_is_refused_every_time(trunk):
    for _ in range(2):
        with pytest.raises(InvalidDesign, match="must keep ζ > 0"):
            tip_map(trunk.with_bounds((-9.0, 0.0)))
