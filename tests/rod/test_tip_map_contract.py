"""The contract of every tip map: whatever rod it solves, it answers alike.

A new tip map is one more maker in `MAKERS`.
"""

from __future__ import annotations

import functools
import itertools
import pickle
from collections.abc import Callable
from dataclasses import FrozenInstanceError

import numpy as np
import pytest
from hypothesis import given, settings

import softreach as sr
from softreach.arm import Base, Manipulator, designs
from softreach.arm.loads import Loads
from softreach.cloud.curvature import stream_statistics
from softreach.rod import equilibria
from softreach.rod.free import FreeRod
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.rods import ArmMap
from softreach.rod.tip_map import BLOCK, TipMap, TipStatus
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.bodies import rubber
from tests.kinds import fibers_and_a_tendon
from tests.laws import arms, differences, in_box, integrated_tip

Make = Callable[[Manipulator, float], TipMap]


def sideways(arm: Manipulator, tol: float) -> LoadedRod:
    """An arm that stands out from a wall and carries 100 g."""
    return LoadedRod(rubber(arm, Loads(gravity=(9.81, 0.0, 0.0), payload=0.1)), tol)


POSE = Base(position=(0.3, -0.2, 1.5), points="-x", turn=0.7)


def placed(arm: Manipulator, tol: float) -> ArmMap:
    """An arm whose base is anywhere in the world."""
    return ArmMap.of(FreeRod(arm.replace(base=POSE), tol), POSE)


def placed_and_loaded(arm: Manipulator, tol: float) -> ArmMap:
    """The same with its weight and 100 g, which fall in the world."""
    heavy = rubber(arm, Loads(payload=0.1)).replace(base=POSE)
    return ArmMap.of(LoadedRod(heavy, tol), POSE)


MAKERS: dict[str, Make] = {
    "free": FreeRod,
    "loaded": sideways,
    "placed": placed,
    "placed and loaded": placed_and_loaded,
}

of_makers = {
    name: functools.cache(make) for name, make in MAKERS.items()
}  # steps are searched once
pytestmark = pytest.mark.parametrize(
    "make",
    [  # what is placed and loaded is either
        pytest.param(
            make, id=name, marks=[pytest.mark.large] if name in ("placed", "loaded") else []
        )
        for name, make in of_makers.items()
    ],
)

DESIGNS = {
    "minimal": designs.minimal_trunk(),
    "redundant": designs.redundant_trunk(),
    "one bundle": designs.minimal_trunk().replace(actuators=designs.minimal_trunk().actuators[:1]),
    "one held": designs.minimal_trunk().with_bounds(((-1, 0), (-0.5, -0.5), (-1, 0.3))),
    "wide": designs.minimal_trunk(taper=-0.05),
    "fibers and a tendon": fibers_and_a_tendon(),
}
TOLERANCES = (1e-3, 1e-6, 1e-9)
of_designs = pytest.mark.parametrize(
    "arm",
    [
        pytest.param(arm, id=name, marks=[pytest.mark.large] if name == "wide" else [])
        for name, arm in DESIGNS.items()
    ],
)


def activations(rod: TipMap, n: int, seed: int = 1) -> np.ndarray:
    """All corners of the box, and random activations in it."""
    cube = np.random.default_rng(seed).random((n, rod.box.bundles))
    return np.concatenate([rod.box.corners(), rod.box.from_cube(cube)])


@settings(max_examples=8)
@given(arm=arms())
def test_tips_are_those_of_an_independent_integrator(make, arm):
    if make.__wrapped__ is not FreeRod:
        pytest.skip("its integrator is in tests/rod/test_loaded_rod.py")
    rod, gamma = make(arm, 1e-9), in_box(arm, 2)
    expected = [integrated_tip(arm, one) for one in gamma]
    np.testing.assert_allclose(rod.tips(gamma), expected, atol=1e-9 * rod.length)


@of_designs
def test_the_tolerance_is_kept_over_the_box(make, arm):
    exact = make(arm, 1e-11)
    gamma = activations(exact, 300)
    tips = exact.tips(gamma)
    for tol in TOLERANCES:
        error = np.linalg.norm(make(arm, tol).tips(gamma) - tips, axis=1)
        assert error.max() <= tol * arm.length


@of_designs
def test_the_tolerance_is_kept_along_the_arm(make, arm):
    exact = make(arm, 1e-11)
    gamma = activations(exact, 20)
    stations = arm.length * np.array([0.0, 0.2, 0.21, 0.5, 0.77, 1.0])
    places = exact.frames(gamma, stations).position
    for tol in TOLERANCES:
        apart = make(arm, tol).frames(gamma, stations).position - places
        assert np.linalg.norm(apart, axis=-1).max() <= tol * arm.length


NO_ARM = {
    "shortened to less than nothing": (-7.0, -7.0, -7.0),
    "by far": (-100.0, -100.0, -100.0),
    "coiled beyond what steps follow": (10.0, 10.0, 10.0),
    "beyond numbers": (1e300, 1e300, 1e300),
}


@pytest.mark.parametrize("gone", NO_ARM.values(), ids=NO_ARM.keys())
def test_activations_that_leave_no_arm_have_a_status_and_no_shape(make, gone):
    rod = make(DESIGNS["minimal"], 1e-6)
    gamma = np.array([[-1.0, 0.0, -0.5], gone, [-2.0, 0.0, 0.1]])
    tips, status = rod.tips_and_status(gamma)
    lost = [False, True, False]
    assert (status == TipStatus.NO_EQUILIBRIUM).tolist() == lost
    *shapes, status = rod.shapes(gamma, [0.5], [0.5])
    assert (status == TipStatus.NO_EQUILIBRIUM).tolist() == lost
    for values in (tips, rod.tip_twists(gamma)[1], *shapes):
        assert np.isnan(values.reshape(3, -1)).all(axis=1).tolist() == lost
        assert np.isfinite(values).reshape(3, -1).all(axis=1).tolist() == [True, False, True]


@pytest.mark.parametrize("gone", NO_ARM.values(), ids=NO_ARM.keys())
def test_asked_for_one_by_one_they_are_refused_in_one_line(make, gone):
    rod = make(DESIGNS["minimal"], 1e-6)
    asked = [
        lambda: sr.tip_positions(rod, [gone]),
        lambda: sr.tip_jacobian(rod, [gone]),
        lambda: sr.configuration(rod, gone),
        lambda: equilibria(rod, gone),
        lambda: stream_statistics(rod, [np.array([gone])], [0.5]),
    ]
    for ask in asked:
        with pytest.raises(InvalidInput, match=r"a shape, as between -1|1000 times as large"):
            ask()


@of_designs
def test_slopes_are_the_central_differences_of_the_tips(make, arm):
    rod = make(arm, 1e-11)
    gamma = activations(rod, 20)
    tips, slopes = rod.tips_and_slopes(gamma)
    assert slopes.shape == (len(gamma), 3, rod.box.bundles)
    np.testing.assert_allclose(tips, rod.tips(gamma), atol=1e-13 * rod.length)
    expected = differences(rod.tips, gamma)
    np.testing.assert_allclose(slopes, expected, atol=1e-8 * rod.length)


@of_designs
def test_twists_move_the_tip_as_slopes_do_and_turn_its_frame(make, arm):
    rod = make(arm, 1e-11)
    gamma = activations(rod, 20)
    tips, twists = rod.tip_twists(gamma)
    assert twists.shape == (len(gamma), 6, rod.box.bundles)
    _, slopes = rod.tips_and_slopes(gamma)
    linear, angular = twists[:, :3], twists[:, 3:]
    moved = linear + np.cross(angular, tips[:, :, None], axis=1)
    np.testing.assert_allclose(slopes, moved, atol=1e-12 * rod.length)

    def directors(gamma):
        return rod.frames(gamma, [rod.length]).directors[:, 0]

    turned = differences(directors, gamma)  # (n, director, axis, bundle)
    expected = np.cross(angular[:, None], directors(gamma)[..., None], axis=2)
    np.testing.assert_allclose(turned, expected, atol=1e-8)


@of_designs
def test_frames_start_at_the_base_end_at_the_tips_and_are_orthonormal(make, arm):
    rod = make(arm, 1e-9)
    gamma = activations(rod, 20)
    stations = rod.length * np.array([0.0, 0.3, 0.3, 0.8, 1.0])
    frames = rod.frames(gamma, stations)
    assert frames.position.shape == (len(gamma), 5, 3)
    assert frames.directors.shape == (len(gamma), 5, 3, 3)
    clamped = np.broadcast_to(rod.pose.position, (len(gamma), 3))
    np.testing.assert_array_equal(frames.position[:, 0], clamped)
    axes = np.broadcast_to(rod.pose.rotation.T, (len(gamma), 3, 3))
    np.testing.assert_array_equal(frames.directors[:, 0], axes)
    np.testing.assert_array_equal(frames.position[:, 1], frames.position[:, 2])
    gram = frames.directors @ np.swapaxes(frames.directors, -1, -2)
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frames.directors), 1.0, atol=1e-12)
    apart = np.linalg.norm(frames.position[:, -1] - rod.tips(gamma), axis=-1)
    assert apart.max() <= 2 * rod.tol * rod.length
    directions = rod.tip_directions(gamma)
    np.testing.assert_allclose(directions, frames.directors[:, -1, 2], atol=1e-8)


@of_designs
def test_a_frame_does_not_depend_on_the_other_stations(make, arm):
    rod = make(arm, 1e-9)
    gamma = activations(rod, 5)
    many = rod.frames(gamma, np.linspace(0, rod.length, 9))
    alone = rod.frames(gamma, [0.5 * rod.length])
    np.testing.assert_allclose(alone.position[:, 0], many.position[:, 4], atol=2e-9 * rod.length)
    base = rod.frames(gamma, [0.0])
    np.testing.assert_array_equal(base.position[:, 0] - rod.pose.position, 0.0)


@of_designs
def test_strains_are_how_frames_change_along_the_arm(make, arm):
    """ζ d3 = r', and u in the directors from dᵢ' = ζ u × dᵢ."""
    rod = make(arm, 1e-11)
    gamma = activations(rod, 10)
    middle, step = rod.length * np.array([0.25, 0.6]), 1e-3 * rod.length
    offsets = np.array([-2, -1, 0, 1, 2]) * step
    frames = rod.frames(gamma, (middle[:, None] + offsets).ravel())
    weights = np.array([1, -8, 0, 8, -1]) / (12 * step)

    def along(values):
        split = values.reshape(len(gamma), 2, 5, *values.shape[2:])
        return np.einsum("k,nsk...->ns...", weights, split), split[:, :, 2]

    velocity, _ = along(frames.position)
    turning, directors = along(frames.directors)
    curvature, extension = rod.strains(gamma, middle)
    assert curvature.shape == (len(gamma), 2, 3)
    assert extension.shape == (len(gamma), 2)
    expected = extension[..., None] * directors[..., 2, :]
    np.testing.assert_allclose(velocity, expected, atol=1e-7)
    darboux = np.einsum("nsc,nsci->nsi", curvature, directors)
    expected = extension[..., None, None] * np.cross(darboux[:, :, None], directors)
    np.testing.assert_allclose(turning, expected, atol=1e-6 / rod.length)


@of_designs
def test_results_do_not_depend_on_threads_or_blocks(make, arm, monkeypatch):
    rod = make(arm, 1e-6)
    gamma = activations(rod, BLOCK + 100)
    few = gamma[: BLOCK // 8 + 100]
    stations = [0.5 * rod.length, rod.length]

    def everything():
        return (
            rod.tips(gamma),
            *rod.tips_and_slopes(few),
            *rod.tip_twists(few),
            *rod.frames(few[:1100], stations),
            *rod.strains(few[:1100], stations),
            rod.tip_directions(few[:1100]),
        )

    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "1")
    alone = everything()
    monkeypatch.setenv("SOFTREACH_NUM_THREADS", "2")
    for one, other in zip(alone, everything(), strict=True):
        np.testing.assert_array_equal(one, other)


@of_designs
def test_a_sample_alone_has_the_numbers_that_it_has_among_others(make, arm):
    rod = make(arm, 1e-6)
    gamma = activations(rod, 300)
    whole = rod.tips(gamma), *rod.tips_and_slopes(gamma), *rod.tip_twists(gamma)
    for k in (0, 3, 127, len(gamma) - 1):
        rows = slice(k, k + 1)
        alone = (
            rod.tips(gamma[rows]),
            *rod.tips_and_slopes(gamma[rows]),
            *rod.tip_twists(gamma[rows]),
        )
        for one, other in zip(whole, alone, strict=True):
            np.testing.assert_array_equal(one[rows], other)
    z = rod.length * np.array([0.0, 0.5, 0.7, 1.0])
    shapes, alone = (rod.shapes(rows, z, z) for rows in (gamma, gamma[3:4]))
    for every, single in zip(shapes, alone, strict=True):
        np.testing.assert_array_equal(every[3:4], single)


@of_designs
def test_every_sample_has_a_status(make, arm):
    rod = make(arm, 1e-6)
    gamma = activations(rod, 10)
    status = rod.status(gamma)
    assert status.shape == (len(gamma),)
    assert status.dtype == np.int8
    assert set(status.tolist()) <= set(TipStatus)
    lost = status == TipStatus.NO_EQUILIBRIUM
    assert not np.isfinite(rod.tips(gamma)[lost]).any()
    assert np.isfinite(rod.tips(gamma)[~lost]).all()
    assert rod.supports_unstable or (status == TipStatus.STABLE).all()


ASK = {
    "tips": lambda rod, gamma: rod.tips(gamma),
    "slopes": lambda rod, gamma: rod.tips_and_slopes(gamma)[1],
    "twists": lambda rod, gamma: rod.tip_twists(gamma)[1],
    "directions": lambda rod, gamma: rod.tip_directions(gamma),
    "frames": lambda rod, gamma: rod.frames(gamma, [0.0]).position,
    "strains": lambda rod, gamma: rod.strains(gamma, [0.0]).curvature,
    "status": lambda rod, gamma: rod.status(gamma),
}


@of_designs
def test_no_activations_give_empty_results(make, arm):
    rod, m = make(arm, 1e-6), arm.bundles
    shapes = [(0, 3), (0, 3, m), (0, 6, m), (0, 3), (0, 1, 3), (0, 1, 3), (0,)]
    assert [ask(rod, np.empty((0, m))).shape for ask in ASK.values()] == shapes


@pytest.mark.parametrize("ask", ASK.values(), ids=ASK)
def test_activations_are_checked_by_every_question(make, ask, trunk):
    rod = make(trunk, 1e-6)
    for gamma, message in (
        (np.zeros(4), r"activations.shape = \(4,\).*\(n, 3\)"),
        (np.zeros((2, 4)), r"activations.shape = \(2, 4\)"),
        ([[0, np.nan, 0]], r"activations\[0\] = .*finite"),
        ([["a", 0, 0]], "an array of numbers"),
    ):
        with pytest.raises(InvalidInput, match=message):
            ask(rod, gamma)


def test_one_activation_may_stand_alone(make, trunk):
    rod, gamma = make(trunk, 1e-6), np.array([-1.0, 0.0, -0.5])
    np.testing.assert_array_equal(rod.tips(gamma), rod.tips(gamma[None]))


@pytest.mark.parametrize(
    "stations", [[-0.1], [1.1], [], [[0.5]], [np.nan], 0.5, "ab", [[0.1], [0.2, 0.3]]]
)
def test_stations_are_checked(make, stations, trunk):
    rod = make(trunk, 1e-6)
    for ask in (rod.frames, rod.strains):
        with pytest.raises(InvalidInput, match=r"stations"):
            ask(np.zeros((1, 3)), stations)


def test_frames_take_stations_upwards_and_strains_in_any_order(make, trunk):
    rod, gamma = make(trunk, 1e-6), np.array([[-0.4, -1.2, -0.3]])
    with pytest.raises(InvalidInput, match=r"stations = .*ascending"):
        rod.frames(gamma, [0.5, 0.2])
    down, up = rod.strains(gamma, [0.5, 0.2]), rod.strains(gamma, [0.2, 0.5])
    np.testing.assert_array_equal(down.curvature, up.curvature[:, ::-1])
    np.testing.assert_array_equal(down.extension, up.extension[:, ::-1])


@pytest.mark.parametrize("tol", [0.0, 1e-13, np.nan, np.inf, "1e-6", None])
def test_tolerances_are_checked(make, tol, trunk):
    with pytest.raises(InvalidInput, match=r"tol = .*must be a finite number >= 1e-12 \(in L\)"):
        make(trunk, tol)


def test_an_arm_shortened_to_nothing_has_no_tip_map(make, trunk):
    with pytest.raises(InvalidDesign, match="must keep ζ > 0"):
        make(trunk.with_bounds((-9.0, 0.0)), 1e-6)


@of_designs
def test_a_tip_map_is_a_frozen_value(make, arm):
    rod, twin = make(arm, 1e-6), make.__wrapped__(pickle.loads(pickle.dumps(arm)), 1e-6)
    assert rod == twin
    assert hash(rod) == hash(twin)
    assert rod != make(arm, 1e-7)
    assert (rod.tol, rod.length) == (1e-6, arm.length)
    assert rod.arm.actuators == arm.actuators
    with pytest.raises(FrozenInstanceError):
        rod.tol = 1e-3
    gamma = activations(rod, 10)
    tips = rod.tips(gamma)  # so that whatever it keeps for the next call is there
    again = pickle.loads(pickle.dumps(rod))
    assert again == rod
    assert hash(again) == hash(rod)
    np.testing.assert_array_equal(again.tips(gamma), tips)


@of_designs
def test_its_box_is_that_of_the_arm(make, arm):
    box = make(arm, 1e-6).box
    np.testing.assert_array_equal(np.stack([box.low, box.high], axis=1), arm.bounds)
    assert box.names == arm.bundle_names
    assert list(itertools.compress(box.names, box.is_free)) == [box.names[j] for j in box.free]
