"""Directions of the tip: all at one place, counted in cells of a cloud, and what a camera sees."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.cloud.dexterity import capability_map, sight
from softreach.inverse import directions_at, solve_inverse
from softreach.rod import as_tip_map
from softreach.workspace.search import CLOSELY, nearest_tips
from tests.laws import in_box


def angles_to_nearest(directions, others):
    """Of each of others the angle [rad] to the nearest of directions."""
    cosine = (others @ directions.T).max(axis=1)
    return np.arccos(cosine.clip(-1.0, 1.0))


@pytest.mark.parametrize("arm", [designs.redundant_trunk(), designs.three_tendon_robot(segments=2)])
def test_no_pose_at_a_place_has_a_direction_far_from_those_found(arm):
    """Random activations led to the place are an independent cover of its poses."""
    tip_map, near = as_tip_map(arm), in_box(arm, 100_000, seed=1)
    place = tip_map.tips(in_box(arm, 1, seed=0))[0]
    near = near[np.linalg.norm(tip_map.tips(near) - place, axis=1) < 0.05 * arm.length][:500]
    target = np.broadcast_to(place, (len(near), 3)).copy()
    ends = nearest_tips(tip_map, near, target, 1e-10 * arm.length, CLOSELY)
    others = ends.gamma[ends.distance <= 1e-10 * arm.length]
    assert len(others) > 20
    for spacing in (0.1, 0.2):
        poses = directions_at(arm, place, spacing=spacing)
        activation = poses.activation.values
        assert np.abs(tip_map.tips(activation) - place).max() <= 1e-10 * arm.length
        np.testing.assert_allclose(tip_map.tip_directions(activation), poses.direction, atol=1e-12)
        low, high = arm.input_bounds.T
        assert (low <= activation).all()
        assert (activation <= high).all()
        off = angles_to_nearest(poses.direction.values, tip_map.tip_directions(others))
        assert off.max() <= poses.direction_error


def test_directions_of_three_bundles_are_those_of_all_solutions(trunk):
    place = as_tip_map(trunk).tips(in_box(trunk, 1, seed=2))[0]
    poses = directions_at(trunk, place)
    np.testing.assert_array_equal(poses.activation, solve_inverse(trunk, place)[0].activations)
    assert poses.direction_error == 0.0
    with pytest.raises(sr.NotPossible, match="does not reach the place"):
        directions_at(trunk, [0.0, 0.0, 2.0 * trunk.length])
    with pytest.raises(sr.InvalidInput, match=r"place.shape = \(2, 3\)"):
        directions_at(trunk, np.zeros((2, 3)))


def test_a_capability_map_counts_each_sample_at_its_nearest_direction(trunk):
    cloud = sr.compute_cloud(trunk, 2000)
    axes = np.concatenate([np.eye(3), -np.eye(3)])
    capability = capability_map(cloud, cell=0.2 * trunk.length, directions=axes)
    assert capability.samples.sum() == 2000
    d3 = as_tip_map(trunk).tip_directions(cloud.activation.values)
    nearest = np.abs(d3).argmax(axis=1) + 3 * (d3[np.arange(2000), np.abs(d3).argmax(axis=1)] < 0)
    counts = capability.samples.sum(("x", "y", "z")).values
    np.testing.assert_array_equal(counts, np.bincount(nearest, minlength=6))
    np.testing.assert_allclose(capability.capability, (capability.samples > 0).mean("direction"))


def test_evenly_spread_directions_share_the_sphere(trunk):
    toward = capability_map(sr.compute_cloud(trunk, 100), directions=400).toward.values
    np.testing.assert_allclose(np.linalg.norm(toward, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(toward.mean(axis=0), 0.0, atol=3e-3)
    np.testing.assert_allclose(toward.T @ toward / 400, np.eye(3) / 3.0, atol=3e-3)


def test_a_ball_is_seen_where_the_ray_along_the_tip_hits_it(trunk):
    cloud = sr.compute_cloud(trunk, 500)
    place, radius = np.array([0.1, 0.2, 0.5]) * trunk.length, 0.1 * trunk.length
    angle = sight(cloud, place, radius=radius).values
    tips, d3 = cloud.tip.values, as_tip_map(trunk).tip_directions(cloud.activation.values)
    along = np.einsum("ni,ni->n", place - tips, d3).clip(0.0)
    passed = np.linalg.norm(tips + along[:, None] * d3 - place, axis=1)
    np.testing.assert_array_equal(angle <= 1e-12, passed <= radius * (1.0 + 1e-12))
    aimed = place - tips
    cosine = np.einsum("ni,ni->n", aimed, d3) / np.linalg.norm(aimed, axis=1)
    np.testing.assert_allclose(sight(cloud, place), np.arccos(cosine), atol=1e-9)
