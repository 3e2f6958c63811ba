"""Paths of the tip as values: drawn, kept in a state, refused."""

from __future__ import annotations

import json

import numpy as np
import pytest

from softreach.arm import designs
from softreach.plot.path_movie import frames_along
from softreach.studio.jobs.path import PATH_SHAPES, PLANES, drawn_path, straight_path
from softreach.studio.plots.histogram import shares
from softreach.studio.settings import MOST_POINTS, PlotSettings, TipPath
from softreach.studio.state import StudioState
from softreach.support.errors import InvalidInput

TIP = np.array([0.2, -0.1, 0.5])


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize("shape", PATH_SHAPES)
def test_a_drawn_path_begins_at_the_tip_stays_in_its_plane_and_is_as_large_as_asked(shape, plane):
    points = drawn_path(shape, plane, 0.2, TIP)
    np.testing.assert_allclose(points[0], TIP, atol=1e-15)
    extent = np.ptp(points, axis=0)
    out = next(k for k in range(3) if k not in PLANES[plane])
    assert extent[out] == 0.0
    assert extent.max() == pytest.approx(0.2, rel=1e-3)


@pytest.mark.parametrize(
    ("shape", "plane", "size"),
    [("star", "x, y", 0.1), ("circle", "up", 0.1), ("line", "x, y", 0.0), ("line", "x, y", np.nan)],
)
def test_what_cannot_be_drawn_is_refused(shape, plane, size):
    with pytest.raises(InvalidInput):
        drawn_path(shape, plane, size, TIP)


def test_a_straight_path_goes_through_its_corners_in_even_steps():
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0.0]])
    points = straight_path(corners, 30)
    for corner in corners:
        assert np.linalg.norm(points - corner, axis=1).min() < 1e-15
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    np.testing.assert_allclose(steps, 0.1, rtol=1e-9)


def test_a_state_keeps_its_path_and_its_plots():
    path = TipPath.through([[0, 0, 1.0], [0.1, 0, 0.9]], (-0.5, 0.0, 0.0))
    state = StudioState(design=designs.minimal_trunk(), path=path).showing(
        plots=PlotSettings(shown=("section",), parameter="taper")
    )
    assert StudioState.from_json(state.to_json()) == state


def test_a_state_of_before_there_were_plots_and_paths_opens():
    state = StudioState(design=designs.minimal_trunk())
    values = json.loads(state.to_json())
    del values["path"], values["appearance"]["plots"]
    assert StudioState.from_json(json.dumps(values)) == state


def test_a_state_with_a_switch_for_each_plot_opens():
    state = StudioState(design=designs.minimal_trunk())
    values = json.loads(state.to_json())
    values["appearance"]["plots"] = {"sweep": True, "section": False, "parameter": "taper"}
    plots = StudioState.from_json(json.dumps(values)).appearance.plots
    assert plots == PlotSettings(shown=("sweep",), parameter="taper")


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0, 1]],
        [[0, 0, 1]] * (MOST_POINTS + 1),
        [[0, 0, 1], [0, 0, np.inf]],
        [[0, 0], [1, 1]],
        [["a", 0, 0], [0, 0, 0]],
    ],
)
def test_a_path_that_cannot_be_followed_is_refused(points):
    with pytest.raises(InvalidInput, match="path"):
        TipPath.through(points)


@pytest.mark.parametrize("changes", [{"shown": (1,)}, {"parameter": None}])
def test_plot_settings_of_another_kind_are_refused(changes):
    with pytest.raises(InvalidInput, match="plots"):
        PlotSettings(**changes)


@pytest.mark.parametrize("count", [1, 2, 59, 60, 1000])
def test_an_animation_shows_the_first_and_the_last_point_and_no_more_than_sixty(count):
    shown = frames_along(count)
    assert shown[0] == 0
    assert shown[-1] == count - 1
    assert len(shown) == min(count, 60)


def test_shares_of_samples_in_bins_sum_up_to_one():
    rng = np.random.default_rng(1)
    bounds = np.array([[-1.0, 0.0], [0.0, 5.0], [2.0, 2.0]])
    activation = rng.uniform(*bounds.T, size=(1000, 3))
    np.testing.assert_allclose(shares(activation, bounds).sum(axis=1), 1.0)
