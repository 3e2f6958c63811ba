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
from softreach.requirements import Limits, Requirements
from softreach.rod.bending import bending_over_bounds
from softreach.rod.rods import tip_map
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


def of_tendons(kind=sr.Tendon, **changes):
    """A soft rod of 0.3 m with three cables at 8 mm from its axis, beyond 1 mm of it or within."""
    soft = sr.Material(young_modulus=1e5, density=1000.0, poisson_ratio=0.49)
    return sr.Manipulator(
        profile=sr.LinearTaper(length=0.3, outer_radius=0.01),
        section=sr.arm.Section(core=soft, rings=(sr.Ring(inner_ratio=0.5, material=soft),)),
        actuators=(kind(bundles=3, distance=0.008, **changes),),
    )


def sharpness(arm, gamma):
    """Largest κ R2 of a pose by second differences of its centerline."""
    shape = sr.configuration(arm, [gamma], 2001)
    steps = np.diff(shape.position.values[0], axis=0)
    sizes = np.linalg.norm(steps, axis=1)
    turns = np.linalg.norm(np.diff(steps / sizes[:, None], axis=0), axis=1)
    return float((turns / (0.5 * (sizes[1:] + sizes[:-1]))).max()) * 0.01


def pulled(count):
    """That rod by so many inputs: tensions without balance, two of them perhaps of one input."""
    arm = of_tendons(activation_bounds=((1.5, 3.0), (0.0, 0.5), (0.0, 0.5)))
    arm = arm.replace(rest=sr.arm.RestShape(curvature_x=2.0))
    names = arm.bundle_names
    drive = sr.arm.Drive.antagonists("b", *names[:2], bounds=(0.1, 0.7), offset=1.0, gain=1.2)
    return arm.replace(drives=(drive,)) if count == 2 else arm


@pytest.mark.parametrize(
    ("arm", "poses", "exact"),
    [
        (of_tendons(activation_bounds=(0, 4)), itertools.product((0, 4), repeat=3), True),
        (
            of_tendons(sr.arm.LengthTendon, activation_bounds=(0, 0.03)),
            itertools.product((0, 0.015, 0.03), repeat=3),
            False,
        ),
        (
            of_tendons(activation_bounds=(0, 0.05)).replace(
                base=sr.Base(points="x"), loads=sr.Loads(gravity=(0, 0, -2.0))
            ),
            [(0, 0, 0), (0.05, 0, 0), (0, 0.05, 0.05)],
            False,
        ),
    ],
    ids=["tensions", "lengths", "loads"],
)
def test_bending_over_bounds_is_that_of_the_centerlines_whatever_drives_or_loads(arm, poses, exact):
    found = bending_over_bounds(arm)
    most = max(sharpness(arm, pose) for pose in poses)
    assert found.exact is exact
    assert most * (1 - 1e-5) <= found.sharpest.value <= most * (1.00001 if exact else 1.02)
    assert found.largest == pytest.approx(found.sharpest.value / 0.01)
    (finding,) = sr.check(arm, Requirements(limits=Limits(bending=0.95 * most))).findings
    assert finding.verdict == "missed"


@given(count=st.sampled_from([2, 3]), seed=st.integers(0, 99))
def test_no_pose_of_forces_bends_more_or_less_than_the_exact_range(count, seed):
    arm = pulled(count)
    z = np.linspace(0, arm.length, 4)
    least, most = bending_at(arm, z)
    gamma = np.random.default_rng(seed).uniform(*arm.input_bounds.T, (500, arm.inputs))
    curvature = tip_map(arm).strains(gamma, z).curvature
    kappa = np.hypot(curvature[..., 0], curvature[..., 1])
    assert (kappa.max(axis=0) <= most * (1 + 1e-9)).all()
    assert (kappa.min(axis=0) >= least * (1 - 1e-9)).all()
    assert (0.8 * most < kappa.max(axis=0)).all()
    assert (kappa.min(axis=0) < 1.4 * least).all()
