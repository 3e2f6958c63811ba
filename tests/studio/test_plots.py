"""Plots: what is computed of them, and how charts draw it."""

from __future__ import annotations

from contextlib import nullcontext
from types import SimpleNamespace

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.studio.plots.chart import Chart, Curve
from softreach.studio.plots.sweep import sweep
from softreach.studio.reach import Quality
from softreach.studio.shown_parameters import slider_parameters
from softreach.studio.state import MOST_POINTS, PlotSettings, StudioState, TipPath
from softreach.support.errors import InvalidInput

STATE = StudioState(design=designs.minimal_trunk())
QUICK = Quality(coarse_accuracy=0.1, tol=1e-4)


@pytest.fixture(scope="module")
def tapers():
    return list(sweep(STATE.design, slider_of(STATE.design, "taper"), QUICK, lambda: None))[-1]


def slider_of(arm, name):
    return next(each for each in slider_parameters(arm) if each.name == name)


def test_a_sweep_of_a_design_on_the_same_curve_goes_on_from_what_is_known(tapers):
    arm = changed(STATE.design, {"taper": np.radians(0.95)})
    first, second, last = sweep(arm, slider_of(arm, "taper"), QUICK, lambda: None, tapers)
    assert first.arm == arm  # the line is there before any volume
    assert first.parameter.shown == 0.95
    np.testing.assert_array_equal(first.value, tapers.value)
    assert not first.complete
    assert {*second.value} - {*tapers.value} == {0.95}
    assert last.complete
    assert second.refused == tapers.refused != ()
    low, middle, high = second.volume[np.searchsorted(second.value, 0.95) + [-1, 0, 1]]
    assert low < middle < high


@pytest.mark.parametrize("change", [{"revolution": 1.0}, {"taper": 0.02, "revolution": 1.0}])
def test_a_sweep_of_a_design_on_another_curve_begins_anew(tapers, change):
    arm = changed(STATE.design, change)
    first = next(sweep(arm, slider_of(arm, "taper"), QUICK, lambda: None, tapers))
    assert len(first.value) == 1
    assert tapers.moved(STATE.design, slider_of(STATE.design, "revolution")) is None


def test_a_line_in_a_chart_is_vertical_and_belongs_to_no_curve():
    drawn = []
    gui = SimpleNamespace(add_uplot=lambda data, *_, **options: drawn.append((data, options)))
    chart = Chart(gui, nullcontext(), "y")
    chart.show("x", np.array([0.0, 1.0]), (Curve("V", "red"),), (np.array([3.0, 4.0]),), 0.5)
    (x, curve, line), options = drawn[0]
    np.testing.assert_array_equal(x, [0, 0.5, 0.5, 1])
    np.testing.assert_array_equal(curve, [3, np.nan, np.nan, 4])
    np.testing.assert_array_equal(line, [np.nan, 0, 1, np.nan])
    assert options["scales"]["mark"]["range"] == (0, 1)


# Paths of the tip as values: kept in a state, refused


def test_a_state_keeps_its_path_and_its_plots():
    path = TipPath.through([[0, 0, 1.0], [0.1, 0, 0.9]], (-0.5, 0.0, 0.0))
    state = StudioState(design=designs.minimal_trunk(), path=path).showing(
        plots=PlotSettings(shown=("section",), parameter="taper")
    )
    assert StudioState.from_json(state.to_json()) == state


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
