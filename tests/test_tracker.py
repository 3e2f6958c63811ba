"""Control steps: within rates and bounds, nearly as good as steps that take all the time."""

import time

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

import softreach as sr
from softreach.arm.actuators import LengthTendon
from softreach.arm.drives import Drive
from softreach.rod.rods import as_tip_map

FREE = sr.designs.three_tendon_robot(segments=2)
HANGING = FREE.replace(loads=sr.Loads(payload=0.01), base=sr.Base(points="down"))
both = pytest.mark.parametrize("arm", [FREE, HANGING], ids=["free", "hanging"])
PERIOD = 0.4  # s
RATE = 4.0  # N/s
PUSHED = 1.15  # of the places of a path, some of which are out of reach by that


def activations_of_path(arm, seed=0, steps=25):
    """Ten seconds of smooth activations well within the bounds."""
    rng, high = np.random.default_rng(seed), arm.bounds[:, 1]
    knots = high * (0.1 + 0.5 * rng.random((9, arm.bundles)))
    return CubicSpline(np.arange(9), knots)(np.linspace(0, 8, steps + 1)).clip(0.0, high)


def errors_without_a_limit_of_time(arm, path, start):
    """Of damped least squares that go on until they converge, within the same rates and bounds."""
    tip_map, x, errors = as_tip_map(arm), start, []
    for target in path:
        low = np.maximum(arm.bounds[:, 0], x - RATE * PERIOD)
        high = np.minimum(arm.bounds[:, 1], x + RATE * PERIOD)

        def away(x, target=target):
            return (tip_map.tips(x[None])[0] - target) / arm.length

        def slopes(x):
            return tip_map.tips_and_slopes(x[None])[1][0] / arm.length

        width = 1e-9 * (high - low)
        inside = x.clip(low + width, high - width)
        found = least_squares(away, inside, slopes, (low, high), x_scale=8.0)
        x = found.x
        errors.append(np.linalg.norm(found.fun))
    return np.array(errors)


@both
def test_a_path_is_followed_within_rates_and_bounds_nearly_as_without_a_limit_of_time(arm):
    gamma = activations_of_path(arm)
    path = PUSHED * sr.tip_positions(arm, gamma)
    tracker = sr.Tracker(arm, rate=RATE, period=PERIOD, start=gamma[0])
    steps = [tracker.step(target) for target in path[1:]]
    x = np.array([gamma[0], *(step.activations for step in steps)])
    assert np.abs(np.diff(x, axis=0)).max() <= RATE * PERIOD * (1 + 1e-12)
    assert ((x >= arm.bounds[:, 0]) & (x <= arm.bounds[:, 1])).all()
    assert any(step.at_rate for step in steps)
    assert any(step.at_bound for step in steps)
    tips = np.array([step.tip for step in steps])
    np.testing.assert_allclose(tips, sr.tip_positions(arm, x[1:]), atol=2e-6 * arm.length)
    errors = np.linalg.norm(tips - path[1:], axis=1) / arm.length
    best = errors_without_a_limit_of_time(arm, path[1:], gamma[0])
    assert errors.mean() <= 2.0 * best.mean()


@both
def test_where_the_path_is_in_reach_every_step_ends_on_it(arm):
    gamma = activations_of_path(arm, steps=1000)[:150]
    tracker = sr.Tracker(arm, start=gamma[0])
    away = [tracker.step(target).distance for target in sr.tip_positions(arm, gamma)[1:]]
    assert np.quantile(away, 0.95) < 1e-5 * arm.length
    assert max(away) < 1e-3 * arm.length


@both
def test_a_step_says_how_the_tip_moves_and_yields(arm):
    tracker = sr.Tracker(arm, start=np.full(6, 1.0))
    step = tracker.step(tracker.step([0.0, 0.1, 0.1]).tip + [0.0, 0.0, 0.001])
    at = step.activations[None]
    slopes = as_tip_map(arm).tips_and_slopes(at)[1][0]
    np.testing.assert_allclose(step.jacobian, slopes, atol=1e-6 * np.abs(slopes).max())
    tracker.step([0.1, 0.1, 0.1])  # what is read later is of the step
    exact = sr.stiffness.tip_compliance(arm, at)[0]
    np.testing.assert_allclose(step.compliance, exact, atol=1e-6 * np.abs(exact).max())
    assert sr.Tracker(sr.designs.minimal_trunk()).step([0.3, 0.0, 0.5]).compliance is None


@both
def test_out_of_reach_the_tip_comes_as_near_as_it_can_and_the_step_says_so(arm):
    target = np.array([0.35, 0.1, 0.2 if arm is FREE else -0.2])
    tracker = sr.Tracker(arm, start=np.full(6, 0.5))
    steps = [tracker.step(target) for _ in range(60)]
    tips = sr.tip_positions(arm, arm.bounds[:, 1] * np.random.default_rng(0).random((20_000, 6)))
    nearest = np.linalg.norm(tips - target, axis=1).min()
    assert not steps[-1].reached
    assert steps[-1].at_bound
    assert steps[-1].distance < nearest
    assert np.diff([step.distance for step in steps]).max() <= 0.0
    assert "mm away; at a bound: " in str(steps[-1])


@both
def test_a_direction_is_reached_together_with_a_place(arm):
    gamma = np.array([[1.0, 2.0, 0.5, 2.0, 0.5, 1.0]])
    (tip,), _, (direction,), _ = as_tip_map(arm).tip_motions(gamma)
    tracker = sr.Tracker(arm, start=np.full(6, 1.0))
    for _ in range(40):
        step = tracker.step(tip, 3.0 * direction)
    assert step.reached
    assert step.angle < 1e-6


def test_an_arm_under_loads_goes_on_along_its_branch():
    """As the library continues postures in many small steps, where some ways would snap."""
    column = sr.designs.three_tendon_robot().replace(loads=sr.Loads(payload=0.1))
    tracker, here = sr.Tracker(column, start=[1.0, 0.0, 0.0]), as_tip_map(column)
    snaps, x = 0, tracker.activations[None]
    for angle in np.linspace(0.0, np.pi, 20):
        step = tracker.step([0.05 * np.cos(angle), 0.05 * np.sin(angle), 0.1])
        here, x = here.continued_from(x), step.activations[None]
        np.testing.assert_allclose(here.tips(x)[0], step.tip, atol=3e-6 * column.length)
        snaps += step.snaps
    assert snaps > 0


@pytest.mark.parametrize(("arm", "most"), [(FREE, 8.0), (HANGING, 6.0)], ids=["free", "hanging"])
def test_a_step_takes_as_long_as_a_few_tips_with_their_slopes(arm, most):
    """4.5 and 1.2 times as long, on their own thread, as other programs run beside."""
    gamma, tip_map = activations_of_path(arm, steps=1000)[:150], as_tip_map(arm)
    path, tracker = sr.tip_positions(arm, gamma), sr.Tracker(arm, start=gamma[0])
    times = np.empty((2, len(path)))
    for k, target in enumerate(path):
        begin = time.thread_time()
        tip_map.tips_and_slopes(gamma[k, None])
        between = time.thread_time()
        tracker.step(target)
        times[:, k] = between - begin, time.thread_time() - between
    call, step = np.median(times, axis=1)
    assert step < most * call


def test_narrower_bounds_are_kept_and_a_measured_state_is_gone_on_from():
    bounds = np.array([[0.5, 2.0]] * 6)
    tracker = sr.Tracker(FREE, bounds=bounds)
    np.testing.assert_allclose(tracker.activations, 0.5)
    for _ in range(30):
        x = tracker.step([0.3, 0.0, 0.1]).activations
    assert x.min() >= 0.5
    assert x.max() <= 2.0
    tracker.begin(np.full(6, 1.5))
    np.testing.assert_allclose(tracker.activations, 1.5)


def test_tendons_that_are_slack_at_the_start_are_pulled_in():
    cables = [
        LengthTendon(name=f"cable {k}", distance=0.008, offset=angle, activation_bounds=(0.0, 0.02))
        for k, angle in enumerate(np.arange(3) * 2.0 * np.pi / 3.0)
    ]
    arm = sr.designs.three_chamber_arm().replace(actuators=tuple(cables))
    tracker, target = sr.Tracker(arm), sr.tip_positions(arm, [[0.008, 0.002, 0.006]])[0]
    assert any(tracker.step(target).reached for _ in range(40))


DRIVE = Drive(name="left", gains={"proximal 1": 1.0}, bounds=(-1.0, 1.0), dead_zone=0.1)
REFUSED = {
    "rate": {"rate": [1.0, 2.0]},
    "period": {"period": 0.0},
    "bounds": {"bounds": [[0.0, 9.0]] * 6},
    "activations": {"start": [9.0] * 6},
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_in_a_line(name):
    with pytest.raises(sr.InvalidInput, match=f"^{name}"):
        sr.Tracker(FREE, **REFUSED[name])


def test_a_target_is_a_place_and_dead_zones_are_refused():
    tracker = sr.Tracker(FREE)
    for wrong in ([1.0, 2.0], [[0.0, 0.0, 0.1]] * 2, [np.nan, 0.0, 0.0]):
        with pytest.raises(sr.InvalidInput, match=r"^target"):
            tracker.step(wrong)
    with pytest.raises(sr.NotPossible, match="dead zones"):
        sr.Tracker(FREE.replace(drives=(DRIVE,)))
