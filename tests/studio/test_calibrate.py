"""Calibration in a tab without a browser: poses are loaded, shown, fitted to and applied."""

from __future__ import annotations

from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Marker, designs
from softreach.arm.parameters import changed
from softreach.rod.kinematics import marker_positions
from softreach.studio import Studio
from softreach.studio.session import Session
from softreach.studio.tabs.calibrate import CalibratePanel
from tests.calibration.arms import table
from tests.studio.sockets import page

ARM = designs.minimal_trunk().replace(
    markers=(Marker(name="half", station=0.5, offset=(0.07, 0.0, 0.0)), Marker(name="tool"))
)
REAL = changed(ARM, {"taper": 0.012}).replace(base=sr.Base(position=(0.05, -0.02, 0.1)))
INPUTS = ARM.bounds[:, 0] * np.random.default_rng(3).random((20, 3))
NOISE = 2e-4 * np.random.default_rng(4).standard_normal((20, 2, 3))
PLACES = marker_positions(REAL, INPUTS) + NOISE


def file(name="bench.csv", markers=("half", "tool"), inputs=INPUTS) -> SimpleNamespace:
    """An upload of measured poses."""
    columns = table(PLACES, inputs, ("a", "b", "c"), markers)
    names = [key.removesuffix("_N") for key in columns]
    rows = np.column_stack(list(columns.values()))
    lines = [",".join(names), *(",".join(map(repr, row)) for row in rows.tolist())]
    return SimpleNamespace(name=name, content="\n".join(lines).encode())


@pytest.fixture(scope="module")
def opened(studio: Studio) -> Iterator[Session]:
    with page(studio) as session:
        session.update(lambda state: state.replace(design=ARM))
        yield session


@pytest.fixture
def session(opened) -> Session:
    opened.update(lambda state: state.replace(design=ARM, activation=()))
    opened.end_step()
    opened.learn({"bench": None})
    opened.settle()
    return opened


def panel_of(session) -> CalibratePanel:
    return next(panel for panel in session.panels if isinstance(panel, CalibratePanel))


def loaded(session, upload=None) -> CalibratePanel:
    panel = panel_of(session)
    panel._read(upload or file())
    session.settle()
    return panel


def moved(panel, session, sample) -> None:
    panel._at.value = sample
    panel._moved(SimpleNamespace(client_id=0))
    session.settle()


def fitted(panel, session, free) -> None:
    for name, box in panel._free.items():
        box.value = name in free
    panel._ask()
    session.settle()


def drawn(session, name):
    return session.client.scene.get_handle_by_name(name)


def test_the_arm_takes_the_inputs_of_a_sample_and_dots_stand_where_markers_are_and_were(session):
    panel = loaded(session)
    assert "bench.csv: 20 samples of half, tool" in panel._text._widget.content
    for sample in (0, 7):
        moved(panel, session, sample)
        assert session.state.activation == tuple(INPUTS[sample])
        predicted = marker_positions(ARM, INPUTS[sample])[0]
        for name, places in (("measured", PLACES[sample]), ("predicted", predicted)):
            dots = drawn(session, f"/sample/{name}").points
            np.testing.assert_allclose(dots, places / ARM.length, atol=1e-5)
        lines = drawn(session, "/sample/residuals").points
        np.testing.assert_allclose(lines[:, 0], PLACES[sample] / ARM.length, atol=1e-5)
        half, tool = 1e3 * np.linalg.norm(PLACES[sample] - predicted, axis=1)
        assert f"half {half:.3g} mm, tool {tool:.3g} mm" in panel._residuals._widget.content
    markers = drawn(session, "/arm/markers").points
    np.testing.assert_allclose(markers, predicted / ARM.length, atol=1e-3)


def test_a_sample_is_shown_only_while_the_arm_has_its_inputs(session):
    panel = loaded(session)
    session.update(lambda state: state.replace(activation=()))
    session.settle()
    assert drawn(session, "/sample/measured") is None
    assert "not at a measured pose" in panel._residuals._widget.content
    session.step(back=True)
    session.settle()
    assert drawn(session, "/sample/measured") is not None


def test_inputs_beyond_the_bounds_are_said_and_their_markers_predicted_as_they_are(session):
    far = INPUTS.copy()
    far[0] = (0.5, 0.0, 0.0)
    panel = loaded(session, file(inputs=far))
    assert session.state.activation == (0.0, 0.0, 0.0)
    assert "beyond the bounds" in panel._residuals._widget.content
    straight = marker_positions(ARM, (0.0, 0.0, 0.0))[0] / ARM.length
    assert np.abs(drawn(session, "/sample/predicted").points - straight).max() > 0.01


def test_a_fit_finds_the_numbers_of_the_arm_and_applying_it_can_be_undone(session):
    panel = loaded(session)
    fitted(panel, session, ("pose", "taper"))
    summary = panel._summary._widget.content
    for words in ("pose.x", "taper", "±", "20 fitted", "constant curvature", "limited by"):
        assert words in summary
    assert np.nanmax(session.found.sample.distances) < 2e-3
    assert drawn(session, "/sample/arm/0") is not None
    panel._applied()
    session.settle()
    design = session.state.design
    assert design == session.found.bench.result.arm
    assert design.base.position == pytest.approx(REAL.base.position, abs=2e-4)
    assert design.profile.taper == pytest.approx(REAL.profile.taper, abs=2e-4)
    assert drawn(session, "/sample/arm/0") is None
    session.step(back=True)
    session.settle()
    assert session.state.design == ARM


@pytest.mark.large
def test_a_design_that_was_changed_since_the_fit_is_not_replaced(session):
    panel = loaded(session)
    fitted(panel, session, ("pose",))
    assert panel._apply.visible
    other = changed(ARM, {"taper": 0.02})
    session.update(lambda state: state.replace(design=other))
    session.settle()
    assert not panel._apply.visible
    with pytest.raises(sr.InvalidInput, match="changed since the fit"):
        panel._applied()
    assert session.state.design == other


def test_data_of_another_arm_is_no_longer_shown(session):
    panel = loaded(session)
    session.update(lambda state: state.replace(design=ARM.replace(markers=())))
    session.settle()
    assert drawn(session, "/sample/measured") is None
    with pytest.raises(sr.InvalidInput, match="load the data again"):
        panel._pose(session.found.bench)
