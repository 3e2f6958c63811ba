"""Laws of points: a marker in place of the tip moves as a stiff body with its section."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Base, Drive, Marker
from softreach.inverse.path import track_path
from softreach.rod import as_tip_map, marker_positions
from softreach.rod.rods import in_steps, measured_bundles
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.laws import in_box

LENGTH, TOOL = 0.2, 0.05
BESIDE = Marker(name="beside", offset=(0.02, -0.01, 0.03))
AHEAD = Marker(name="tool", offset=(0.0, 0.0, TOOL))
INSIDE = Marker(name="inside", station_over_length=0.6, offset=(0.0, 0.01, 0.0))


def arm(**others) -> sr.Manipulator:
    """Three tendons in a silicone rod of 0.2 m."""
    matter = sr.arm.named_material("dragon_skin_10")
    values = {
        "profile": sr.LinearTaper(length=LENGTH, outer_radius=0.01),
        "section": sr.Section(rings=(sr.Ring(inner_ratio=0.0, material=matter),)),
        "actuators": (sr.Tendon(bundles=3, distance=0.008, activation_bounds=(0.0, 2.0)),),
        "markers": (BESIDE, AHEAD, INSIDE),
    }
    return sr.Manipulator(**values | others)


HANGING = Base(position=(0.3, -0.2, 1.5), points="down", turn=0.7)
ARMS = {
    "free": arm(base=HANGING),
    "loaded": arm(base=HANGING, loads=sr.Loads(payload=0.003)),
    "driven": arm(
        base=HANGING, drives=(Drive(name="a", gains={"tendon 1 1": 1.5}, bounds=(0, 1)),)
    ),
}
NAMES = ["beside", "tool", "inside"]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("made", ARMS.values(), ids=ARMS)
def test_a_point_is_where_its_marker_is_and_moves_as_it_does(made, name):
    rod, k = (
        as_tip_map(made, 1e-9, point=name),
        [marker.name for marker in made.markers].index(name),
    )
    gamma, step = 0.9 * in_box(made, 10) + 0.05 * rod.box.widths, 1e-4
    places = marker_positions(made, gamma, 1e-9)[:, k]
    np.testing.assert_allclose(rod.tips(gamma), places, atol=2e-9 * LENGTH)
    tips, slopes = rod.tips_and_slopes(gamma)
    np.testing.assert_allclose(tips, places, atol=2e-9 * LENGTH)
    for j in range(rod.box.bundles):
        moved = [
            marker_positions(made, gamma + h * np.eye(rod.box.bundles)[j], 1e-9)[:, k]
            for h in (step, -step)
        ]
        expected = (moved[0] - moved[1]) / (2 * step)
        np.testing.assert_allclose(slopes[..., j], expected, atol=3e-6 * LENGTH)
    twisted, twists = rod.tip_twists(gamma)
    linear = twists[:, :3] + np.cross(twists[:, 3:], twisted[..., None], axis=1)
    np.testing.assert_allclose(linear, slopes, atol=1e-10)


@pytest.mark.parametrize("tol", [1e-4, 1e-7])
@pytest.mark.parametrize("name", NAMES)
def test_the_tolerance_is_that_of_the_point(name, tol):
    exact, gamma = as_tip_map(ARMS["free"], 1e-11, point=name), in_box(ARMS["free"], 500)
    apart = as_tip_map(ARMS["free"], tol, point=name).tips(gamma) - exact.tips(gamma)
    assert np.linalg.norm(apart, axis=1).max() <= tol * LENGTH


@pytest.mark.parametrize("name", NAMES)
def test_bounds_of_the_linearization_hold_for_points(name):
    rod = as_tip_map(ARMS["free"], 1e-9, point=name)
    rng, half = np.random.default_rng(2), 0.1 * rod.box.widths
    centers = rod.box.from_cube(rng.uniform(0.1, 0.9, (200, 3)))
    change = half * rng.uniform(-1, 1, (200, 3))
    tips, slopes = rod.tips_and_slopes(centers)
    error = rod.tips(centers + change) - tips - np.einsum("nij,nj->ni", slopes, change)
    error = np.linalg.norm(error, axis=1)
    assert (error <= rod.linearization_errors(centers, half)).all()
    assert error.max() <= rod.linearization_error(half)
    assert np.linalg.norm(tips - np.array(HANGING.position), axis=1).max() <= rod.farthest()


def test_the_reach_of_a_tool_is_that_of_an_arm_that_ends_rigidly():
    """The volume of cases of public questions: 2239.816 mL, by an integral of |det J|."""
    plain = sr.reachable_set(arm(), accuracy=0.01)
    reached = sr.reachable_set(arm(), accuracy=0.01, point="tool")
    assert plain.volume * 1e6 == pytest.approx(1043.683, abs=0.01)
    assert reached.volume * 1e6 == pytest.approx(2239.816, abs=1e-3 + reached.volume_error * 1e6)


def test_inverse_paths_and_clouds_are_of_the_point():
    made, gamma = arm(), np.array([[0.4, 0.9, 1.3], [0.5, 1.0, 1.2]])
    targets = marker_positions(made, gamma)[:, 0]
    for target, wanted, found in zip(
        targets, gamma, sr.solve_inverse(made, targets, point="beside"), strict=True
    ):
        assert np.abs(found.activations - wanted).max(axis=1).min() < 1e-6, target
    path = track_path(made, targets, gamma[0], point="beside")
    np.testing.assert_allclose(path.activation[-1], gamma[1], atol=1e-6)
    cloud = sr.compute_cloud(made, 50, point="beside")
    again = sr.cloud.tip_map_of(cloud)
    np.testing.assert_array_equal(cloud.tip, again.tips(cloud.activation.values))
    places = marker_positions(made, cloud.activation.values)[:, 0]
    np.testing.assert_allclose(cloud.tip, places, atol=1e-6 * LENGTH)


def test_a_point_is_part_of_the_design_and_of_its_file():
    made = arm(point="tool")
    assert sr.Manipulator.from_toml(made.to_toml()) == made != arm()
    assert as_tip_map(made) == as_tip_map(arm(), point="tool")
    assert measured_bundles(as_tip_map(made)).point == AHEAD
    assert in_steps(made, 9, as_tip_map(made)).point == AHEAD


def test_unknown_points_are_refused_in_one_line():
    with pytest.raises(InvalidInput, match=r"^point = 'tol': must be a marker of the arm: be"):
        sr.reachable_set(arm(), point="tol")
    with pytest.raises(
        InvalidInput, match="point = 'tool': must be left out: the arm has no markers"
    ):
        sr.compute_cloud(arm(markers=()), 10, point="tool")
    with pytest.raises(InvalidDesign, match="point = 'x': must be a marker of the arm"):
        arm(point="x")
    with pytest.raises(InvalidInput, match="point = tool: must be left out: this is known of"):
        sr.stiffness.tip_compliance(arm(point="tool"), [[0.0, 0.0, 0.0]])
