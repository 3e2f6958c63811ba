"""The inverse problem and paths of arms whose loads leave some activations no stable rest."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import Loads, designs
from softreach.arm.manipulator import Manipulator
from softreach.inverse import PathStatus, Status, prepared_map, solve_inverse
from softreach.inverse.path import track_path
from softreach.rod import tip_map
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.tip_map import TipStatus
from softreach.support.errors import InvalidInput
from tests.bodies import by_lines, oracle_rod, rubber
from tests.oracles import loaded_rod

TARGETS = slice(40, 60)  # with one tip of several stable activations among them


def loaded(arm: Manipulator) -> LoadedRod:
    """The tip map that has equilibria."""
    rod = tip_map(arm)
    assert isinstance(rod, LoadedRod)
    return rod


def hanging(payload: float, **loads) -> Manipulator:
    return designs.lce_arm().replace(
        loads=Loads(gravity=(0.0, 0.0, 9.81), payload=payload, **loads)
    )


@pytest.fixture(scope="module")
def heavy() -> Manipulator:
    """An arm that hangs: every activation has a stable posture, and some places have two."""
    return hanging(0.020)


@pytest.fixture(scope="module")
def samples(heavy):
    """Random activations with their equilibria."""
    gamma = np.random.default_rng(0).uniform(heavy.bounds[:, 0], heavy.bounds[:, 1], (20_000, 3))
    return gamma, loaded(heavy).equilibria(gamma)


@pytest.fixture(scope="module")
def stable(heavy, samples):
    """Stable activations, the tips that they are solved for, and the answers."""
    gamma, found = samples
    gamma = gamma[found.status == TipStatus.STABLE][TARGETS]
    targets = tip_map(heavy).tips_and_slopes(gamma)[0]
    return gamma, targets, solve_inverse(heavy, targets)


@pytest.mark.parametrize(
    "loads",
    [
        Loads(gravity=(0.0, 0.0, 9.81), payload=0.004, tip_force=(0.01, 0.0, 0.0)),
        Loads(gravity=(0.0, 0.0, 9.81), follower_force=(0.02, 0.0, -0.01)),
    ],
)
def test_tips_under_general_loads_are_solved_back(loads):
    arm = designs.lce_arm().replace(loads=loads)
    gamma = np.random.default_rng(1).uniform(arm.bounds[:, 0], arm.bounds[:, 1], (8, 3))
    solutions = solve_inverse(arm, tip_map(arm).tips(gamma))
    for solution, wanted in zip(solutions, gamma, strict=True):
        assert solution.status is Status.REACHED
        assert np.abs(solution.activations - wanted).max(axis=1).min() < 1e-6


def test_stable_tips_are_solved_back_to_their_activations(stable):
    gamma, _, solutions = stable
    assert (solutions.statuses == Status.REACHED).all()
    missed = [
        np.abs(solution.activations - wanted).max(axis=1).min()
        for solution, wanted in zip(solutions, gamma, strict=True)
    ]
    assert max(missed) < 1e-6


def test_some_tips_have_several_stable_activations(stable):
    solutions = stable[2]
    assert (solutions.counts > 1).any()


def test_every_root_is_a_stable_equilibrium_at_its_target(heavy, stable):
    _, targets, solutions = stable
    found = loaded(heavy).equilibria(solutions.activations)
    assert (found.status == TipStatus.STABLE).all()
    missed = np.linalg.norm(found.tips - np.repeat(targets, solutions.counts, axis=0), axis=1)
    assert missed.max() <= 1e-6 * heavy.length
    assert solutions.residuals.max() <= 1e-10 * heavy.length


def test_roots_are_where_lines_from_rest_lead(heavy, stable):
    rod, gamma = loaded(heavy), stable[2].activations[:100]
    slowly = by_lines(rod.solver, gamma)
    assert (slowly.status == TipStatus.STABLE).all()
    assert np.abs(slowly.tips - rod.tips(gamma)).max() <= 1e-6 * heavy.length


def test_a_shooting_from_the_base_puts_the_tip_of_a_root_at_its_target(heavy, stable):
    _, targets, solutions = stable
    several = np.flatnonzero(solutions.counts > 1)[0]
    for gamma in solutions[several].activations:
        asked = oracle_rod(heavy, loaded(heavy).body, gamma, heavy.loads)
        tip = loaded_rod.equilibrium(*asked, rtol=1e-10).tip
        assert np.linalg.norm(tip - targets[several]) <= 1e-6 * heavy.length


def test_nothing_is_proved_of_a_loaded_arm(heavy):
    far = solve_inverse(heavy, [[10 * heavy.length, 0.0, 0.0]])[0]
    assert far.status is Status.NOT_FOUND
    assert far.gap_bound == 0.0
    nearest = loaded(heavy).equilibria(far.nearest_activation[None])
    assert nearest.status[0] == TipStatus.STABLE
    assert np.linalg.norm(nearest.tips[0] - far.nearest) <= 1e-6 * heavy.length


def test_an_arm_without_any_stable_equilibrium_is_refused(monkeypatch):
    """A stubby one whose payload squeezes it to nothing; all of a coarse grid are tried."""
    monkeypatch.setattr("softreach.inverse.seeds._MOST", 1000)
    arm = designs.minimal_trunk(taper=0.0, length=0.2)
    arm = arm.replace(profile=arm.profile.replace(outer_radius=0.1))
    held = arm.with_bounds(np.full((3, 2), [-1e-3, 0.0]))
    heavy = prepared_map(rubber(held, Loads(payload=4000.0)), cells=4)
    with pytest.raises(InvalidInput, match="has a stable equilibrium"):
        solve_inverse(heavy, [[0.0, 0.0, 0.05]])


@pytest.fixture(scope="module")
def aside() -> Manipulator:
    """An arm that is held aside and snaps: a few activations are not reached from rest."""
    return designs.lce_arm().replace(loads=Loads(gravity=(9.81, 0.0, 0.0), payload=0.005))


@pytest.fixture(scope="module")
def torn(aside):
    """A path of tips of a line of activations that ends where the arm snaps, and on as it went: the
    places, the number of the last stable one, and the path as it was followed."""
    rod = loaded(aside)
    gamma = np.random.default_rng(0).uniform(*aside.bounds.T, (10_000, 3))
    found = rod.equilibria(gamma)
    lost = gamma[found.status == TipStatus.SNAPS][1]
    near = np.argsort(np.linalg.norm(gamma - lost, axis=1))[:30]
    start = gamma[near[found.status[near] == TipStatus.STABLE][-1]]
    line = start + np.linspace(0.0, 1.0, 41)[:, None] * (lost - start)
    last = int(np.argmax(rod.status(line) != TipStatus.STABLE)) - 1
    tips = rod.tips_and_slopes(line[: last + 1])[0]
    beyond = tips[-1] + np.arange(1, 20)[:, None] * (tips[-1] - tips[-2])
    path = np.concatenate([tips, beyond])
    return path, last, track_path(aside, path, line[0])


def test_a_path_into_an_edge_of_stability_ends_there_by_name(aside, torn):
    rod, (_, last, track) = loaded(aside), torn
    assert track.attrs["end"] == "unstable"
    assert (track.status[track.status != PathStatus.FOLLOWED] == PathStatus.UNSTABLE).all()
    followed = int((track.status == PathStatus.FOLLOWED).sum())
    assert followed >= last
    assert 0.0 < float(track.end_length_error) <= 1e-6 * aside.length
    on_branch = track.activation.values[:followed]
    assert (rod.status(on_branch) == TipStatus.STABLE).all()
    end = track.end_activation.values
    assert rod.status(end[None])[0] == TipStatus.STABLE
    # beyond, where the Jacobian at the end leads, there is none to go to, or it is elsewhere
    path = track.position.values
    ahead = (path[followed] - path[followed - 1]) / np.linalg.norm(path[1] - path[0])
    tip, slope = (x[0] for x in rod.tips_and_slopes(end[None]))
    step = 1e-4 * aside.length * ahead / np.linalg.norm(ahead)
    there = rod.equilibria((end + np.linalg.solve(slope, step))[None])
    missed = np.linalg.norm(there.tips[0] - tip - step)
    assert there.status[0] != TipStatus.STABLE or missed > 0.1 * np.linalg.norm(step)


def test_the_end_of_a_path_is_where_its_length_says(aside, torn):
    path, _, track = torn
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    at = [np.interp(float(track.end_length), lengths, x) for x in path.T]
    assert np.allclose(at, track.end_position, atol=1e-9 * aside.length)
