"""Predicted markers are those of the arm, and their derivatives those of differences."""

import numpy as np
import pytest

import softreach as sr
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.model import MarkerModel
from softreach.rod.kinematics import marker_positions
from tests.calibration.arms import hanging_tentacle, pulled_wire, random_inputs

HEAVY = sr.Loads(payload=0.01, payload_arm=(0.005, 0.0, 0.02), tip_force=(0.02, 0.0, 0.0))
LIGHT = sr.Loads(payload=0.002)


def model_of(arm, free, inputs):
    count = max(1, len(arm.markers))
    return MarkerModel(free_numbers(arm, free), inputs, np.arange(count))


@pytest.mark.parametrize("arm", [hanging_tentacle(), hanging_tentacle(HEAVY)])
def test_places_are_those_of_the_markers(arm):
    inputs = random_inputs(arm, 5)
    places = model_of(arm, ["pose"], inputs).of_arm(arm).places
    np.testing.assert_allclose(places, marker_positions(arm, inputs, 1e-9), atol=1e-8)


@pytest.mark.parametrize("loads", [None, LIGHT])
def test_places_are_those_of_tips_pulled_by_length(loads):
    arm = pulled_wire(loads)
    inputs = 0.3 * random_inputs(arm, 4)
    places = model_of(arm, ["pose"], inputs).of_arm(arm).places
    np.testing.assert_allclose(places[:, 0], sr.tip_positions(arm, inputs, 1e-9), atol=2e-7)


def by_differences(model, values, way):
    """Derivative of places along a direction of the values, of fourth order."""
    step = 2e-3
    places = [model.predict(values + k * step * way).places for k in (-2, -1, 1, 2)]
    return (places[0] - 8 * places[1] + 8 * places[2] - places[3]) / (12 * step)


TENTACLE = [
    "pose",
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
    values = model.free.start
    slopes = model.predict(values, slopes=True).slopes
    assert slopes is not None
    count = len(values)
    ways = np.eye(count) if each else rng.choice([-1, 1], (2, count)) / np.sqrt(count)
    for way in ways * np.maximum(model.free.scale, 0.3 * np.abs(values)):
        change = by_differences(model, values, way)
        worst = np.abs(slopes @ way - change).max()
        reach = max(np.abs(change).max(), 1e-3 * arm.length)
        # Tensions under loads are found to 1e-11 L, over a step of 2e-3 of the scale.
        assert worst <= 1e-7 * reach + (3e-7 * reach if arm.loads else 0.0), way
