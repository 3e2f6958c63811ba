"""Fits find the arm that was measured, and say rightly how sure they are."""

import numpy as np
import pytest

import softreach as sr
from softreach.calibration.calibration import leave_one_run_out
from softreach.calibration.errors import judged, repeatability
from softreach.calibration.measurements import read_measurements
from softreach.rod.kinematics import marker_positions
from tests.calibration.arms import hanging_tentacle, pulled_wire, random_inputs, table

MODULUS = "rings[0].material.young_modulus"


def columns(arm, inputs, places):
    """A table of measured poses."""
    names = [name.replace(" ", "_") for name in arm.input_names]
    unit = arm.input_units[0]
    markers = [marker.name for marker in arm.markers] or ["tip"]
    return table(places, inputs, names, markers, "mm" if unit == "m" else unit)


def measured(arm, count, noise=0.0, seed=0, shared=0.0, runs=1):
    """Poses of an arm with noise of each coordinate, and an error that each run shares [m]."""
    rng = np.random.default_rng(seed)
    inputs = random_inputs(arm, count, seed)
    places = marker_positions(arm, inputs, 1e-9)
    run = np.arange(count) % runs
    places = places + noise * rng.standard_normal(places.shape)
    places = places + shared * rng.standard_normal((runs, *places.shape[1:]))[run]
    data = columns(arm, inputs, places)
    return data | {"run": [f"run {k}" for k in run]} if runs > 1 else data


def test_poses_without_noise_lead_back_to_the_arm():
    truth = hanging_tentacle(sr.Loads(payload=0.01))
    start = truth.replace(
        base=sr.Base(position=(1.0, 0.0, 0.0)),
        rest=sr.arm.RestShape(curvature_x=0.5),
        actuators=(truth.actuators[0].replace(distance=0.007),),
    )
    free = ["pose", "t.distance", "rest.curvature_x", "markers.half.offset[0]"]
    data = measured(truth, 5)
    # Gravity is known in the world, so that the data says which way is up.
    result = sr.calibrate(start, data, free=free, rivals=False, robust=False)
    assert result.train.rms < 1e-6
    assert result.values["t.distance"] == pytest.approx(0.009, rel=1e-3)
    assert result.values["rest.curvature_x"] == pytest.approx(0.0, abs=1e-2)
    np.testing.assert_allclose(result.arm.base.rotation, truth.base.rotation, atol=1e-3)


def test_tendons_driven_by_length_are_found_with_their_slack():
    truth = pulled_wire()
    tendon = truth.actuators[0].replace(slack=0.4e-3, tendon_stiffness=5e3)
    truth = truth.replace(actuators=(tendon, truth.actuators[1]))
    inputs = 0.3 * random_inputs(truth, 40)
    data = columns(truth, inputs, sr.tip_positions(truth, inputs, 1e-9)[:, None])
    free = ["s1.slack", "s1.tendon_stiffness", "pose.z"]
    result = sr.calibrate(pulled_wire(), data, free=free, rivals=False, robust=False)
    assert result.values["s1.slack"] == pytest.approx(0.4e-3, abs=2e-6)
    assert result.values["s1.tendon_stiffness"] == pytest.approx(5e3, rel=1e-2)


def test_a_prior_and_the_data_share_a_number_by_their_widths():
    truth = hanging_tentacle()
    data = measured(truth, 12, noise=1e-3)
    alone = sr.calibrate(truth, data, free=[MODULUS], rivals=False, robust=False, noise=1e-3)
    mean, sigma = alone.values[MODULUS], alone.sigma[MODULUS]
    prior = {MODULUS: (mean + 4 * sigma, sigma)}
    both = sr.calibrate(
        truth, data, free=[MODULUS], prior=prior, rivals=False, robust=False, noise=1e-3
    )
    middle = (both.values[MODULUS] - mean) / (4 * sigma)
    assert 0.3 < middle < 0.7


FREE = [MODULUS, "t.distance", "pose.x", "pose.rz"]
TRUTH = np.array([3e5, 0.009, 0.0, 0.0])


def hits(count, repeats, **noise):
    """Share of the intervals of 95 % that hold the number."""
    arm = hanging_tentacle()
    found = []
    for seed in range(repeats):
        data = measured(arm, count, seed=seed, **noise)
        result = sr.calibrate(arm, data, free=FREE, rivals=False)
        found.append(np.abs(result.fit.values - TRUTH) <= result.uncertainty.half_widths())
    return np.mean(found)


@pytest.mark.large
@pytest.mark.parametrize(
    ("count", "noise"),
    [
        (12, {"noise": 1e-3}),
        (40, {"noise": 1e-3}),
        (60, {"noise": 1e-3, "shared": 2e-3, "runs": 10}),
        (90, {"noise": 1e-3, "shared": 2e-3, "runs": 30}),
    ],
)
def test_intervals_hold_the_number_as_often_as_they_say(count, noise):
    # 400 or more intervals: three standard deviations of their share are 3 %.
    assert 0.92 <= hits(count, 120, **noise) <= 0.98


def test_errors_shared_by_runs_widen_the_intervals():
    arm = hanging_tentacle()
    data = measured(arm, 48, noise=3e-4, shared=2e-3, runs=12)
    by_run = sr.calibrate(arm, data, free=[MODULUS], rivals=False)
    assert by_run.uncertainty.clusters == "run"
    unaware = sr.calibrate(
        arm, {k: v for k, v in data.items() if k != "run"}, free=[MODULUS], rivals=False
    )
    assert by_run.values == unaware.values
    assert by_run.sigma[MODULUS] != pytest.approx(unaware.sigma[MODULUS], rel=0.05)


def test_bands_are_those_of_the_arms_that_are_as_likely():
    arm = hanging_tentacle()
    result = sr.calibrate(arm, measured(arm, 20, noise=1e-3), free=FREE[:2], rivals=False)
    inputs = random_inputs(arm, 3, seed=9)
    places, sigma = result.predict(inputs)
    np.testing.assert_allclose(places, marker_positions(result.arm, inputs, 1e-9), atol=1e-7)
    best, spread = result.band(lambda other: marker_positions(other, inputs), count=200)
    np.testing.assert_allclose(best, places, atol=1e-6)
    np.testing.assert_allclose(spread, sigma, rtol=0.3, atol=1e-6)


def test_a_run_left_out_is_predicted_by_the_others():
    arm = hanging_tentacle()
    errors = leave_one_run_out(arm, measured(arm, 12, noise=1e-3, runs=3), free=[MODULUS])
    assert list(errors) == ["run 0", "run 1", "run 2"]
    assert all(0.5e-3 < each.rms < 4e-3 for each in errors.values())


def test_samples_far_off_are_slips_if_they_are_few_and_of_different_inputs():
    arm = hanging_tentacle()
    corners = np.stack(np.meshgrid(*[[0.0, 2.0]] * 3), axis=-1).reshape(-1, 3)
    inputs = np.tile(corners, (15, 1))
    left = 1e-3 * np.random.default_rng(0).standard_normal((len(inputs), 2, 3))
    data = read_measurements(arm, columns(arm, inputs, marker_positions(arm, inputs) - left))

    def verdict(rows):
        far = np.isin(np.arange(len(inputs)), rows)
        off = left + 0.05 * far[:, None, None]
        return judged(data, off, repeatability(data, left), np.zeros(len(inputs), bool), far)

    slips, many, one = verdict([3, 52]), verdict(range(0, 99, 9)), verdict(range(5, 120, 8))
    assert slips.limit == "noise"
    assert "mm without the rows far off" in slips.sentence
    assert "11 of 120 rows are far off, more than slips would be" in many.sentence
    assert "15 of 15 rows with inputs such as" in one.sentence
    assert {many.limit, one.limit} == {"physics"}
