"""A tab without a browser: what a click hits, and what its panels are told."""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np
import pytest

from softreach.studio.reach import cloud_points
from softreach.studio.session import Session
from tests.studio.sockets import page


@pytest.fixture
def session(studio) -> Iterator[Session]:
    with page(studio) as opened:
        yield opened


def clicked_path(session: Session, origin, direction) -> np.ndarray | None:
    """The path [L] after a click that may lead it on."""
    (panel,) = (one for one in session.panels if type(one).__name__ == "PathPanel")
    session.update(lambda state: state.showing(mouse="path"))
    panel.click(origin, direction)
    assert session.settle()
    path, length = session.state.path, session.state.design.length
    return None if path is None else np.array(path.points) / length


def test_a_click_for_a_path_hits_no_point_that_is_cut_away(session):
    session.update(lambda state: state.showing(cut="half"))
    assert session.settle()
    points = cloud_points(session.reach, session.state.appearance.level)
    hidden = session.scene.clouds.hidden(points)
    eye = np.asarray(session.client.camera.position)
    distance = np.linalg.norm(points - eye, axis=1)
    target = points[np.argmin(np.where(hidden, distance, np.inf))]
    path = clicked_path(session, eye, target - eye)
    assert path is None or not session.scene.clouds.hidden(path[-1:]).any()


def test_a_tab_at_rest_is_told_again_without_looking_up_any_parameter_of_its_design(session):
    calls: list[str] = []

    def watch(frame, event, argument) -> None:
        del argument
        if event == "call" and "parameter" in frame.f_globals.get("__name__", ""):
            calls.append(frame.f_code.co_qualname)

    sys.setprofile(watch)
    try:
        session.show()
    finally:
        sys.setprofile(None)
    assert len(calls) < 10  # all sliders took a hundred
