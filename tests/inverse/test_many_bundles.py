"""Four bundles and more: what is reached is found, what is called unreachable is so."""

import numpy as np
import pytest
from benchmarks.adversarial_inverse import PLACES, activations, random_design

from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.manipulator import Manipulator
from softreach.inverse import Solutions, Status, solve_inverse
from softreach.rod import tip_positions
from tests.laws import in_box


def six_bundles() -> Manipulator:
    fibers = [
        FiberArchitecture(
            revolution=np.radians(turn), extent=np.radians(40), offset=np.radians(at), bundles=3
        )
        for turn, at in ((90, 90), (-90, 30))
    ]
    return Manipulator.tapered(
        length=1.0,
        outer_radius=0.06,
        inner_radius=0.03,
        taper=np.radians(1),
        poisson_ratio=0.4,
        actuators=tuple(fibers),
        activation_bounds=(-1.2, 0.1),
    )


def changes(found: Solutions, near: np.ndarray | float = 0.0) -> np.ndarray:
    """|γ - near| of the first activation of every target."""
    return np.linalg.norm(found.activations[found.offsets[:-1]] - near, axis=1)


def test_an_activation_on_a_face_that_was_missed_is_reached_with_and_without_itself_as_near():
    arm, gamma = designs.redundant_trunk(), np.array([-0.42, 0.0, -5 / 3, 0.0])
    target = tip_positions(arm, gamma[None])
    for near in (None, gamma):
        found = solve_inverse(arm, target, near=near)
        assert found.statuses[0] == Status.REACHED
        assert found.residuals[0] <= 1e-10
    assert changes(found, gamma)[0] <= 1e-9


@pytest.mark.parametrize("design", [designs.redundant_trunk, six_bundles, *range(4)])
@pytest.mark.parametrize("place", PLACES)
def test_every_tip_of_an_activation_inside_the_box_is_reached(design, place):
    is_random = isinstance(design, int)
    arm = random_design(4 + 2 * design, design) if is_random else design()
    gamma = activations(arm, 8 if is_random else 40, place, seed=3)
    found = solve_inverse(arm, tip_positions(arm, gamma))
    assert (found.statuses == Status.REACHED).all()
    assert found.residuals.max() <= 1e-10
    assert (found.margins >= 0).all()


@pytest.mark.parametrize("design", [designs.redundant_trunk, six_bundles])
def test_the_answer_is_never_farther_from_near_than_near_itself(design):
    arm = design()
    gamma = activations(arm, 80, "faces", seed=1)
    found = solve_inverse(arm, tip_positions(arm, gamma), near=gamma)
    assert (found.statuses == Status.REACHED).all()
    assert changes(found, gamma).max() <= 1e-9


def test_a_gap_is_never_smaller_than_its_proved_bound():
    from scipy.spatial import KDTree

    arm = designs.redundant_trunk()
    targets = np.random.default_rng(0).uniform(-1, 1, (50, 3))
    found = solve_inverse(arm, targets)
    out = found.statuses == Status.UNREACHABLE
    assert out.sum() > 25
    assert (found.gap_bounds[out] > 0).all()
    assert (found.gap_bounds <= found.gaps).all()
    cloud = KDTree(tip_positions(arm, in_box(arm, 50_000))).query(targets)[0]
    assert (found.gap_bounds <= cloud).all()
    assert (found.gaps[out] <= cloud[out]).all()
    assert not found.gap_bounds[found.statuses == Status.REACHED].any()


def test_what_is_neither_reached_nor_proved_to_be_out_of_reach_is_not_found():
    arm = random_design(12, 0)
    beyond, near = solve_inverse(arm, [[0.0, 0.0, 3.0], [0.0, 0.0, -0.9]])
    assert beyond.status is Status.UNREACHABLE
    assert 0 < beyond.gap_bound <= beyond.gap
    assert near.status is Status.NOT_FOUND
    assert near.gap_bound == 0.0
    assert near.gap > 0


def curling() -> Manipulator:
    """Three bundles that curl the arm past a full circle."""
    fiber = FiberArchitecture(
        revolution=0.0, extent=np.radians(80), offset=np.radians(10), bundles=3
    )
    return Manipulator.tapered(
        length=1.0,
        outer_radius=0.05,
        inner_radius=0.02,
        taper=0.0,
        poisson_ratio=0.5,
        actuators=(fiber,),
        activation_bounds=(-1.2, 0.6),
    )


def test_three_bundles_that_curl_past_a_full_circle_are_solved_back_in_their_curved_valley():
    arm = curling()
    gamma = np.array([[0.0935, -0.788, -0.5483], [-0.57375, 0.22242, -0.29914]])
    found = solve_inverse(arm, tip_positions(arm, np.concatenate([gamma, in_box(arm, 20)])))
    assert (found.statuses == Status.REACHED).all()
    assert np.abs(found.activations[found.offsets[:2]] - gamma).max() < 1e-3
    gamma = np.array(
        [
            [0.24244592838306245, -0.324646775265757, -0.532496151226835],
            [-0.498381226396028, 0.2545431313765669, -0.07414647790786222],
            [0.042045327546517575, 0.5702426072756839, 0.5255977928794151],
            [0.4230666950698063, -1.1074347983651538, 0.07292151290002868],
        ]
    )
    found = solve_inverse(arm, tip_positions(arm, gamma))
    assert (found.statuses == Status.REACHED).all()
    assert found.conditions.min() > 1e6


def test_many_bundles_are_solved_alike_alone_and_among_others():
    arm = six_bundles()
    targets = tip_positions(arm, activations(arm, 40, "faces", seed=2))
    together = solve_inverse(arm, targets)
    for i in (0, 17, 39):
        alone = solve_inverse(arm, targets[i : i + 1])[0]
        assert np.array_equal(alone.activations, together[i].activations)
