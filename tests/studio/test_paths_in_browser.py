"""End to end: a path of the tip is loaded, clicked, followed, played and saved."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr

ACTIVATION = (-1.0, -0.2, -0.5)


@pytest.fixture(autouse=True)
def _begin(tab):
    tab.session.update(lambda s: s.replace(path=None, activation=ACTIVATION, target=None))
    tab.settle()
    tab.open("Move")


def circled(tab, folder):
    """A circle of 97 points from where the tip is, from a file."""
    around = 2 * np.pi * np.linspace(0, 1, 97)
    offset = 0.05 * np.stack([np.cos(around) - 1, np.sin(around), 0 * around], axis=1)
    tip = sr.tip_positions(tab.session.state.design, [ACTIVATION])[0]
    file = folder / "circle.csv"
    np.savetxt(file, tip + offset, "%.17g", ",", header="x,y,z", comments="")
    load(tab, file)
    tab.wait(lambda: tab.session.found.track is not None, "the path is followed")
    tab.settle()
    return tab.session.found.track


@pytest.mark.large
def test_playing_leads_the_arm_to_the_end_and_the_slider_back(tab, tmp_path):
    found = circled(tab, tmp_path)
    tab.press("Play")
    tab.wait(lambda: tab.session.state.path.at > 2, "the arm moves")
    tab.press("Stop")
    tab.settle()
    stopped = tab.session.state.path.at
    assert stopped < 96
    tab.press("Play")
    tab.wait(lambda: tab.session.state.path.at == 96, "the arm is at the end")
    tab.settle()
    np.testing.assert_allclose(tab.session.state.activation, found.activation.values[-1])
    tab.drag("point", -60)
    tab.wait(lambda: tab.session.state.path.at < 96, "the arm goes back")
    tab.settle()
    at, state = tab.session.state.path.at, tab.session.state
    np.testing.assert_allclose(state.activation, found.activation.values[at])
    place = found.position.values[at] / state.design.length
    np.testing.assert_allclose(tab.session.found.tip, place, atol=2e-5)


@pytest.mark.large
def test_the_page_says_where_the_branch_ends_and_why(tab, tmp_path):
    state = tab.session.state
    tip = sr.tip_positions(state.design, [ACTIVATION])[0]
    file = tmp_path / "out.csv"
    share = np.linspace(0, 1, 21)[:, None]
    np.savetxt(file, tip + share * [1.5, 0, 0], "%.9g", ",", header="x,y,z", comments="")
    load(tab, file)
    tab.page.get_by_text("of 21 points are followed").wait_for()
    tab.settle()
    found = tab.session.found.track
    assert found.attrs["end"] in ("bound", "fold")
    reason = "bound." if found.attrs["end"] == "bound" else "turns back"
    assert tab.page.get_by_text(reason).count()
    end = tab.drawn("/path/end")
    np.testing.assert_allclose(end.position, found.end_position / state.design.length, atol=1e-6)


def load(tab, path) -> None:
    with tab.page.expect_file_chooser() as caught:
        tab.press("Load a path (CSV)")
    caught.value.set_files(path)
