"""Measured poses in a tab without a browser: their markers over the arm, and a fit to them."""

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Marker, designs
from softreach.arm.parameters import changed
from softreach.calibration.measurements import read_measurements
from softreach.rod.kinematics import marker_positions
from softreach.studio.found import Bench
from softreach.studio.session import Session
from tests.calibration.arms import table

ARM = designs.minimal_trunk().replace(
    markers=(Marker(name="half", station=0.5, offset=(0.07, 0.0, 0.0)), Marker(name="tool"))
)
REAL = changed(ARM, {"taper": 0.012}).replace(base=sr.Base(position=(0.05, -0.02, 0.1)))
INPUTS = ARM.bounds[:, 0] * np.random.default_rng(3).random((20, 3))
NAMES, MARKERS = ("a", "b", "c"), ("half", "tool")
NOISE = 2e-4 * np.random.default_rng(4).standard_normal((20, 2, 3))
PLACES = marker_positions(REAL, INPUTS) + NOISE


@pytest.fixture
def session(opened) -> Session:
    opened.update(lambda state: state.replace(design=ARM, activation=()))
    opened.end_step()
    opened.learn({"bench": None})
    opened.settle()
    return opened


def shown(session, number=0, inputs=INPUTS) -> None:
    """Load measured poses, and bring the arm to one of them."""
    columns = table(PLACES, inputs, NAMES, MARKERS).items()
    data = read_measurements(ARM, {name.removesuffix("_N"): [*row] for name, row in columns})
    bench = Bench(data=data, arm=ARM, number=number, free=("pose", "taper"))
    session.update(bench.posed)
    session.learn({"bench": bench})
    session.settle()


def drawn(session, name):
    return session.client.scene.get_handle_by_name(name)


def test_dots_stand_where_the_markers_of_a_pose_are_and_were_measured(session):
    for number in (0, 7):
        shown(session, number)
        predicted = marker_positions(ARM, INPUTS[number])[0]
        for name, places in (("measured", PLACES[number]), ("predicted", predicted)):
            dots = drawn(session, f"/sample/{name}").points
            np.testing.assert_allclose(dots, places / ARM.length, atol=1e-5)
        lines = drawn(session, "/sample/residuals").points
        np.testing.assert_allclose(lines[:, 0], PLACES[number] / ARM.length, atol=1e-5)
        distances = np.linalg.norm(PLACES[number] - predicted, axis=1)
        np.testing.assert_allclose(session.found.sample.distances, distances, atol=1e-9)
    markers = drawn(session, "/arm/markers").points
    np.testing.assert_allclose(markers, predicted / ARM.length, atol=1e-3)


def test_a_pose_is_shown_only_while_the_arm_has_its_inputs_and_its_markers(session):
    shown(session)
    session.update(lambda state: state.replace(activation=()))
    session.settle()
    assert drawn(session, "/sample/measured") is None
    session.step(back=True)
    session.settle()
    assert drawn(session, "/sample/measured") is not None
    session.update(lambda state: state.replace(design=ARM.replace(markers=())))
    session.settle()
    assert drawn(session, "/sample/measured") is None


def test_inputs_beyond_the_bounds_have_their_markers_predicted_as_they_are(session):
    far = INPUTS.copy()
    far[0] = (0.5, 0.0, 0.0)
    shown(session, inputs=far)
    assert session.state.activation == (0.0, 0.0, 0.0)
    straight = marker_positions(ARM, (0.0, 0.0, 0.0))[0] / ARM.length
    assert np.abs(drawn(session, "/sample/predicted").points - straight).max() > 0.01


def test_a_calibrated_arm_belongs_to_the_design_that_the_fit_began_with(session):
    shown(session)
    session.follow("fit")
    session.settle()
    bench = session.found.bench
    assert bench.fitted(ARM) == bench.result.arm
    assert bench.fitted(changed(ARM, {"taper": 0.02})) is None
    assert np.nanmax(session.found.sample.distances) < 2e-3
    assert drawn(session, "/sample/arm/0") is not None
