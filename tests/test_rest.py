"""The arm at rest under its loads."""

from __future__ import annotations

import math

import numpy as np
import pytest

import softreach as sr
from softreach.arm.load_number import load_number
from softreach.rest import rest
from softreach.rod.rods import tip_map
from softreach.rod.tip_map import TipStatus
from softreach.support.errors import SoftreachWarning
from tests.bodies import rubber

SIDEWAYS = (9.81, 0.0, 0.0)


def cylinder(loads: sr.Loads) -> sr.Manipulator:
    return rubber(sr.designs.minimal_trunk(taper=0.0), loads)


def at_load_number(number: float, direction: tuple[float, float, float]) -> sr.Manipulator:
    """The cylinder under as much gravity as gives this load number."""
    x, y, z = direction
    size = number / load_number(cylinder(sr.Loads(gravity=(1.0, 0.0, 0.0))))
    return cylinder(sr.Loads(gravity=(size * x, size * y, size * z)))


def test_a_light_arm_held_sideways_sags_by_w_l4_over_8_ei():
    """4 Λ/8 of its length."""
    found = rest(at_load_number(1e-3, (1, 0, 0)))
    assert found.status == TipStatus.STABLE
    assert found.sag_over_length == pytest.approx(4e-3 / 8, rel=1e-3)
    assert found.sag == found.sag_over_length * sr.designs.minimal_trunk().length


@pytest.mark.parametrize(("share", "status"), [(0.97, "STABLE"), (1.03, "UNSTABLE")])
def test_an_upright_cylinder_at_rest_is_stable_up_to_the_load_of_greenhill(share, status):
    """Up to a share for the compression by its own weight."""
    found = rest(at_load_number(share * 7.83734744 / 4, (0, 0, -1)))
    assert found.status.name == status


@pytest.mark.parametrize("number", [2.2, 4.0, 8.0, 11.2, 11.9])
def test_no_cylinder_stands_that_is_heavier(number):
    """Two losses of stability close to each other do not make it stable again."""
    assert rest(at_load_number(number, (0, 0, -1))).status == TipStatus.UNSTABLE


def test_it_is_where_the_tip_map_puts_the_tip_without_activation():
    arm = sr.designs.lce_arm().replace(loads=sr.Loads(gravity=SIDEWAYS, payload=0.002))
    found = rest(arm)
    np.testing.assert_array_equal(found.activation, 0.0)
    np.testing.assert_allclose(
        found.tip, tip_map(arm).tips(np.zeros((1, arm.bundles)))[0], atol=2e-6 * arm.length
    )
    free = np.array([0.0, 0.0, arm.length])
    assert found.sag == pytest.approx(math.dist(found.tip, free), rel=1e-9)


def test_where_zero_is_out_of_bounds_the_nearest_activation_is_rest():
    arm = sr.designs.lce_arm().replace(loads=sr.Loads())
    bounds = arm.bounds.copy()
    bounds[0] = -3.0, -1.0
    found = rest(arm.with_bounds(bounds))
    np.testing.assert_array_equal(found.activation, [-1.0, 0.0, 0.0])
    assert found.status == TipStatus.STABLE


def test_an_arm_without_loads_is_refused(trunk):
    with pytest.raises(sr.InvalidInput, match="loads = None: must be given"):
        rest(trunk)


def test_a_tip_map_beyond_the_verified_loads_warns_and_one_within_does_not():
    with pytest.warns(SoftreachWarning, match="load number is above 12"):
        tip_map(at_load_number(12.5, (0, 0, 1)))
    tip_map(at_load_number(11.9, (0, 0, 1)))
