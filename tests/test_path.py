"""Following paths on one branch of solutions."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.inverse import Status, solve_inverse
from softreach.inverse.path import PathStatus, track_path
from softreach.rod import tip_map
from softreach.rod.kinematics import tip_positions
from softreach.support.errors import InvalidInput

BEGIN, END = np.array([-0.3, -0.9, -0.4]), np.array([-1.2, -0.2, -1.1])


@pytest.fixture(scope="module")
def images(trunk):
    """Activations on a line, and their tips."""
    gamma = BEGIN + np.linspace(0, 1, 12)[:, None] * (END - BEGIN)
    return gamma, tip_positions(trunk, gamma)


def test_the_image_of_a_line_is_followed_back(trunk, images):
    gamma, path = images
    track = track_path(trunk, path, start=BEGIN)
    assert track.attrs["end"] == ""
    assert (track.status == PathStatus.FOLLOWED).all()
    assert float(track.tip_error.max()) <= 1e-10
    assert np.abs(track.activation.values - gamma).max() < 1e-6


def test_a_path_forth_and_back_ends_where_it_began(trunk, images):
    path = np.concatenate([images[1], images[1][::-1]])
    track = track_path(trunk, path, start=BEGIN)
    assert np.abs(track.activation.values[-1] - BEGIN).max() < 1e-6


def test_a_branch_ends_where_a_bundle_reaches_its_bound(trunk, images):
    begin = images[1][0]
    path = np.linspace(begin, begin + [0.0, 0.0, 2.0], 20)
    track = track_path(trunk, path)
    assert track.attrs["end"] == "bound"
    bundle = list(track.bundle.values).index(track.attrs["end_bundle"])
    bound = trunk.bounds[bundle, 1 if track.attrs["end_bound"] == "upper" else 0]
    assert track.end_activation.values[bundle] == pytest.approx(bound, abs=1e-7)
    followed = track.status.values == PathStatus.FOLLOWED
    assert 0 < followed.sum() < 20
    assert np.isnan(track.activation.values[~followed]).all()
    beyond = track.end_position.values + [0.0, 0.0, 1e-4]
    assert solve_inverse(trunk, beyond[None])[0].status is Status.UNREACHABLE


def test_a_branch_ends_at_a_fold():
    arm = designs.minimal_trunk(np.radians(36), np.radians(3))
    rng, ends = np.random.default_rng(0), []
    for _ in range(12):
        gamma, way = rng.uniform(-5 / 3, 0, 3), rng.normal(size=3)
        begin = tip_positions(arm, gamma[None])[0]
        path = np.linspace(begin, begin + 0.5 * way / np.linalg.norm(way), 4)
        track = track_path(arm, path, start=gamma)
        ends.append(track.attrs["end"])
        if ends[-1] == "fold":
            slopes = tip_map(arm).tips_and_slopes(track.end_activation.values[None])[1][0]
            first = tip_map(arm).tips_and_slopes(gamma[None])[1][0]
            assert abs(np.linalg.det(slopes)) < 0.05 * abs(np.linalg.det(first))
    assert "fold" in ends
    assert "bound" in ends


def test_four_bundles_follow_where_three_would_stop(trunk, images):
    arm = designs.redundant_trunk()
    begin = images[1][0]
    path = np.linspace(begin, begin + [0.1, 0.0, 0.1], 5)
    track = track_path(arm, path)
    followed = track.status.values == PathStatus.FOLLOWED
    assert followed.sum() >= 2
    assert np.nanmax(track.tip_error.values) <= 1e-10
    gamma = track.activation.values[followed]
    assert (gamma >= arm.bounds[:, 0]).all()
    assert (gamma <= arm.bounds[:, 1]).all()


def test_a_first_point_out_of_reach_is_said(trunk):
    track = track_path(trunk, [[0.0, 0.0, 3.0], [0.0, 0.0, 1.0]])
    assert (track.status == PathStatus.NO_START).all()
    assert track.attrs["end"] == "no_start"


@pytest.mark.parametrize("path", [np.empty((0, 3)), [[0.0, 0.0, np.inf]], [0.0, 1.0]])
def test_what_is_no_path_is_refused(trunk, path):
    with pytest.raises(InvalidInput, match="path"):
        track_path(trunk, path)


def test_two_bundles_follow_no_path_in_space(trunk):
    with pytest.raises(InvalidInput, match="bundles"):
        track_path(trunk.replace(actuators=trunk.actuators[:2]), [[0.0, 0.0, 1.0]])


def test_a_path_says_how_it_was_made(trunk):
    track = track_path(trunk, [[0.0, 0.0, trunk.length]], tol=1e-5, residual_over_length=1e-8)
    assert type(trunk).from_toml(track.attrs["design"]) == trunk
    assert (track.attrs["tol"], track.attrs["residual_over_length"]) == (1e-5, 1e-8)
    assert track.attrs["softreach_version"]
