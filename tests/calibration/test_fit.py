"""Fits find the arm that was measured, and say rightly how sure they are."""

import re

import numpy as np
import pytest

import softreach as sr
from softreach.arm.parameters import changed
from softreach.calibration.calibration import leave_one_run_out
from softreach.calibration.errors import judged, repeatability
from softreach.calibration.fit import identifiable
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.measurements import marker_names, read_measurements
from softreach.calibration.model import MarkerModel
from softreach.rod.kinematics import marker_positions
from tests.calibration.arms import (
    MODULUS,
    hanging_tentacle,
    measured,
    pulled_wire,
    random_inputs,
    table,
)


def test_poses_without_noise_lead_back_to_the_arm():
    truth = hanging_tentacle(sr.Loads(payload=0.01))
    start = truth.replace(
        base=sr.Base(position=(1.0, 0.0, 0.0)),
        rest=sr.arm.RestShape(curvature_x=0.5),
        actuators=(truth.actuators[0].replace(distance=0.007),),
    )
    free = ["pose", "t.distance", "rest.curvature_x", "markers.half.offset[0]"]
    data = measured(truth, 5, noise=0.0)
    # Gravity is known in the world, so that the data says which way is up.
    result = sr.calibrate(start, data, free=free, rivals=False, robust=False)
    assert result.train.rms < 1e-6
    assert result.values["t.distance"] == pytest.approx(0.009, rel=1e-3)
    assert result.values["rest.curvature_x"] == pytest.approx(0.0, abs=1e-2)
    np.testing.assert_allclose(result.arm.base.rotation, truth.base.rotation, atol=1e-3)


def test_data_of_a_camera_without_a_scale_lead_back_to_the_arm():
    truth = hanging_tentacle()
    data = measured(truth, 12, noise=0.0)
    data |= {name: 0.37 * x for name, x in data.items() if name.endswith("_mm")}
    free = ["scale", "pose", "t.distance"]
    start = truth.replace(actuators=(truth.actuators[0].replace(distance=0.008),))
    result = sr.calibrate(start, data, free=free, rivals=False, robust=False)
    assert result.train.rms < 1e-6
    assert result.values["scale"] == pytest.approx(0.37, rel=1e-4)
    assert result.values["t.distance"] == pytest.approx(0.009, rel=1e-3)
    assert result.errors_on(data).rms < 1e-6
    assert result.before.rms < 1e-2  # of the design, at the scale of the data
    assert re.search(r"scale +0\.37\d* ± .* 1$", str(result), re.MULTILINE)


def test_tendons_driven_by_length_are_found_with_their_slack():
    truth = pulled_wire()
    tendon = truth.actuators[0].replace(slack=0.4e-3, tendon_stiffness=5e3)
    truth = truth.replace(actuators=(tendon, truth.actuators[1]))
    data = measured(truth, noise=0.0, inputs=0.3 * random_inputs(truth, 40))
    free = ["s1.slack", "s1.tendon_stiffness", "pose.z"]
    result = sr.calibrate(pulled_wire(), data, free=free, rivals=False, robust=False)
    assert result.values["s1.slack"] == pytest.approx(0.4e-3, abs=2e-6)
    assert result.values["s1.tendon_stiffness"] == pytest.approx(5e3, rel=1e-2)


def test_the_axes_of_a_flat_strip_and_their_stiffnesses_are_found():
    own = sr.arm.Measured(
        axial_stiffness=1e5, bending_stiffness=(0.01, 0.03), torsion_stiffness=0.01
    )
    start = pulled_wire()
    start = start.replace(section=start.section.replace(measured=own))
    true = {"measured.bending_stiffness[1]": 0.04, "measured.angle": 0.3}
    truth = changed(start, true)
    data = measured(truth, noise=0.0, inputs=0.3 * random_inputs(truth, 40))
    result = sr.calibrate(start, data, free=list(true), rivals=False, robust=False)
    assert result.train.rms < 1e-6
    for name, value in true.items():
        assert result.values[name] == pytest.approx(value, rel=1e-3)


def test_each_tendon_may_have_its_own_slack():
    truth, zeros = pulled_wire(), (0.4e-3, 0.0, -0.3e-3)
    inner, outer = truth.actuators
    truth = truth.replace(actuators=(inner.replace(slack=zeros, tendon_stiffness=5e3), outer))
    data = measured(truth, noise=0.0, inputs=0.3 * random_inputs(truth, 60))
    start = changed(pulled_wire(), {"s1.tendon_stiffness": 5e3})
    free = ["s1.slack[*]", "pose.z"]
    result = sr.calibrate(start, data, free=free, rivals=False, robust=False)
    found = [result.values[f"s1.slack[{k}]"] for k in range(3)]
    np.testing.assert_allclose(found, zeros, atol=2e-6)
    assert result.arm.actuators[0].slack == tuple(found)


def test_a_prior_and_the_data_share_a_number_by_their_widths():
    truth = hanging_tentacle()
    data = measured(truth, 12, noise=1e-3)
    options = {"free": [MODULUS], "rivals": False, "robust": False, "noise": 1e-3}
    alone = sr.calibrate(truth, data, **options)
    mean, sigma = alone.values[MODULUS], alone.sigma[MODULUS]
    both = sr.calibrate(truth, data, prior={MODULUS: (mean + 4 * sigma, sigma)}, **options)
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
    del data["run"]
    unaware = sr.calibrate(arm, data, free=[MODULUS], rivals=False)
    assert by_run.values == unaware.values
    assert by_run.sigma[MODULUS] != pytest.approx(unaware.sigma[MODULUS], rel=0.05)


def test_bands_are_those_of_the_arms_that_are_as_likely():
    arm = hanging_tentacle()
    result = sr.calibrate(arm, measured(arm, 20, noise=1e-3), free=FREE[:2], rivals=False)
    inputs = random_inputs(arm, 3, seed=9)
    places, sigma = result.predict(inputs, numbers_only=True)
    np.testing.assert_allclose(places, marker_positions(result.arm, inputs, 1e-9), atol=1e-7)
    best, spread = result.band(lambda other: marker_positions(other, inputs), count=100)
    np.testing.assert_allclose(best, places, atol=1e-6)
    np.testing.assert_allclose(spread, sigma, rtol=0.3, atol=1e-6)


def test_predictions_hold_measured_places_as_often_as_they_say():
    """Markers differ in noise, and so do directions."""
    arm, rng = hanging_tentacle(), np.random.default_rng(5)
    noise = np.array([[4e-4, 8e-4, 2e-3], [3e-3, 1e-3, 5e-4]])
    inputs, later = random_inputs(arm, 60), random_inputs(arm, 500, seed=9)
    places = marker_positions(arm, inputs, 1e-9)
    places += noise * rng.standard_normal(places.shape)
    data = table(places, inputs, arm.input_names, ["half", "tool"])
    for out in (0.0, 0.5):
        result = sr.calibrate(arm, data, free=FREE, rivals=False, hold_out=out)
        predicted, sigma = result.predict(later)
        measured = marker_positions(arm, later, 1e-9)
        measured += noise * rng.standard_normal(measured.shape)
        # 95 % of a normal distribution; of 30 poses σ itself is known to 13 %.
        held = (np.abs(predicted - measured) <= 2 * sigma).mean(axis=0)
        assert held.min() > 0.88
        assert held.max() < 0.99


def test_whole_runs_are_held_out_where_there_are_eight():
    arm = hanging_tentacle()

    def fit(runs, **options):
        data = measured(arm, 32, runs=runs)
        options = {"free": [MODULUS], "rivals": False, "hold_out": 0.25} | options
        return sr.calibrate(arm, data, **options)

    many, few, chosen, single = fit(8), fit(4), fit(4, hold_out_runs=True), fit(1)
    assert many.held_runs
    assert chosen.held_runs
    assert not few.held_runs
    assert many.held.sum() == chosen.held.sum() == few.held.sum() == 8
    assert "8 in held-out runs" in str(many)
    assert "rows of one motion are neighbors" in str(few)
    for result in (many, chosen, single):
        assert "rows of one motion" not in str(result)
    with pytest.raises(sr.NotPossible, match="two runs or more"):
        fit(1, hold_out_runs=True)


def test_a_row_that_names_no_run_leaves_the_others_theirs():
    arm = hanging_tentacle()
    data = measured(arm, 12, runs=3)
    data["run"][4] = None
    assert {"run 0", "run 1", "run 2"} < {*read_measurements(arm, data).run_names}


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
    data = read_measurements(arm, measured(arm, inputs=inputs))

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


HEAVY = sr.Loads(payload=0.01, payload_arm=(0.005, 0.0, 0.02), tip_force=(0.02, 0.0, 0.0))
LIGHT = sr.Loads(payload=0.002)


def model_of(arm, free, inputs):
    return MarkerModel(free_numbers(arm, free), inputs, marker_names(arm))


ARMS = [hanging_tentacle(), hanging_tentacle(HEAVY), pulled_wire(), pulled_wire(LIGHT)]


@pytest.mark.parametrize("arm", ARMS)
def test_places_are_those_of_the_markers_or_of_the_tip(arm):
    inputs = (1.0 if arm.markers else 0.3) * random_inputs(arm, 2)
    places = model_of(arm, ["pose"], inputs).of_arm(arm).places
    if arm.markers:
        np.testing.assert_allclose(places, marker_positions(arm, inputs, 1e-9), atol=1e-8)
    else:
        np.testing.assert_allclose(places[:, 0], sr.tip_positions(arm, inputs, 1e-9), atol=2e-7)


def test_only_the_numbers_that_trade_are_refused(rng):
    free = free_numbers(hanging_tentacle(), [MODULUS, "t.distance", "pose"])
    slopes = rng.standard_normal((60, len(free))) / free.scale
    identifiable(free, slopes)
    slopes[:, 3] = (slopes[:, 2] * free.scale[2] - slopes[:, 4] * free.scale[4]) / free.scale[3]
    slopes[:, 7] = -2.0 * slopes[:, 6] * free.scale[6] / free.scale[7]
    with pytest.raises(sr.InvalidInput, match=r"^free = pose.ry, pose.rz: must be numbers that"):
        identifiable(free, slopes)


def by_differences(model, values, way):
    """Derivative of places along a direction of the values, of fourth order."""
    step = 2e-3
    places = [model.predict(values + k * step * way).places for k in (-2, -1, 1, 2)]
    return (places[0] - 8 * places[1] + 8 * places[2] - places[3]) / (12 * step)


TENTACLE = [
    "pose",
    "scale",
    "rings[0].material.young_modulus",
    "rings[0].material.density",
    "rings[0].material.poisson_ratio",
    "length",
    "outer_radius",
    "taper",
    "t.distance",
    "t.offset",
    "t.end_over_length",
    "rest.curvature_y",
    "markers.half.station",
    "markers.tool.offset[0]",
]
WIRE = [
    "pose",
    "s1.tendon_stiffness = s2.tendon_stiffness",
    "s1.slack",
    "s2.distance",
    "s2.offset",
    "rest.curvature_x",
    "rest.twist",
    "length",
    "outer_radius",
    "s1.end_over_length",
]


@pytest.mark.parametrize(
    ("arm", "free", "share", "each"),
    [
        pytest.param(hanging_tentacle(), TENTACLE, 1.0, True, id="tentacle"),
        pytest.param(hanging_tentacle(HEAVY), TENTACLE, 1.0, False, id="heavy tentacle"),
        pytest.param(pulled_wire(), WIRE, 0.3, True, id="wire"),
        pytest.param(pulled_wire(LIGHT), WIRE, 0.3, False, id="heavy wire"),
        *(
            pytest.param(*case, id=name, marks=pytest.mark.large)
            for name, case in {
                "each of a heavy tentacle": (hanging_tentacle(HEAVY), TENTACLE, 1.0, True),
                "each of a heavy wire": (pulled_wire(LIGHT), WIRE, 0.3, True),
            }.items()
        ),
    ],
)
def test_derivatives_are_those_of_differences(arm, free, share, each, rng):
    """By each number, or along two directions in which all of them change."""
    model = model_of(arm, free, share * random_inputs(arm, 2, seed=3))
    values = model.free.start * np.where(np.array(model.free.names) == "scale", 1.3, 1.0)
    slopes = model.predict(values, slopes=True).slopes
    count = len(values)
    ways = np.eye(count) if each else rng.choice([-1, 1], (2, count)) / np.sqrt(count)
    for way in ways * np.maximum(model.free.scale, 0.3 * np.abs(values)):
        change = by_differences(model, values, way)
        worst = np.abs(slopes @ way - change).max()
        reach = max(np.abs(change).max(), 1e-3 * arm.length)
        # Tensions under loads are found to 1e-11 L, over a step of 2e-3 of the scale.
        assert worst <= 1e-7 * reach + (3e-7 * reach if arm.loads else 0.0), way
