"""The inverse problem and paths of arms whose loads leave some activations no stable rest."""

from pathlib import Path

import numpy as np
import pytest

from softreach.arm import Loads, designs
from softreach.arm.manipulator import Manipulator
from softreach.arm.stations import Marker
from softreach.inverse import PathStatus, Status, prepared_map, solve_inverse
from softreach.inverse.path import Drag, track_path
from softreach.rod import as_tip_map
from softreach.rod.kinematics import configuration
from softreach.rod.loaded.all_equilibria import equilibria
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.tip_map import TipStatus
from softreach.support.errors import InvalidInput, NotPossible
from tests.bodies import DOWN, SIDE, by_lines, oracle_rod, rubber
from tests.oracles import loaded_rod

EXAMPLES = Path(__file__).parents[2] / "examples"


def loaded(arm: Manipulator) -> LoadedRod:
    """The tip map that has equilibria."""
    rod = as_tip_map(arm).rod
    assert isinstance(rod, LoadedRod)
    return rod


def hanging(payload: float, gravity=DOWN) -> Manipulator:
    return designs.lce_arm().replace(loads=Loads(gravity=gravity, payload=payload))


@pytest.fixture(scope="module")
def heavy() -> Manipulator:
    """An arm that hangs: every activation has a stable posture, and some places have two."""
    return hanging(0.020)


@pytest.fixture(scope="module")
def stable(heavy):
    """Stable activations, the tips that they are solved for, and the answers."""
    gamma = np.random.default_rng(0).uniform(*heavy.bounds.T, (200, 3))
    gamma = gamma[loaded(heavy).status(gamma) == TipStatus.STABLE][40:60]
    targets = as_tip_map(heavy).tips_and_slopes(gamma)[0]
    return gamma, targets, solve_inverse(heavy, targets)


def test_a_marker_of_a_loaded_arm_has_a_target_in_postures_from_rest():
    arm = hanging(0.0).replace(markers=(Marker(name="elbow", station_over_length=0.5),))
    gamma = np.random.default_rng(0).uniform(*arm.bounds.T, (2, 3))
    elbow = {"elbow": as_tip_map(arm, point="elbow").tips_and_slopes(gamma)[0]}
    targets = as_tip_map(arm).tips_and_slopes(gamma)[0]
    solutions = solve_inverse(arm, targets, markers=elbow)
    np.testing.assert_allclose(solutions.activations, gamma, rtol=0, atol=1e-6)
    with pytest.raises(NotPossible, match="straight from rest"):
        solve_inverse(solutions[0].posture(), targets, markers=elbow)


@pytest.mark.parametrize(
    "loads",
    [
        Loads(gravity=DOWN, payload=0.004, tip_force=(0.01, 0.0, 0.0)),
        Loads(gravity=DOWN, follower_force=(0.02, 0.0, -0.01)),
    ],
)
def test_tips_under_general_loads_are_solved_back(loads):
    arm = designs.lce_arm().replace(loads=loads)
    gamma = np.random.default_rng(1).uniform(arm.bounds[:, 0], arm.bounds[:, 1], (8, 3))
    solutions = solve_inverse(arm, as_tip_map(arm).tips(gamma))
    for solution, wanted in zip(solutions, gamma, strict=True):
        assert solution.status is Status.REACHED
        assert np.abs(solution.activations - wanted).max(axis=1).min() < 1e-6


def test_stable_tips_are_solved_back_to_their_activations_of_which_some_have_several(stable):
    gamma, _, solutions = stable
    assert (solutions.statuses == Status.REACHED).all()
    for solution, wanted in zip(solutions, gamma, strict=True):
        assert np.abs(solution.activations - wanted).max(axis=1).min() < 1e-6
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
        asked = oracle_rod(heavy, gamma, heavy.loads)
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
    monkeypatch.setattr("softreach.inverse.prepared._MOST_SEEDS", 1000)
    arm = designs.minimal_trunk(taper=0.0, length=0.2)
    arm = arm.replace(profile=arm.profile.replace(outer_radius=0.1))
    held = arm.with_bounds(np.full((3, 2), [-1e-3, 0.0]))
    heavy = prepared_map(rubber(held, Loads(payload=4000.0)), cells=4)
    with pytest.raises(InvalidInput, match="has a stable equilibrium"):
        solve_inverse(heavy, [[0.0, 0.0, 0.05]])


@pytest.fixture(scope="module")
def aside() -> Manipulator:
    """An arm that is held aside and snaps: a few activations are not reached from rest."""
    return hanging(0.005, SIDE)


@pytest.fixture(scope="module")
def beyond(aside):
    """A path of tips into activations at which an arm that is raised from rest has snapped, as it
    was followed."""
    rod = loaded(aside)
    gamma = np.random.default_rng(0).uniform(*aside.bounds.T, (10_000, 3))
    found = rod.equilibria(gamma)
    lost = gamma[found.status == TipStatus.SNAPS][1]
    near = np.argsort(np.linalg.norm(gamma - lost, axis=1))[:30]
    start = gamma[near[found.status[near] == TipStatus.STABLE][-1]]
    line = start + np.linspace(0.0, 1.0, 41)[:, None] * (lost - start)
    last = int(np.argmax(rod.status(line) != TipStatus.STABLE)) - 1
    tips = rod.tips(line[: last + 1])
    ahead = tips[-1] + np.arange(1, 20)[:, None] * (tips[-1] - tips[-2])
    return track_path(aside, np.concatenate([tips, ahead]), line[0])


def equilibrium_at(arm, activation, place):
    """Status and margin of the one of all equilibria that has its tip at a place."""
    every = equilibria(arm, activation)
    off = np.linalg.norm(every.tips - place, axis=1)
    assert off.min() <= 1e-5 * arm.length
    return every.status[off.argmin()], every.margin[off.argmin()]


def test_a_path_goes_on_where_the_arm_is_held_that_would_snap_on_its_way_from_rest(aside, beyond):
    status = loaded(aside).status(beyond.activation.values)
    assert (status == TipStatus.SNAPS).any()
    assert beyond.attrs["end"] == "end"
    assert float(beyond.tip_error.max()) <= 1e-10 * aside.length
    for k in np.flatnonzero(status == TipStatus.SNAPS)[::4]:
        there = equilibrium_at(aside, beyond.activation.values[k], beyond.position.values[k])
        assert there[0] == TipStatus.STABLE


def test_a_dragged_arm_stays_in_the_posture_in_which_it_was_left(aside, beyond):
    drag, activation = Drag(aside), tuple(beyond.activation.values[0])
    for place in beyond.position.values[1::3]:
        dragged = drag.to(activation, place)
        assert dragged is not None
        assert dragged.gap == 0.0
        assert np.allclose(dragged.tip_map.tips([dragged.activation])[0], dragged.tip, atol=1e-9)
        shape = configuration(dragged.tip_map, dragged.activation, 2)
        assert np.allclose(shape.position.values[-1], place, atol=1e-6 * aside.length)
        activation = dragged.activation


@pytest.mark.parametrize(
    ("start", "ahead"),
    [
        ([-0.1917, -1.3761, -2.2939], [-0.8108, 0.4103, 0.4174]),
        ([-3.9838, -3.581, -3.4293], [-0.6227, -0.4284, 0.6547]),
    ],
)
def test_a_path_ends_by_name_where_its_posture_loses_its_stability(start, ahead):
    arm = hanging(0.015, SIDE)
    begin, ahead = as_tip_map(arm).tips([start])[0], np.array(ahead) / np.linalg.norm(ahead)
    track = track_path(arm, begin + np.linspace(0.0, 0.08, 5)[:, None] * ahead, start)
    assert track.attrs["end"] == "snaps"
    assert (track.status[track.status != PathStatus.FOLLOWED] == PathStatus.SNAPS).all()
    assert 0.0 < float(track.end_length_error) <= 1e-6 * arm.length
    length = float(track.end_length)
    assert np.allclose(begin + length * ahead, track.end_position, atol=1e-9 * arm.length)
    # just before, by the search for all equilibria, it is stable and about to lose that
    shares = np.array([0.9, 0.99, 0.999])
    before = track_path(arm, begin + length * np.append(0.0, shares)[:, None] * ahead, start)
    at = zip(before.activation.values[1:], before.position.values[1:], strict=True)
    status, margins = zip(*(equilibrium_at(arm, *each) for each in at), strict=True)
    assert set(status) == {TipStatus.STABLE}
    assert margins[0] > 2 * margins[1] > 10 * margins[2]


@pytest.fixture(scope="module")
def prepared():
    """An arm that holds two postures at some activations."""
    return prepared_map(hanging(0.030), cells=12)


@pytest.fixture(scope="module")
def two_postures(prepared):
    """That arm, tips of postures straight from rest and of others, activations, and the answers."""
    arm = prepared.tip_map.arm
    tip_map, n = as_tip_map(arm), 9
    nodes = tip_map.box.from_free_cube(np.indices((n + 1,) * 3).reshape(3, -1).T / n)
    held = tip_map.held(nodes, (n + 1,) * 3)
    assert held is not None
    gamma = nodes[held.node]
    apart = np.linalg.norm(held.tips - tip_map.tips(nodes)[held.node], axis=1)
    others, of_rest = np.flatnonzero(apart > 0.01 * arm.length)[::20], np.flatnonzero(apart < 1e-6)
    chosen = np.concatenate([of_rest[:: len(of_rest) // 5], others])
    maps = [tip_map.continued_from(gamma[[k]], held.frames[[k]]) for k in chosen]
    pairs = zip(maps, chosen, strict=True)
    tips = np.array([each.tips_and_slopes(gamma[[k]])[0][0] for each, k in pairs])
    return arm, gamma[chosen], tips, np.isin(chosen, others), solve_inverse(prepared, tips)


def test_each_posture_of_an_activation_is_found_from_its_own_tip(two_postures):
    arm, gamma, tips, is_other, solutions = two_postures
    assert is_other.sum() >= 3
    for wanted, tip, other, solution in zip(gamma, tips, is_other, solutions, strict=True):
        (row,) = np.flatnonzero(np.abs(solution.activations - wanted).max(axis=1) < 1e-6)
        assert (solution.sheets[row] > 0) == other
        assert solution.residuals[row] < 1e-8 * arm.length
        posture = solution.posture(row)
        shape = configuration(posture, solution.activations[row], 2)
        assert np.allclose(shape.position.values[-1], tip, atol=1e-6 * arm.length)
        from_rest = as_tip_map(arm).tips(solution.activations[[row]])[0]
        assert (np.linalg.norm(from_rest - tip) > 0.01 * arm.length) == other


def test_paths_and_drags_begin_in_the_posture_of_a_solution(two_postures):
    arm, gamma, tips, is_other, solutions = two_postures
    k = np.flatnonzero(is_other)[0]
    (row,) = np.flatnonzero(np.abs(solutions[k].activations - gamma[k]).max(axis=1) < 1e-6)
    posture = solutions[k].posture(row)
    inside = gamma[k] + 0.02 * (arm.bounds.mean(axis=1) - gamma[k])
    ahead = posture.tips(inside[None])[0]
    track = track_path(posture, [tips[k], ahead], gamma[k])
    assert track.attrs["end"] == "end"
    assert np.allclose(track.activation.values[1], inside, atol=1e-6)
    dragged = Drag(posture).to(tuple(gamma[k]), ahead)
    assert dragged is not None
    assert dragged.gap == 0.0
    assert np.allclose(dragged.activation, inside, atol=1e-6)


def test_only_postures_from_rest_are_given_where_no_others_are_asked_for(prepared, two_postures):
    _, gamma, tips, is_other, _ = two_postures
    k = np.flatnonzero(is_other)[:1]
    solutions = solve_inverse(prepared, tips[k], from_rest=True)
    assert not (np.abs(solutions.activations - gamma[k]).max(axis=1) < 1e-3).any()


def test_solutions_say_where_the_arm_leans_to_one_of_two_sides():
    """Both tendons pulled alike keep a hanging tentacle in its plane, up to the pitchfork."""
    arm = Manipulator.load(EXAMPLES / "tentacle.toml")
    arm = arm.replace(loads=arm.loads.replace(payload=0.02))
    targets = as_tip_map(arm).tips([[6.0, 6.0], [6.3, 6.3]])
    planar, leaning = solve_inverse(arm, targets)
    assert planar.leans.tolist() == [False]
    assert leaning.leans.tolist() == [True]
