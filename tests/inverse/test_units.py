"""The inverse problem of arms whose activations are forces, pressures and strains at once."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Chamber, LinearTaper, Material, Ring, Section, Tendon
from tests.laws import in_box

TENDONS = Tendon(name="tendon", distance_ratio=0.9, bundles=3, activation_bounds=(0, 8))
CHAMBER = Chamber(name="middle", distance_ratio=0, radius_ratio=0.25, activation_bounds=(0, 5e4))


def arm_of(*actuators, modulus=1e5):
    ring = Ring(inner_ratio=0.5, material=Material(young_modulus=modulus))
    return sr.Manipulator(
        profile=LinearTaper(length=0.2, outer_radius=0.015, taper=0.01),
        section=Section(rings=(ring,)),
        actuators=actuators,
    )


@pytest.fixture(scope="module")
def mixed():
    return arm_of(TENDONS, CHAMBER)


def test_every_tip_of_a_mixed_arm_is_reached(mixed):
    gamma = in_box(mixed, 200)
    found = sr.solve_inverse(mixed, sr.tip_positions(mixed, gamma))
    assert (found.statuses == 0).all()
    low, high = mixed.bounds.T
    assert ((found.activations >= low - 1e-9) & (found.activations <= high + 1e-9)).all()


def test_the_least_change_does_not_depend_on_units():
    """An arm ten times as stiff under forces ten times as large is the same arm.

    Both are found to the step at which a search ends, in ranges.
    """
    strong = TENDONS.replace(activation_bounds=(0, 80)), CHAMBER.replace(activation_bounds=(0, 5e5))
    soft, stiff = arm_of(TENDONS, CHAMBER), arm_of(*strong, modulus=1e6)
    targets = sr.tip_positions(soft, in_box(soft, 50))
    one, other = (
        sr.solve_inverse(arm, targets).activations / arm.bounds[:, 1] for arm in (soft, stiff)
    )
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-6)


def test_near_is_kept_where_it_already_reaches_the_target(mixed):
    near = in_box(mixed, 30)
    found = sr.solve_inverse(mixed, sr.tip_positions(mixed, near), near=near)
    np.testing.assert_allclose(found.activations / near, 1, atol=1e-6)


def test_a_path_is_followed_in_the_units_of_the_arm(mixed):
    ends = in_box(mixed, 2, seed=3)
    gamma = ends[0] + np.linspace(0, 0.2, 5)[:, None] * (ends[1] - ends[0])
    path = sr.tip_positions(mixed, gamma)
    followed = sr.track_path(mixed, path, start=gamma[0])
    np.testing.assert_allclose(followed.activation[0], gamma[0], rtol=1e-6)
    np.testing.assert_allclose(sr.tip_positions(mixed, followed.activation), path, atol=1e-8)


def test_held_bundles_stay_where_they_are(mixed):
    held = mixed.with_bounds(((0, 8), (2, 2), (0, 8), (1e4, 5e4)))
    gamma = in_box(held, 20)
    found = sr.solve_inverse(held, sr.tip_positions(held, gamma), near=gamma)
    assert (found.statuses == 0).all()
    np.testing.assert_allclose(found.activations[:, 1], 2)
