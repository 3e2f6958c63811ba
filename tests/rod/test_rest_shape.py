"""Arms that are bent and twisted at rest."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import softreach as sr
from softreach.arm import FiberArchitecture, ObliqueMuscle, Pieces, RestShape, Samples, Tendon
from softreach.arm.bending import bending_at
from tests.kinds import KINDS, any_arms
from tests.laws import in_box

STRAIGHT_POSE = np.zeros((1, 3))


def _bent(**changes):
    return sr.designs.minimal_trunk().replace(rest=RestShape(**changes))


def _hanging(**changes):
    arm = sr.Manipulator.tapered(
        length=0.3,
        outer_radius=0.015,
        inner_radius=0.01,
        taper=0.02,
        young_modulus=3e5,
        density=1100.0,
        actuators=[sr.Tendon(distance=0.01, bundles=3, activation_bounds=(0.0, 3.0))],
    )
    return arm.replace(base=sr.Base(points="down"), rest=RestShape(**changes))


def test_a_bend_at_rest_is_an_arc_of_a_circle():
    tip = sr.tip_positions(_bent(curvature_x=2.0), STRAIGHT_POSE)[0]
    np.testing.assert_allclose(tip, [0.0, (np.cos(2.0) - 1) / 2.0, np.sin(2.0) / 2.0], atol=1e-6)


def test_bend_and_twist_at_rest_are_a_helix():
    u = np.array([1.5, -2.0, 4.0])
    tip = sr.tip_positions(_bent(curvature_x=u[0], curvature_y=u[1], twist=u[2]), STRAIGHT_POSE)[0]
    k = np.linalg.norm(u)
    n = u / k
    e3 = np.array([0.0, 0.0, 1.0])
    along = e3 - (e3 - n * n[2])
    helix = along + (e3 - n * n[2]) * np.sin(k) / k + np.cross(n, e3) * (1 - np.cos(k)) / k
    np.testing.assert_allclose(tip, helix, atol=1e-6)


def test_a_rest_shape_along_the_arm_is_integrated():
    bend = Samples(stations_over_length=(0.0, 0.4, 1.0), values=(0.5, 3.0, -1.0))
    tip = sr.tip_positions(_bent(curvature_y=bend), STRAIGHT_POSE)[0]

    def rates(z, y):
        return [float(bend(z)), np.sin(y[0]), np.cos(y[0])]

    end = solve_ivp(rates, (0, 1), np.zeros(3), rtol=1e-11, atol=1e-12, max_step=0.02).y[:, -1]
    np.testing.assert_allclose(tip, [end[1], 0.0, end[2]], atol=1e-6)


@pytest.mark.parametrize("loads", [None, sr.Loads(payload=0.02)])
def test_tendons_far_off_the_axis_bend_alike(loads):
    """A pair pulled with +t and -t, 1 m off the axis, is a couple: a uniform bend of K1 û."""
    arm = _hanging()
    arm = arm.replace(profile=arm.profile.replace(taper=0.0), loads=loads)
    stiffness = float(arm.section.stiffness(0.015).bending)
    far = sr.Tendon(name="far", distance=1.0, bundles=2, activation_bounds=(0.0, 1.0))
    faked = arm.replace(actuators=(*arm.actuators, far), rest=RestShape())
    bent = arm.replace(rest=RestShape(curvature_y=2.0))
    pull = 2.0 * stiffness
    given = np.array([[0.5, 1.0, 0.2]])
    # One is let go by what the other pulls more, so that both together do not shorten the arm.
    both = np.concatenate([given, [[0.0, pull]]], axis=1), np.concatenate([given, [[pull, 0.0]]], 1)
    apart = [sr.tip_positions(faked, x) for x in both]
    axial = float(arm.section.stiffness(0.015).axial)
    tips = sr.tip_positions(bent, given)
    nearest = min(np.abs(tip - tips).max() for tip in apart)
    assert (
        nearest < 4 * pull / axial * arm.length
    )  # one tendon of the couple alone shortens by that


@pytest.mark.parametrize("loads", [None, sr.Loads(payload=0.02)])
def test_slopes_are_those_of_the_tips(loads):
    rod = sr.rod.tip_map(_hanging(curvature_x=3.0, twist=1.0).replace(loads=loads), 1e-9)
    x, step = np.array([[0.7, 0.3, 1.2]]), 1e-4
    tips, slopes = rod.tips_and_slopes(x)
    for k, d in enumerate(step * np.eye(3)):
        change = (rod.tips(x + d) - rod.tips(x - d))[0] / (2 * step)
        np.testing.assert_allclose(slopes[0, :, k], change, atol=2e-6)
    np.testing.assert_allclose(rod.frames(x, [0.3]).position[:, 0], tips, atol=1e-8)


def test_every_answer_speaks_of_the_bundles_of_the_arm_alone(tmp_path):
    arm = _hanging(curvature_x=3.0).replace(loads=sr.Loads())
    x = np.array([[0.7, 0.3, 1.2]])
    place = sr.tip_positions(arm, x)
    shapes = sr.configuration(arm, x)
    assert shapes.sizes["bundle"] == 3
    np.testing.assert_allclose(shapes.position[:, -1], place, atol=1e-6)
    solution = sr.solve_inverse(arm, place)[0]
    np.testing.assert_allclose(solution.activations, x, atol=1e-3)
    balanced = sr.equilibria(arm, x[0])
    np.testing.assert_allclose(balanced.tips, place, atol=1e-6)
    np.testing.assert_allclose(balanced.configuration(3).position[0, -1], place[0], atol=1e-6)
    assert sr.stiffness.tip_compliance(arm, x).shape == (1, 3, 3)
    cloud = sr.compute_cloud(arm, 200)
    sr.save_cloud(cloud, tmp_path / "cloud.zarr")
    assert sr.open_cloud(tmp_path / "cloud.zarr").sizes["bundle"] == 3
    assert sr.reachable_set(arm).volume > 0


def test_the_range_of_bending_holds_the_bend_at_rest():
    least, most = bending_at(_hanging(curvature_x=3.0).with_bounds((0.0, 0.0)), [0.1, 0.2])
    np.testing.assert_allclose([least, most], 3.0)


def test_files_keep_a_rest_shape_and_parameters_change_it():
    bend = Samples(stations_over_length=(0.0, 1.0), values=(1.0, 2.0), interpolation="linear")
    arm = _bent(curvature_x=bend, twist=0.25)
    assert sr.Manipulator.from_toml(arm.to_toml()) == arm
    straight = sr.designs.minimal_trunk()
    assert straight.replace(rest=RestShape()).to_toml() == straight.to_toml()
    with pytest.raises(sr.InvalidDesign, match=r"rest\.twist_per_m"):
        sr.Manipulator.from_toml(straight.to_toml() + '\n[rest]\ntwist_per_m = "much"\n')


# Symmetries of the tips of arms of every kind: turned, mirrored, scaled


def turned(actuator, angle):
    return actuator.replace(offset=actuator.offset + angle)


def opposite(value):
    """The other hand of an angle, constant or along the arm."""
    if isinstance(value, Pieces | Samples):
        return value.replace(values=tuple(-one for one in value.values))
    return None if value is None else -value


def mirrored(actuator):
    """As seen in a mirror that holds the x-axis and the arm."""
    change = {"offset": -actuator.offset}
    if isinstance(actuator, FiberArchitecture):
        for field in ("helical_angle", "revolution"):
            change[field] = opposite(getattr(actuator, field))
    elif isinstance(actuator, ObliqueMuscle):
        change["helical_angle"] = opposite(actuator.helical_angle)
    elif isinstance(actuator, Tendon):
        change |= {"revolution": -actuator.revolution, "routing": opposite(actuator.routing)}
    return actuator.replace(**change)


def in_mirror_order(arm, gamma):
    """Bundle j of n is the image of bundle -j."""
    order, first = [], 0
    for actuator in arm.actuators:
        order += [first + (-j) % actuator.bundles for j in range(actuator.bundles)]
        first += actuator.bundles
    return gamma[:, order]


@pytest.mark.parametrize("kind", KINDS)
def test_turning_all_actuators_turns_the_tips(kind):
    @given(arm=any_arms(kind), angle=st.floats(-4, 4))
    def law(arm, angle):
        gamma = in_box(arm, 5)
        other = arm.replace(actuators=tuple(turned(one, angle) for one in arm.actuators))
        c, s = math.cos(angle), math.sin(angle)
        expected = sr.tip_positions(arm, gamma, tol=1e-9) @ [[c, s, 0], [-s, c, 0], [0, 0, 1]]
        found = sr.tip_positions(other, gamma, tol=1e-9)
        np.testing.assert_allclose(found, expected, atol=3e-9 * arm.length)

    law()


@pytest.mark.parametrize("kind", KINDS)
def test_mirroring_all_actuators_mirrors_the_tips(kind):
    @given(arm=any_arms(kind))
    def law(arm):
        gamma = in_box(arm, 5)
        other = arm.replace(actuators=tuple(mirrored(one) for one in arm.actuators))
        expected = sr.tip_positions(arm, gamma, tol=1e-9) * [1, -1, 1]
        found = sr.tip_positions(other, in_mirror_order(arm, gamma), tol=1e-9)
        np.testing.assert_allclose(found, expected, atol=3e-9 * arm.length)

    law()


@pytest.mark.parametrize("kind", KINDS)
def test_exchanging_bundles_turns_what_they_do(kind):
    """Bundles lie evenly: giving each the activation of the one before turns by 2π/n."""

    @given(arm=any_arms(kind))
    def law(arm):
        arm = arm.replace(actuators=arm.actuators[:1])
        n, gamma = arm.bundles, in_box(arm, 5)
        c, s = math.cos(2 * math.pi / n), math.sin(2 * math.pi / n)
        expected = sr.tip_positions(arm, gamma, tol=1e-9) @ [[c, s, 0], [-s, c, 0], [0, 0, 1]]
        found = sr.tip_positions(arm, np.roll(gamma, 1, axis=1), tol=1e-9)
        np.testing.assert_allclose(found, expected, atol=3e-9 * arm.length)

    law()
