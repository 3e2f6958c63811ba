"""Laws of loaded rods: closed forms, symmetries, and a solver written in another way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from softreach.arm import Base, Chamber, Tendon, designs
from softreach.arm.loads import Loads, PointLoad
from softreach.cloud.curvature import stream_statistics
from softreach.kernels.loaded.shooting import solve_frames
from softreach.rod.free import FreeRod
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Solver
from softreach.rod.tip_map import TipStatus
from tests.bodies import SIDE, UP, oracle_rod, posture_shapes, rubber, straight, uniform
from tests.laws import differences
from tests.oracles import elastica, loaded_rod

TRUNK = designs.minimal_trunk()
GAMMA = np.array([[-1.2, -0.3, -0.8], [-0.2, -1.5, 0.0], [-1.6, -1.6, -1.6], [0.0, 0.0, -0.4]])

KINDS = {
    "gravity": Loads(gravity=SIDE),
    "payload with a lever": Loads(gravity=SIDE, payload=0.5, payload_arm=(0.05, 0.02, 0.1)),
    "moment that follows": Loads(gravity=(3.0, 1.0, -9.0), follower_moment=(0.3, 0.2, -0.5)),
    "tip force": Loads(gravity=SIDE, tip_force=(0.0, 3.0, -2.0)),
    "tip moment": Loads(gravity=SIDE, tip_moment=(0.2, 0.3, -0.4)),
    "force that follows": Loads(
        gravity=SIDE, follower_force=(1.0, 2.0, -2.0), follower_moment=(0.1, 0.2, 0.1)
    ),
    "along the arm": Loads(
        gravity=SIDE,
        point_loads=(
            PointLoad(station=0.5, force=(0.0, 2.0, 1.0), moment=(0.1, 0.2, -0.3)),
            PointLoad(station=0.8, force=(1.0, 0.0, 0.0)),
        ),
        force_per_length=(0.0, 2.0, 0.0),
    ),
    "a lever in a field of two forces": Loads(
        gravity=SIDE, payload=0.5, payload_arm=(0.05, 0.02, 0.1), tip_force=(0.0, 1.0, 0.0)
    ),
}
WITHIN_OTHERS = {"gravity", "tip force", "tip moment"}  # kinds of load that others have too
of_kinds = pytest.mark.parametrize(
    "loads",
    [
        pytest.param(loads, id=name, marks=[pytest.mark.large] if name in WITHIN_OTHERS else [])
        for name, loads in KINDS.items()
    ],
)


def loaded(loads, tol=1e-9, arm=TRUNK, **material):
    return LoadedRod(rubber(arm, loads, **material), tol)


@of_kinds
def test_a_shooting_from_the_base_finds_the_same_rod(loads):
    found = loaded(loads)
    stations = np.array([0.0, 0.3, 0.5, 0.9, 1.0])
    gamma = GAMMA[:1]
    shapes = posture_shapes(Solver(found.tables, found.steps, 1e-9), gamma, stations)
    tips = found.tips(gamma)
    for k, one in enumerate(gamma):
        expected = loaded_rod.equilibrium(*oracle_rod(found.arm, one, loads), stations, rtol=1e-10)
        moment = np.einsum("sd,sdc->sc", shapes.moment[k], shapes.directors[k])
        np.testing.assert_allclose(tips[k], expected.tip, atol=1e-9)
        np.testing.assert_allclose(shapes.position[k], expected.place, atol=2e-9)
        np.testing.assert_allclose(shapes.directors[k], expected.frame, atol=1e-8)
        np.testing.assert_allclose(moment, expected.moment, atol=5e-8)


@pytest.mark.parametrize("kind", ["force that follows", "along the arm"])
def test_a_newton_step_squares_the_error_of_the_nodes_between_segments(kind):
    rod = loaded(KINDS[kind])
    tables, gamma = replace(rod.tables, longest=0.3 * rod.tables.phase.entire), GAMMA[:1]
    known = Solver(tables, rod.steps, 1e-9).search(gamma, None).frame
    ways = np.random.default_rng(0).normal(size=(tables.segments, 3))
    assert tables.segments == 4
    misses, out = [], np.empty((1, 5 + tables.frame_size))
    for angle in (2e-2, 1e-2):
        frames = known.reshape(-1, 2, 3)
        turned = frames + angle * np.cross(ways[:, None], frames)
        steps, limits = tuple(tables.uniform(rod.steps)), (np.inf, 0.0, 0.0)  # which end no search
        arm = gamma, tables.axes, tables.at_tip, turned.reshape(1, -1), steps
        solve_frames(*arm, limits, (1, 0), np.ones(1), out)
        misses.append(np.linalg.norm(out[:, 3:-2] - known))
    assert 3.6 < misses[0] / misses[1] < 4.4


PULLS = {
    "tendon": (0.04, Tendon(distance=0.008, offset=0.4, activation_bounds=(0, 8)), 6.0, 1.0),
    "chamber": (
        0.15,
        Chamber(distance=0.008, radius=0.004, offset=0.4, activation_bounds=(0, 2e5)),
        1e5,
        -math.pi * 0.004**2,
    ),
}


@pytest.mark.parametrize(("length", "actuator", "activation", "pull"), PULLS.values(), ids=PULLS)
def test_a_parallel_tendon_or_chamber_is_the_forces_that_it_puts_on_a_passive_arm(
    length, actuator, activation, pull
):
    """It pulls along d3 at the tip, with a moment, and where the arm bends toward its center.

    Forces on `points` sections stand for those along the arm, which is wrong at second order.
    """
    profile = TRUNK.profile.replace(length=length, outer_radius=0.012, taper=0.0)
    passive = rubber(TRUNK.replace(actuators=(), profile=profile), Loads(gravity=(0, 0, 0)))
    driven = FreeRod(passive.replace(actuators=(actuator,), loads=None), 1e-11)
    place = 0.008 * np.array([math.cos(0.4), math.sin(0.4), 0.0])
    apart = []
    for points in (100, 200):
        z = np.linspace(0.0, length, points + 1)
        stations = np.append(0.5 * (z[1:] + z[:-1]), length)
        directors = driven.frames([[activation]], stations).directors[0]
        force = -pull * activation * directors[:-1, 2]
        loads = Loads(
            gravity=(0, 0, 0),
            tip_force=tuple(force[-1]),
            tip_moment=tuple(np.cross(place, [0, 0, -pull * activation]) @ directors[-1]),
            point_loads=tuple(
                PointLoad(station=float(at), force=tuple(one))
                for at, one in zip(z[1:-1], force[:-1] - force[1:], strict=True)
            ),
        )
        tip = LoadedRod(passive.replace(loads=loads), 1e-9).tips(np.zeros((1, 0)))
        apart.append(np.linalg.norm(tip - driven.tips([[activation]])) / length)
    assert apart[1] < 1e-6
    assert apart[0] / apart[1] == pytest.approx(4.0, rel=0.02)


@pytest.mark.parametrize("load", [1.0, 10.0, 60.0, 140.0, 300.0])
def test_a_tip_force_bends_an_elastica_however_heavy_it_is(load):
    """Under the largest the tip hardly turns any more, and the base must tell when it is found."""
    loads = Loads(gravity=(0, 0, 0), tip_force=(load, 0, 0))
    found = straight(uniform(1.0), loads, steps=32 if load < 60.0 else 64)
    tip = Postures(found).find(np.zeros((1, 3))).tips[0]
    atol = 1e-9 if load < 60.0 else 1e-7
    np.testing.assert_allclose(tip[[0, 2]], elastica.tip_loaded(load), atol=atol)


@pytest.mark.parametrize("load", [1.0, 4.0, 10.0, 50.0])
def test_a_heavy_cantilever_drops_as_published(load):
    found = straight(uniform(1.0, mass=1.0), Loads(gravity=(0, load, 0)), steps=48)
    tip = Postures(found).find(np.zeros((1, 3))).tips[0]
    np.testing.assert_allclose(tip[[1, 2]], elastica.heavy(load), atol=1e-9)


def test_a_hanging_rod_stretches_by_the_weight_beyond_each_section():
    loads = Loads(gravity=(0, 0, 10.0), payload=0.4)
    found = straight(uniform(1.0, axial=40.0, mass=1.5), loads)
    tip = Postures(found).find(np.zeros((1, 3))).tips[0]
    np.testing.assert_allclose(tip, [0, 0, 1 + (7.5 + 4.0) / 40.0], atol=1e-12)


def test_stiff_arms_approach_the_free_one_as_one_over_their_stiffness():
    free = FreeRod(TRUNK, 1e-12).tips(GAMMA)
    apart = [
        np.linalg.norm(loaded(Loads(gravity=SIDE), 1e-12, young=young).tips(GAMMA) - free, axis=1)
        for young in (1e9, 1e10)
    ]
    np.testing.assert_allclose(apart[0] / apart[1], 10.0, rtol=0.02)


@of_kinds
def test_slopes_and_turns_are_the_differences_of_tips_and_frames(loads):
    found = loaded(loads, 1e-10)
    tips, slopes, tangents, rotations = found.tip_motions(GAMMA)
    np.testing.assert_allclose(tips, found.tips(GAMMA), atol=1e-11)

    def pose(gamma):
        """Directors of the tip, and its place."""
        frames = found.frames(gamma, [1.0])
        return np.concatenate([frames.directors[:, 0], frames.position], axis=1)

    directors, changes = pose(GAMMA)[:, :3], differences(pose, GAMMA)
    np.testing.assert_allclose(slopes, changes[:, 3], atol=2e-8)
    np.testing.assert_allclose(tangents, directors[:, 2], atol=1e-9)
    expected = np.cross(rotations[:, None], directors[..., None], axis=2)
    np.testing.assert_allclose(changes[:, :3], expected, atol=1e-7)


def upright():
    """A trunk of three like fibers, of which equal ones leave it straight, as it cannot stand."""
    fibers = [
        TRUNK.actuators[0].replace(name=f"fiber {k}", offset=2 * math.pi * k / 3) for k in range(3)
    ]
    return rubber(TRUNK.replace(actuators=tuple(fibers)), Loads(gravity=UP), young=2e5)


MANY = -5 / 3 * np.random.default_rng(1).random((100, 3))
EQUAL = np.linspace(-5 / 3, 0.0, 20)[:, None] + np.zeros(3)
STABLE, UNSTABLE, _, _, SNAPS = TipStatus
SNAPPED = [
    [-0.5703821002162499, -3.746296707039845, -1.5906368078758044],
    [-0.6713423980309976, -3.8851158410073556, -1.646160439517963],
]
AMONG = {
    "along one direction": (rubber(TRUNK, KINDS["payload with a lever"]), MANY, {STABLE}),
    "across it": (rubber(TRUNK, KINDS["tip force"]), MANY, {STABLE}),
    "upright": (
        upright(),
        np.concatenate([EQUAL, EQUAL + 1e-5 * MANY[:20], MANY]),
        {STABLE, UNSTABLE},
    ),
    "where it snaps": (
        designs.lce_arm().replace(base=Base(points="x"), loads=Loads(payload=0.005)),
        np.concatenate([SNAPPED, [-1.1, -3.6, -1.3] + 0.15 * MANY]),
        {STABLE, SNAPS},
    ),
}


@pytest.mark.parametrize(("arm", "gamma", "statuses"), AMONG.values(), ids=AMONG)
def test_a_rod_alone_has_the_equilibrium_that_it_has_among_others(arm, gamma, statuses):
    """To the last bit, in any place of a block: among those are rods that take longest."""
    rod = LoadedRod(arm, 1e-6)
    together, compliance = rod.equilibria(gamma), rod.compliance(gamma)
    assert set(together.status) == statuses
    each = [np.flatnonzero(together.status == status)[[0, -1]] for status in statuses]
    for row in {5, 31, 32, *np.concatenate(each)}:
        alone = gamma[row : row + 1]
        for one, other in zip(rod.equilibria(alone), together.of([row]), strict=True):
            np.testing.assert_array_equal(one, other)
        np.testing.assert_array_equal(rod.compliance(alone), compliance[row : row + 1])


def test_what_acts_on_the_base_section_moves_nothing():
    at_base = PointLoad(station=0.0, force=(0.0, 50.0, 0.0), moment=(0.0, 50.0, 0.0))
    without = loaded(Loads(gravity=SIDE))
    found = loaded(Loads(gravity=SIDE, point_loads=(at_base,))).tips(GAMMA)
    np.testing.assert_allclose(found, without.tips(GAMMA), atol=1e-9)


def test_statistics_of_strains_count_only_arms_that_have_an_equilibrium(monkeypatch):
    rod, stations = loaded(Loads(gravity=SIDE), 1e-6), [0.7, 0.3]
    expected = stream_statistics(rod, [GAMMA[[0, 3]]], stations, bins=64)
    whole = LoadedRod.shapes

    def torn(rod, gamma, *others):
        found = whole(rod, gamma, *others)
        found.curvature[1:3], found.extension[1:3] = np.nan, np.nan
        return found

    monkeypatch.setattr(LoadedRod, "shapes", torn)
    found = stream_statistics(rod, [GAMMA], stations, bins=64)
    np.testing.assert_array_equal(found.bending_count.sum("bin"), [2, 2])
    for name in ("bending_mean", "torsion_mean", "extension_mean"):
        np.testing.assert_allclose(found[name], expected[name], rtol=1e-9)
