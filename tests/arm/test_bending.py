"""Laws of the range of bending: zonogons against all corners, their extremes along the arm."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

import softreach as sr
from softreach.arm import designs
from softreach.arm.bending import (
    bending_at,
    largest_bending,
    sharpest_bending,
    smallest_bending,
)
from softreach.arm.tables import tables
from tests.laws import arm_of, arms, single


def at_corners(arm, stations):
    """Bending at every corner of the box, shape (station, corner)."""
    corners = np.array(list(itertools.product(*arm.bounds)))
    plane = tables(arm, stations).curvature[:, :2]
    return np.linalg.norm(np.einsum("scb,nb->snc", plane, corners), axis=-1)


def least(arm, stations):
    """Least bending by bounded least squares, for bundles that are free."""
    plane = tables(arm, stations).curvature[:, :2]
    bounds, active = tuple(arm.bounds.T), {"method": "bvls", "tol": 1e-15, "max_iter": 100}
    solved = [lsq_linear(u, [0.0, 0.0], bounds, **active) for u in plane]
    return np.array([np.linalg.norm(one.fun) for one in solved])


@given(arm=arms())
def test_the_largest_bending_is_that_of_the_farthest_corner(arm):
    z = np.linspace(0, arm.length, 5)
    found = bending_at(arm, z)[1]
    np.testing.assert_allclose(found, at_corners(arm, z).max(axis=1), rtol=1e-12, atol=1e-14)


@given(arm=arms(), low=st.floats(-0.8, 0.2), width=st.floats(0.01, 0.5))
def test_the_least_bending_is_that_of_bounded_least_squares(arm, low, width):
    arm = arm.with_bounds((low, low + width))
    z = np.linspace(0, arm.length, 5)
    found = bending_at(arm, z)[0]
    np.testing.assert_allclose(found, least(arm, z), rtol=1e-6, atol=1e-6 / arm.length)


def test_held_bundles_and_bundles_side_by_side_bend_as_one_corner_says():
    held = designs.minimal_trunk().with_bounds((-0.4, -0.4))
    line = single(activation_bounds=(-0.6, -0.2))
    opposite = arm_of(
        *(sr.FiberArchitecture(helical_angle=0.0, offset=k, extent=0.5) for k in (0.0, math.pi)),
        activation_bounds=(-0.6, -0.2),
    )
    z = np.linspace(0, 1, 5)
    for arm in (held, line):
        corners = at_corners(arm, z)
        low, high = bending_at(arm, z)
        np.testing.assert_allclose(low, corners.min(axis=1), rtol=1e-12)
        np.testing.assert_allclose(high, corners.max(axis=1), rtol=1e-12)
    np.testing.assert_allclose(bending_at(opposite, z)[0], 0.0, atol=1e-12)


def wound(turns: float, **changes: object) -> sr.Manipulator:
    """A fiber that winds beside a straight one."""
    fibers = (
        sr.FiberArchitecture(revolution=2 * math.pi * turns, offset=0.3, extent=0.6),
        sr.FiberArchitecture(helical_angle=0.0, offset=2.0, extent=0.5),
    )
    return arm_of(*fibers, **({"activation_bounds": (-0.7, -0.1)} | changes))


@pytest.mark.parametrize("turns", [0.1, 0.7, 3.0, 40.0])
@pytest.mark.parametrize("taper", [0.0, 0.03, -0.02])
def test_no_station_bends_more_or_less_than_the_extremes(turns, taper):
    arm = wound(turns, taper=taper)
    z = np.linspace(0, 1, 60_001)
    low, high = bending_at(arm, z)
    assert largest_bending(arm).value == pytest.approx(high.max(), rel=3e-6)
    assert largest_bending(arm).value >= high.max() * (1 - 1e-9)
    assert smallest_bending(arm).value == pytest.approx(low.min(), abs=2e-3 * high.max())
    assert smallest_bending(arm).value <= low.min() * (1 + 1e-9)
    assert sharpest_bending(arm).value >= (high * arm.profile.radius(z)).max() * (1 - 1e-9)


def test_extremes_are_reached_where_they_are_said_to_be():
    arm = wound(1.7, taper=0.01)
    largest, smallest, sharpest = largest_bending(arm), smallest_bending(arm), sharpest_bending(arm)
    assert bending_at(arm, largest.station)[1] == pytest.approx(largest.value, rel=1e-9)
    assert bending_at(arm, smallest.station)[0] == pytest.approx(
        smallest.value, abs=1e-9 * largest.value
    )
    relative = bending_at(arm, sharpest.station)[1] * arm.profile.radius(sharpest.station)
    assert relative == pytest.approx(sharpest.value, rel=1e-9)


def test_an_arm_that_bends_alike_everywhere_does_so_from_its_base_on():
    arm = single(activation_bounds=(-0.6, -0.2))
    assert largest_bending(arm).station == sharpest_bending(arm).station == 0.0
    assert smallest_bending(arm).value == pytest.approx(largest_bending(arm).value / 3, rel=1e-12)


def test_an_arm_that_is_straight_at_one_station_only_bends_nowhere_less():
    arm = wound(40.0)
    assert smallest_bending(arm).value == 0.0
    assert bending_at(arm, smallest_bending(arm).station)[0] < 1e-9 * largest_bending(arm).value


def test_an_arm_that_can_rest_can_be_straight(trunk):
    assert smallest_bending(trunk) == (0.0, 0.0)
