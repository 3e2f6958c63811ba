"""Laws of free motions, free sets and plans: against dense sampling and brute-force floods."""

from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.ndimage import label

import softreach as sr
from softreach.arm import Drive, Loads, Marker, Obstacle, designs
from softreach.cli.app import run
from softreach.inverse import Status, plan, solve_inverse
from softreach.requirements import Box, Cylinder, HalfSpace, Sphere, Tube
from softreach.rod import as_tip_map, compute_clearance
from softreach.support.errors import InvalidInput, NotPossible
from softreach.workspace import free_set, reachable_set
from softreach.workspace.free import CLEAR, TOUCHES, FreeMotions, free_grid, free_motions

TRUNK = designs.minimal_trunk()
TABLE = Obstacle(region=HalfSpace((0, 0, 0), (0, 0, 1)), start_over_length=0.1, name="table")
POLE = Obstacle(region=Cylinder((0.3, 0, 0), (0.3, 0, 1.2), 0.05), name="pole")
REST, THREADED = np.zeros(3), np.array([-1.0, 0.0, 0.0])
FIRST, SECOND, THIRD = TRUNK.bundle_names
DRIVES = (
    Drive(name="a", bounds=(-1.0, 0.5), gains={FIRST: 1.0, SECOND: -0.3}, dead_zone=0.1,
          offsets={FIRST: -0.6, SECOND: -0.6}),
)  # fmt: skip


def with_ring(half=0.02):
    """The arm beside a ring through which it goes in one of its postures, and not at rest."""
    shape = sr.configuration(TRUNK, [THREADED], stations=[0.4])
    center, along = shape.position.values[0, 0], half * shape.directors.values[0, 0, 2]
    ring = Tube(tuple(center - along), tuple(center + along), 0.4, 0.12)
    return TRUNK.replace(surroundings=(Obstacle(region=ring, start_over_length=0.05, name="ring"),))


MAZE = with_ring()
ARMS = {
    "trunk": TRUNK,
    "among solids": TRUNK.replace(surroundings=(TABLE, POLE)),
    "maze": MAZE,
    "in a ball": TRUNK.replace(
        surroundings=(Obstacle(region=Sphere((0, 0, 0.4), 0.65), inside=True),)
    ),
    "with a tool": TRUNK.replace(
        surroundings=(POLE,), markers=(Marker(name="tool", offset=(0.1, 0, 0.2)),), point="tool"
    ),
    "with a drive": TRUNK.replace(surroundings=(POLE,), drives=DRIVES),
    "of tendons": designs.three_tendon_robot().replace(
        surroundings=(Obstacle(region=Box((0.05, -0.1, 0.05), (0.08, 0.1, 0.3))),)
    ),
    "muscles": designs.elephant_trunk(),
}


def random_inputs(arm, shape, seed=0):
    low, high = arm.input_bounds.T
    return low + (high - low) * np.random.default_rng(seed).random((*shape, arm.inputs))


def least_between(arm, rows, parts=25):
    """Least clearance on straight lines between rows, by dense sampling."""
    t = np.linspace(0.0, 1.0, parts)[:, None]
    lines = np.concatenate([a + t * (b - a) for a, b in pairwise(rows)])
    return float(compute_clearance(arm, lines).clearance.min())


@pytest.mark.parametrize("name", ARMS)
def test_no_point_moves_farther_than_is_said(name):
    motions, tip_map = free_motions(as_tip_map(ARMS[name])), as_tip_map(ARMS[name])
    begin, end = random_inputs(ARMS[name], (2, 300))
    end = begin + np.geomspace(1e-3, 1.0, 300)[:, None] * (end - begin)
    z = np.linspace(0.0, tip_map.length, 13)
    moved = tip_map.frames(begin, z).position - tip_map.frames(end, z).position
    moved = np.linalg.norm(moved, axis=2).max(axis=1)
    moved = np.maximum(moved, np.linalg.norm(tip_map.tips(begin) - tip_map.tips(end), axis=1))
    most = motions.largest(end - begin)[0]
    assert (moved <= most).all()
    assert (moved > 0.05 * most).any()  # and no bound that says nothing


@pytest.mark.parametrize("name", ARMS)
def test_certified_motions_touch_nothing(name):
    arm = ARMS[name]
    motions, (begin, end) = free_motions(as_tip_map(arm)), random_inputs(arm, (2, 120), 1)
    outcome, which, share, clearance = motions.check(begin, end, shortest=2.0**-8)
    clear, touching = np.flatnonzero(outcome == CLEAR)[:40], np.flatnonzero(outcome == TOUCHES)
    assert min(least_between(arm, each, 151) for each in np.stack([begin, end], 1)[clear]) > 0.0
    assert all(clearance[which == k].min() <= 0.0 for k in touching)
    assert (np.diff(share)[np.diff(which) == 0] > 0.0).all()


def brute_force(motions, cells):
    """Mask of cells whose middles are free and in one piece with rest, as neighbors are joined."""
    sizes = (cells,) * motions.box.dimension
    places = (np.indices(sizes).reshape(len(sizes), -1).T + 0.5) / cells
    free = motions.clearance.of(motions.box.from_free_cube(places)).value > 0.0
    found: Any = label(free.reshape(sizes))
    number = found[0]
    return (number == number[(-1,) * len(sizes)]).ravel(), free


@pytest.mark.parametrize("cells", [28, pytest.param(200, marks=pytest.mark.large)])
@pytest.mark.parametrize("arm", [MAZE, ARMS["among solids"]], ids=["maze", "among solids"])
def test_what_is_connected_is_what_a_brute_force_flood_connects(arm, cells):
    motions = FreeMotions(as_tip_map(arm))
    sure, maybe = free_grid(motions, cells).connected(REST)
    flooded, free = brute_force(motions, cells)
    assert not (sure & ~flooded).any()
    assert not (flooded & ~maybe).any()
    assert (maybe & ~sure).sum() < 0.03 * flooded.sum()
    assert flooded.sum() < free.sum() or arm is not MAZE


def one_bundle(radius):
    """An arm of one free bundle, with a ball halfway, and activations on both sides of it."""
    arm = TRUNK.with_bounds([(-1.6, 0.0), (0.0, 0.0), (-0.4, -0.4)])
    place = tuple(sr.tip_positions(arm, [[-0.8, 0.0, -0.4]])[0])
    arm = arm.replace(surroundings=(Obstacle(region=Sphere(place, radius)),))
    return arm, np.array([0.0, 0.0, -0.4]), np.array([-1.6, 0.0, -0.4])


@pytest.mark.parametrize("cells", [4, 6, 10])
def test_a_wall_between_neighbors_is_not_passed(cells):
    arm, rest, beyond = one_bundle(0.005)
    motions = FreeMotions(as_tip_map(arm))
    flooded, free = brute_force(motions, cells)
    assert flooded.all()  # which looks at nodes alone
    parts = [free_grid(motions, cells).connected(each) for each in (rest, beyond)]
    np.testing.assert_array_equal(parts[0][0] + parts[1][0], free)
    assert not (parts[0][1] & parts[1][1]).any()


def test_a_wall_across_the_only_way_is_a_proof():
    arm, start, goal = one_bundle(0.15)
    with pytest.raises(NotPossible, match="there is no free path: contact all around parts"):
        plan(arm, start, goal)


def test_an_arm_with_nothing_around_reaches_all():
    chambers = designs.three_chamber_arm()
    free, every = free_set(chambers, cells=24), reachable_set(chambers).volume
    assert abs(free.reached - every) <= free.reached_error
    assert float(free.walled_off) == float(free.blocked) == 0.0
    assert set(np.unique(free.state)) == {0, 1}


def test_a_place_behind_a_hole_is_reached_only_through_the_wall(monkeypatch):
    found = free_set(MAZE, cells=20)
    assert found.walled_off > 3.0 * found.walled_off_error
    parts = sum(float(found[name]) for name in ("reached", "walled_off", "blocked"))
    assert parts == pytest.approx(reachable_set(TRUNK).volume, rel=0.02)
    tip = sr.tip_positions(MAZE, THREADED + [0.08, -0.04, -0.04])[0]
    assert int(found.state.sel(dict(zip("xyz", tip, strict=True)), method="nearest")) == 2
    cells = [float((found.state == k).sum()) * found.attrs["cell"] ** 3 for k in (1, 2)]
    np.testing.assert_allclose(cells, [found.reached, found.walled_off], rtol=0.1)
    assert compute_clearance(MAZE, THREADED).clearance > 0.0
    monkeypatch.setattr("softreach.inverse.planning._CELLS", {3: (16,)})
    with pytest.raises(NotPossible, match="no free path was found"):
        plan(MAZE, goal=THREADED)
    assert len(plan(MAZE, THREADED, [-0.9, -0.05, 0.0]).point) > 2


@pytest.mark.parametrize("name", ["among solids", "of tendons", "with a drive", "with a tool"])
def test_plans_lead_from_start_to_goal_and_touch_nothing(name):
    arm = ARMS[name]
    inputs = random_inputs(arm, (40,), 3)
    inputs = inputs[compute_clearance(arm, inputs).clearance > 0.01 * arm.length][:6]
    rate = np.linspace(0.5, 1.0, arm.inputs) * np.ptp(arm.input_bounds, axis=1)
    for start, goal in zip(inputs[::2], inputs[1::2], strict=True):
        found = plan(arm, start, goal, rate=rate)
        rows = found.activation.values
        np.testing.assert_array_equal(rows[[0, -1]], [start, goal])
        assert least_between(arm, rows, 9) > 0.0
        np.testing.assert_allclose(found.tip, sr.tip_positions(arm, rows), atol=1e-9)
        np.testing.assert_allclose(found.clearance, compute_clearance(arm, rows).clearance)
        speeds = np.abs(np.diff(rows, axis=0)) / np.diff(found.time.values)[:, None] / rate
        np.testing.assert_allclose(speeds.max(axis=1), 1.0)


@pytest.mark.parametrize("bundles", [3, 4])
def test_a_plan_goes_around_what_is_in_the_way(bundles):
    arm = TRUNK if bundles == 3 else designs.redundant_trunk()
    arm = arm.replace(surroundings=(Obstacle(region=Cylinder((0.25, 0, 0), (0.25, 0, 1.2), 0.08)),))
    inputs = random_inputs(arm, (2, 200), 4)
    free = (compute_clearance(arm, inputs.reshape(-1, bundles)).clearance > 0.03).values
    pairs = inputs[:, free.reshape(2, -1).all(axis=0)].swapaxes(0, 1)
    start, goal = next(pair for pair in pairs if least_between(arm, pair) < -0.02)
    found = plan(arm, start, goal, margin=0.01)
    assert found.clearance.min() > 0.01
    assert least_between(arm, found.activation.values, 9) > 0.01
    again = found if bundles == 4 else plan(arm, start, goal, margin=0.01)
    np.testing.assert_array_equal(found.activation, again.activation)


def test_free_solutions_are_those_of_all_that_touch_nothing():
    arm = ARMS["among solids"]
    targets = sr.tip_positions(TRUNK, random_inputs(arm, (60,), 5))
    every, free = (solve_inverse(arm, targets, free=each, near=THREADED) for each in (False, True))
    for own, left in zip(every, free, strict=True):
        clear = (compute_clearance(arm, own.activations).clearance > 0.0).values
        kept = own.activations[clear]
        away = np.linalg.norm(kept - THREADED, axis=1)
        np.testing.assert_array_equal(left.activations, kept[np.argsort(away)])
        assert left.status == (Status.REACHED if clear.any() else Status.IN_CONTACT)
    assert len({each.status for each in free}) == 2


def test_free_solutions_of_families_are_searched():
    arm = designs.redundant_trunk().replace(surroundings=(TABLE, POLE))
    targets = sr.tip_positions(arm, random_inputs(arm, (80,), 5))
    first = solve_inverse(arm, targets).activations
    left = targets[(compute_clearance(arm, first).clearance <= 0.0).values]
    found = solve_inverse(arm, left, free=True)
    assert 0 < len(found.activations) < len(left)
    assert (found.counts <= 1).all()
    assert (compute_clearance(arm, found.activations).clearance > 0.0).all()


def test_a_goal_may_be_a_place():
    found = plan(ARMS["among solids"], goal_position=[0.2, 0.1, 0.6])
    np.testing.assert_allclose(found.tip[-1], [0.2, 0.1, 0.6], atol=1e-9)
    with pytest.raises(NotPossible, match="goal_position, which is unreachable"):
        plan(TRUNK, goal_position=[0.0, 0.0, 2.0])
    with pytest.raises(NotPossible, match="goal_position, which is in contact"):
        plan(ARMS["among solids"], goal_position=[0.3, 0.0, 0.5])


@pytest.mark.parametrize(
    ("options", "error", "text"),
    [
        ({"goal": [-2, 0, 0]}, InvalidInput, "goal = .* must be 3 numbers between"),
        ({"goal": [np.nan, 0, 0]}, InvalidInput, "finite"),
        ({"goal": [0, 0]}, InvalidInput, "3"),
        ({"goal": [[0, 0, 0], [0, 0, 0]]}, InvalidInput, "goal"),
        ({"goal": REST, "rate": 0.0}, InvalidInput, "rate = 0.0: must be one positive number or 3"),
        ({"goal": REST, "rate": [1, -1, 1]}, InvalidInput, "rate"),
        ({"goal": REST, "margin": -1.0}, InvalidInput, "margin"),
        ({"goal": REST, "goal_position": [0, 0, 1]}, InvalidInput, "either"),
        ({}, InvalidInput, "either"),
        ({"goal_position": [0, 0]}, InvalidInput, "goal_position"),
        (
            {"goal": REST, "start": [0, 0, -1.6]},
            NotPossible,
            "at start the arm is not free: .*table",
        ),
        ({"goal": REST, "margin": 0.2}, NotPossible, "at start the arm is not free"),
    ],
)
def test_what_is_wrong_costs_one_line(options, error, text):
    with pytest.raises(error, match=text) as caught:
        plan(ARMS["among solids"], **options)
    assert "\n" not in str(caught.value)


def test_what_is_not_known_is_refused():
    loaded = designs.lce_arm().replace(loads=Loads())
    with pytest.raises(NotPossible, match="under loads"):
        plan(loaded, goal=REST)
    with pytest.raises(NotPossible, match="three free bundles"):
        free_set(designs.redundant_trunk())


def test_commands_print_volumes_and_write_plans(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    ARMS["among solids"].save("arm.toml")
    assert run(["plan", "arm.toml", "--to", "0.2,0.1,0.6", "--rate", "0.5", "--out", "a.csv"]) == 0
    names, *rows = Path("a.csv").read_text(encoding="utf-8").splitlines()
    assert names == "gamma_left,gamma_right,gamma_longitudinal,x,y,z,clearance_m,time_s"
    assert f"a.csv: {len(rows)} points" in capsys.readouterr().out
    assert run(["plan", "arm.toml"]) == 2
    assert "give either --goal or --to" in capsys.readouterr().err
    assert run(["reach", "arm.toml", "--free", "--out", "a.png"]) == 2
