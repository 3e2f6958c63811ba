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
from softreach.arm.base import POINTS
from softreach.arm.loads import PointLoad
from softreach.forces import blocked_force
from softreach.rod import as_tip_map
from softreach.rod.bending import bending_at
from softreach.rod.rest import rest
from softreach.rod.rods import free_bundles
from softreach.stiffness import cloud_compliance, tip_compliance
from softreach.support.errors import InvalidInput
from tests.bodies import rubber
from tests.kinds import KINDS, any_arms
from tests.laws import arms, bases, in_box, rotvec

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
def test_slopes_are_those_of_the_tips(loads):
    rod = sr.rod.as_tip_map(_hanging(curvature_x=3.0, twist=1.0).replace(loads=loads), 1e-9)
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
    assert sr.reachable_set(arm, accuracy=0.2).volume > 0


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


def rotation(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])


def all_turned(arm, gamma, angle):
    other = arm.replace(actuators=tuple(turned(each, angle) for each in arm.actuators))
    return other, gamma, rotation(angle)


def all_mirrored(arm, gamma, _):
    other = arm.replace(actuators=tuple(mirrored(each) for each in arm.actuators))
    return other, in_mirror_order(arm, gamma), np.diag([1.0, -1.0, 1.0])


def bundles_exchanged(arm, gamma, _):
    """Bundles lie evenly: giving each the activation of the one before turns by 2π/n."""
    return arm, np.roll(gamma, 1, axis=1), rotation(2 * math.pi / arm.bundles)


@pytest.mark.parametrize("change", [all_turned, all_mirrored, bundles_exchanged])
@pytest.mark.parametrize("kind", KINDS)
def test_what_turns_or_mirrors_all_actuators_does_so_to_the_tips(kind, change):
    @given(arm=any_arms(kind), angle=st.floats(-4, 4))
    def law(arm, angle):
        if change is bundles_exchanged:
            arm = arm.replace(actuators=arm.actuators[:1])
        gamma = in_box(arm, 5)
        other, moved, matrix = change(arm, gamma, angle)
        expected = sr.tip_positions(arm, gamma, tol=1e-9) @ matrix
        found = sr.tip_positions(other, moved, tol=1e-9)
        np.testing.assert_allclose(found, expected, atol=3e-9 * arm.length)

    law()


# A base pose: whatever a posed arm does is what the upright one does, seen from the world


POSE = sr.Base(position=(0.3, -0.2, 1.5), points=rotvec((0.3, 1.1, -0.4)), turn=0.7)


@pytest.fixture
def posed(trunk):
    return trunk.replace(base=POSE)


@pytest.fixture(scope="module")
def loaded():
    """An upright arm under every kind of load, and the same arm posed, with the same loads on it.

    Those that do not follow the tip are turned for the upright one.
    """
    inertial = {
        "gravity": (1.0, 2.0, -9.0),
        "tip_force": (0.3, -0.2, 0.1),
        "tip_moment": (0.01, 0.0, -0.02),
        "force_per_length": (0.0, 0.1, 0.2),
    }
    follower = {"follower_force": (0.1, 0, 0), "payload": 0.05, "payload_arm": (0, 0.02, 0)}
    points = PointLoad(station=0.4, force=(0.1, 0.2, -0.3), moment=(0.0, 0.02, 0.0))
    turned = {name: POSE.rotation.T @ value for name, value in inertial.items()}
    point = points.replace(
        force=POSE.rotation.T @ points.force, moment=POSE.rotation.T @ points.moment
    )
    arm = sr.designs.minimal_trunk().with_bounds((-0.6, 0.0))
    upright = rubber(arm, sr.Loads(**follower, **turned, point_loads=(point,)))
    posed = rubber(arm, sr.Loads(**follower, **inertial, point_loads=(points,)))
    return upright, posed.replace(base=POSE)


class TestEquivariance:
    """A result of a posed arm is the posed result of the upright one."""

    @given(arm=arms(), base=bases())
    def test_tips_move_with_the_base(self, arm, base):
        gamma = in_box(arm, 5)
        tips = sr.tip_positions(arm.replace(base=base), gamma)
        expected = base.position + sr.tip_positions(arm, gamma) @ base.rotation.T
        np.testing.assert_allclose(tips, expected, rtol=0, atol=1e-14)

    def test_jacobians_are_spatial_twists_about_the_origin_of_the_world(self, trunk, posed):
        gamma = in_box(trunk, 20)
        v, w = np.split(sr.tip_jacobian(trunk, gamma), 2, axis=1)
        found_v, found_w = np.split(sr.tip_jacobian(posed, gamma), 2, axis=1)
        np.testing.assert_allclose(found_w, POSE.rotation @ w, atol=1e-14)
        shift = np.cross(POSE.position, found_w, axisb=1, axisc=1)
        np.testing.assert_allclose(found_v, POSE.rotation @ v + shift, atol=1e-13)

    def test_configurations_turn_and_keep_their_strains(self, trunk, posed):
        one, other = (sr.configuration(arm, [-0.4, -1.2, -0.3]) for arm in (trunk, posed))
        np.testing.assert_array_equal(other.position, POSE.to_world(one.position.values))
        directors = POSE.directions_to_world(one.directors.values)
        np.testing.assert_array_equal(other.directors, directors)
        for name in ("curvature", "extension", "radius"):
            np.testing.assert_array_equal(one[name], other[name])

    def test_the_volume_in_reach_does_not_depend_on_the_base(self, trunk, posed):
        one, other = (sr.reachable_set(arm, accuracy=0.05) for arm in (trunk, posed))
        assert other.volume == pytest.approx(one.volume, abs=one.volume_error + other.volume_error)
        apart = abs(other.convex_volume - one.convex_volume)
        assert apart <= one.convex_volume_error + other.convex_volume_error
        tips = sr.tip_positions(posed, in_box(posed, 50))
        assert other.distance(tips).max() <= 2 * other.image.lattice.cell

    def test_the_inverse_finds_the_same_activations(self, trunk, posed):
        targets = sr.tip_positions(trunk, in_box(trunk, 20))
        targets[:3] *= 3.0
        one = sr.solve_inverse(trunk, targets)
        other = sr.solve_inverse(posed, POSE.to_world(targets))
        np.testing.assert_array_equal(one.statuses, other.statuses)
        np.testing.assert_array_equal(one.counts, other.counts)
        np.testing.assert_allclose(one.activations, other.activations, atol=1e-9)
        np.testing.assert_allclose(one.gaps, other.gaps, atol=1e-9)
        bounds = one.gap_bounds
        np.testing.assert_allclose(other.gap_bounds, bounds, rtol=0.1)
        assert (other.gap_bounds <= other.gaps).all()

    def test_more_than_three_bundles_find_the_same_places_and_directions(self):
        arm = sr.designs.redundant_trunk()
        posed, gamma = arm.replace(base=POSE), in_box(arm, 5)
        tips, _, directions, _ = as_tip_map(arm).tip_motions(gamma)
        wanted = {"direction": directions}
        one = sr.solve_inverse(arm, tips, **wanted)
        turned = {"direction": POSE.directions_to_world(directions)}
        other = sr.solve_inverse(posed, POSE.to_world(tips), **turned)
        np.testing.assert_array_equal(one.statuses, other.statuses)
        np.testing.assert_allclose(one.activations, other.activations, atol=1e-5)

    def test_paths_lead_through_the_same_activations(self, trunk, posed):
        path = sr.tip_positions(trunk, np.linspace([-0.3, -0.9, -0.2], [-0.5, -0.6, -0.4], 5))
        one = sr.track_path(trunk, path, [-0.3, -0.9, -0.2])
        other = sr.track_path(posed, POSE.to_world(path), [-0.3, -0.9, -0.2])
        np.testing.assert_allclose(one.activation, other.activation, atol=1e-9)

    def test_gradients_of_the_volume_are_the_same_but_for_their_errors(self, trunk, posed):
        one, other = (sr.volume_gradient(arm, ["taper"], accuracy=0.05) for arm in (trunk, posed))
        apart = np.abs(one.volume - other.volume)
        assert (apart <= one.volume_error + other.volume_error).all()
        turned = sr.volume_gradient(posed, ["base.turn", "base.position[0]"], accuracy=0.05)
        assert (np.abs(turned.volume) <= turned.volume_error + 1e-9).all()


class TestLoads:
    """Gravity and dead forces are given in the world."""

    @pytest.mark.parametrize("points", POINTS)
    def test_gravity_pulls_down_in_the_world(self, points):
        lce = sr.designs.lce_arm()
        base = sr.Base(points=points)
        posed = lce.replace(base=base, loads=sr.Loads(payload=0.001))
        gravity = base.rotation.T @ (0.0, 0.0, -9.81)
        upright = lce.replace(loads=sr.Loads(gravity=gravity, payload=0.001))
        gamma = in_box(lce, 20)
        tips, status = as_tip_map(posed).tips_and_status(gamma)
        expected, there = as_tip_map(upright).tips_and_status(gamma)
        np.testing.assert_array_equal(status, there)
        np.testing.assert_array_equal(tips, base.to_world(expected))

    def test_a_hanging_arm_is_longer_and_an_upright_one_shorter(self):
        lce = sr.designs.lce_arm().replace(loads=sr.Loads())
        up, down = (rest(lce.replace(base=sr.Base(points=word))) for word in ("up", "down"))
        assert 0 < up.tip[2] < lce.length < -down.tip[2]

    def test_every_load_that_does_not_follow_the_tip_is_turned(self, loaded):
        upright, posed = loaded
        gamma = in_box(upright, 10)
        tips = sr.tip_positions(posed, gamma)
        np.testing.assert_allclose(tips, POSE.to_world(sr.tip_positions(upright, gamma)), atol=1e-9)
        one, other = (sr.configuration(arm, gamma, 5) for arm in (upright, posed))
        np.testing.assert_allclose(other.position, POSE.to_world(one.position.values), atol=1e-8)
        np.testing.assert_allclose(other.curvature, one.curvature, atol=1e-6)

    def test_compliances_turn(self, loaded):
        upright, posed = loaded
        gamma, turn = in_box(upright, 10), POSE.rotation
        matrices = tip_compliance(posed, gamma)
        expected = turn @ tip_compliance(upright, gamma) @ turn.T
        np.testing.assert_allclose(matrices, expected, rtol=0, atol=1e-8 * np.abs(expected).max())
        cloud = sr.compute_cloud(posed, 50)
        found = cloud_compliance(cloud).compliance
        expected = tip_compliance(posed, cloud.activation.values)
        np.testing.assert_allclose(found, expected, rtol=1e-12)
        in_base = tip_compliance(as_tip_map(posed, frame="base"), gamma)
        np.testing.assert_allclose(turn @ in_base @ turn.T, matrices, atol=1e-12)

    def test_blocked_forces_are_those_of_the_turned_question(self):
        arm = rubber(sr.designs.minimal_trunk().with_bounds((-0.6, 0)), sr.Loads(payload=0.05))
        gravity = POSE.directions_to_base((0.0, 0.0, -9.81))
        upright = arm.replace(loads=arm.loads.replace(gravity=gravity))
        posed, start = arm.replace(base=POSE), [-0.3, -0.2, -0.25]
        along = np.array([1.0, 0.5, 0.2])
        one = blocked_force(upright, None, along, start=start)
        other = blocked_force(posed, None, POSE.directions_to_world(along), start=start)
        np.testing.assert_allclose(one.force, other.force, rtol=1e-6)
        turned = POSE.directions_to_world(one.tip_force.values)
        np.testing.assert_allclose(other.tip_force, turned, rtol=1e-6)
        np.testing.assert_allclose(other.position, POSE.to_world(one.position.values), atol=1e-8)

    def test_all_equilibria_stand_in_the_world(self):
        heavy = rubber(sr.designs.minimal_trunk(), sr.Loads(payload=0.3))
        base = sr.Base(position=(0.1, 0.2, 0.3), points="x")
        posed = heavy.replace(base=base)
        gravity = base.directions_to_base((0.0, 0.0, -9.81))
        upright = heavy.replace(loads=heavy.loads.replace(gravity=gravity))
        one, other = (sr.equilibria(arm, [-0.2, -0.1, -0.4]) for arm in (upright, posed))
        np.testing.assert_array_equal(other.tips, base.to_world(one.tips))
        shapes, turned = (each.configuration(11).position.values for each in (one, other))
        np.testing.assert_array_equal(turned, base.to_world(shapes))
        assert other.to_dataset().attrs["frame"] == "world"


class TestFrames:
    """What is asked in the frame of the base is what the upright arm says."""

    def test_places_are_told_in_the_frame_that_is_asked_for(self, trunk, posed):
        gamma = in_box(trunk, 10)
        expected = sr.tip_positions(trunk, gamma)
        np.testing.assert_array_equal(sr.tip_positions(posed, gamma, frame="base"), expected)
        twists = sr.tip_jacobian(posed, gamma, frame="base")
        np.testing.assert_array_equal(twists, sr.tip_jacobian(trunk, gamma))
        shape = sr.configuration(posed, gamma[0], frame="base")
        np.testing.assert_array_equal(shape.position, sr.configuration(trunk, gamma[0]).position)
        found = sr.solve_inverse(posed, expected, frame="base")
        np.testing.assert_array_equal(found.nearest, sr.solve_inverse(trunk, expected).nearest)
        assert found.to_dataset().attrs["frame"] == "base"
        reached = sr.reachable_set(posed, accuracy=0.1, frame="base")
        assert reached.volume == sr.reachable_set(trunk, accuracy=0.1).volume

    def test_a_tip_map_goes_to_the_base_and_stays_there(self, posed):
        world, base = as_tip_map(posed), as_tip_map(posed, frame="base")
        assert (world.frame, base.frame) == ("world", "base")
        assert as_tip_map(world, frame="base") == base
        assert as_tip_map(base) is base
        assert free_bundles(world).frame == "world"

    def test_there_are_no_other_frames(self, posed):
        for ask in (as_tip_map, lambda arm, frame: sr.compute_cloud(arm, 10, frame=frame)):
            with pytest.raises(InvalidInput, match=r"frame = .*tip.*must be one of world, base"):
                ask(posed, frame="tip")

    def test_datasets_say_their_frame_and_carry_the_pose(self, posed):
        for frame in ("world", "base"):
            cloud = sr.compute_cloud(posed, 10, frame=frame)
            assert cloud.attrs["frame"] == frame
        rotation = np.reshape(cloud.attrs["base_rotation"], (3, 3))
        tips = cloud.tip.values @ rotation.T + cloud.attrs["base_position"]
        np.testing.assert_allclose(tips, sr.compute_cloud(posed, 10).tip, atol=1e-15)

    @pytest.mark.parametrize("frame", ["world", "base"])
    def test_a_stored_cloud_goes_on_in_its_frame(self, posed, tmp_path, frame):
        from softreach.cloud.clouds import tip_map_of

        sr.save_cloud(sr.compute_cloud(posed, 10, frame=frame), tmp_path / "cloud.zarr")
        cloud = sr.open_cloud(tmp_path / "cloud.zarr")
        tips = tip_map_of(cloud).tips(cloud.activation.values)
        np.testing.assert_array_equal(tips, cloud.tip)

    @pytest.mark.parametrize(
        "attrs", [{"frame": "tip"}, {"base_position": [1, 0, 0]}, {"base_rotation": "up"}], ids=str
    )
    def test_a_frame_that_is_none_or_another_pose_is_refused(self, trunk, tmp_path, attrs):
        cloud = sr.compute_cloud(trunk, 10).assign_attrs(attrs)
        cloud.attrs = {name: value for name, value in cloud.attrs.items() if value is not None}
        with pytest.raises(InvalidInput, match=f"attrs.*{next(iter(attrs))}"):
            sr.save_cloud(cloud, tmp_path / "cloud.zarr")
