"""Tips on the boundary of what an arm reaches: what the error of tips leaves open is reached."""

import numpy as np
import pytest
from benchmarks.adversarial_inverse import activations, boundary_tips, bounded_design

from softreach.arm import Loads, designs
from softreach.inverse import PathStatus, Status, solve_inverse
from softreach.inverse.path import Drag, track_path
from softreach.rod import as_tip_map, tip_positions

TOL = 1e-6


@pytest.fixture(scope="module")
def hanging():
    """The laboratory's arm with 2 g at its tip."""
    return designs.lce_arm().replace(loads=Loads(gravity=(0.0, 0.0, 9.81), payload=0.002))


def check_reached(arm, targets, tol):
    """All are reached, with residuals that are true and within the error of tips."""
    found = solve_inverse(arm, targets, tol=tol)
    assert (found.statuses == Status.REACHED).all()
    assert found.residuals.max() <= tol * arm.length
    tips = as_tip_map(arm, tol).tips_and_slopes(found.activations)[0]
    missed = np.linalg.norm(tips - np.repeat(targets, found.counts, axis=0), axis=1)
    assert np.abs(missed - found.residuals).max() <= 1e-11 * arm.length
    assert np.allclose(np.linalg.norm(found.nearest - targets, axis=1), found.gaps, atol=1e-10)
    assert not found.gap_bounds.any()
    return found


@pytest.mark.parametrize("place", ["corners", "faces"])
def test_tips_of_a_hanging_arm_on_its_bounds_are_solved_back(hanging, place):
    gamma = activations(hanging, 100, place)
    found = check_reached(hanging, tip_positions(hanging, gamma), TOL)
    for solution, wanted in zip(found, gamma, strict=True):
        assert np.abs(solution.activations - wanted).max(axis=1).min() < 1e-4


@pytest.mark.large
@pytest.mark.parametrize("bundles", [3, 4, 5])
def test_tips_of_arms_under_payload_on_their_bounds_are_reached(bundles):
    arm = bounded_design(bundles, bundles, loaded=True)
    targets = tip_positions(arm, activations(arm, 12, "faces"))
    check_reached(arm, targets[np.isfinite(targets[:, 0])], TOL)


@pytest.mark.parametrize(
    ("bundles", "tol"),
    [
        pytest.param(bundles, tol, marks=[] if (bundles + k) % 3 == 1 else [pytest.mark.large])
        for bundles in range(3, 9)
        for k, tol in enumerate([1e-3, 1e-6, 1e-9])
    ],
)
def test_exact_tips_on_bounds_are_reached_by_maps_of_any_tolerance(bundles, tol):
    arm = bounded_design(bundles, bundles, loaded=False)
    check_reached(arm, boundary_tips(arm, 10, tol)[1], tol)


@pytest.mark.parametrize("place", ["corners", "edges", "faces"])
def test_an_activation_on_a_bound_is_found_beside_others_that_lead_to_its_tip(place):
    arm = designs.minimal_trunk(np.radians(36), np.radians(3))
    gamma = activations(arm, 200, place)
    gamma = gamma[np.linalg.cond(as_tip_map(arm).tips_and_slopes(gamma)[1]) < 1e3]  # not at a fold
    found = check_reached(arm, tip_positions(arm, gamma, tol=1e-12), TOL)
    assert (found.counts > 1).any()
    for solution, wanted in zip(found, gamma, strict=True):
        apart = np.abs(solution.activations - wanted).max(axis=1)
        way = wanted + np.linspace(0, 1, 9)[:, None] * (
            solution.activations[apart.argmin()] - wanted
        )
        away = np.linalg.norm(tip_positions(arm, way) - solution.target, axis=1)
        assert away.max() <= 16 * TOL * arm.length


@pytest.mark.parametrize(
    "tol", [1e-4, *(pytest.param(tol, marks=pytest.mark.large) for tol in (1e-8, TOL))]
)
def test_a_proof_says_more_than_the_error_of_tips(trunk, tol):
    gamma = np.random.default_rng(0).uniform(*trunk.bounds.T, (20, 3))
    gamma[:, 0] = 0.0
    tips, slopes = as_tip_map(trunk, tol).tips_and_slopes(gamma)
    normal = np.cross(slopes[:, :, 1], slopes[:, :, 2])
    normal *= np.sign((normal * slopes[:, :, 0]).sum(axis=1))[:, None]
    normal *= tol * trunk.length / np.linalg.norm(normal, axis=1)[:, None]
    for distance in (0.1, 0.9, 1.1, 3.0, 30.0):
        found = solve_inverse(trunk, tips + distance * normal, tol=tol)
        gaps, bounds = found.gaps / trunk.length, found.gap_bounds / trunk.length
        assert ((found.statuses == Status.REACHED) == (gaps <= tol)).all()
        assert ((found.statuses == Status.UNREACHABLE) == (bounds > tol)).all()
        assert (bounds <= gaps).all()
        if distance < 1:
            assert (found.statuses == Status.REACHED).all()
    assert (found.statuses == Status.UNREACHABLE).mean() > 0.5


@pytest.mark.parametrize("bundle", [0, 1, 2])
@pytest.mark.parametrize("given", [True, False])
def test_a_path_that_leaves_the_set_by_less_than_the_error_of_tips_is_followed(
    trunk, bundle, given
):
    line = np.tile([-0.4, -0.9, -0.6], (6, 1)) + np.linspace(0.0, 0.01, 6)[:, None]
    for bound in trunk.bounds[bundle]:
        line[:, bundle] = bound
        path = tip_positions(trunk, line, tol=1e-9)
        track = track_path(trunk, path, line[0] if given else None, tol=1e-5)
        assert (track.status == PathStatus.FOLLOWED).all()
        assert float(track.tip_error.max()) <= 1e-5 * trunk.length
        assert np.abs(track.activation.values - line).max() < 1e-3


def test_a_path_on_the_bounds_of_a_hanging_arm_is_followed_unless_its_chords_leave_the_set(hanging):
    for length in (0.01, 0.1):
        line = np.array([-5.0, -2.0, -3.0]) + np.linspace(0, length, 12)[:, None] * [0, 1, -1]
        path = tip_positions(hanging, line)
        track = track_path(hanging, path, line[0])
        outside = solve_inverse(hanging, 0.5 * (path[:1] + path[1:2])).statuses[0] != Status.REACHED
        assert outside == (length == 0.1)
        assert track.attrs["end"] == ("bound" if outside else "end")
        followed = track.status.values == PathStatus.FOLLOWED
        assert np.abs(track.activation.values - line)[followed].max() < 1e-3


def test_a_drag_to_an_exact_tip_on_the_bounds_leaves_no_gap(trunk):
    low = trunk.bounds[0, 0]
    for gamma in ([low, -0.6, -0.7], [low, low, -0.6], [low, low, low]):
        target = tip_positions(trunk, [gamma], tol=1e-11)[0]
        dragged = Drag(trunk).to(tuple(np.array(gamma) + 0.01), target)
        assert dragged is not None
        assert dragged.gap == 0.0
