"""End to end: plots beside the scene that follow the arm, the design and the slice."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.arm.parameters import changed, find_parameter
from softreach.studio.state import PlotSettings, Slice


@pytest.fixture(autouse=True)
def _nothing_beside_the_scene(tab):
    yield
    tab.session.update(lambda s: s.showing(plots=PlotSettings(), slice=Slice()))
    tab.settle()


@pytest.mark.large
def test_the_volume_against_a_parameter_is_computed_while_one_looks(tab):
    tab.open("Plots")
    tab.page.get_by_label("V against parameter").check()
    tab.wait(lambda: "sweep" in tab.session.state.appearance.plots.shown, "it is wanted")
    tab.settle()
    tab.choose("parameter", "taper φ [deg]")
    tab.wait(lambda: tab.session.state.appearance.plots.parameter == "taper", "it is chosen")
    tab.page.get_by_text("here V =").wait_for()
    tab.settle()
    found, design = tab.session.found.sweep, tab.session.state.design
    assert found.complete
    assert (np.diff(found.value) > 0).all()
    assert found.refused  # the steepest tapers leave no tip
    tab.page.get_by_text(f"{len(found.refused)} values make no design").wait_for()
    made = changed(design, {"taper": np.radians(found.value[1])})
    assert found.volume[1] == pytest.approx(sr.reachable_set(made).volume, rel=0.02)


LINES = """Object.values(window.__viserTestpoints?.uplots ?? {}).map(({chart}) => {
    const x = chart.data[0], line = chart.data[chart.data.length - 1];
    return [...x].filter((_, k) => line[k] === 0 || line[k] === 1);
})"""
"""Places of the two ends of the line in each chart of the page."""


@pytest.mark.large
def test_a_line_stands_at_the_value_of_the_slider_and_follows_it(tab):
    settings = PlotSettings(shown=("sweep",), parameter="taper")
    tab.session.update(lambda s: s.showing(plots=settings))
    tab.settle()
    tab.wait(lambda: [2, 2] in tab.page.evaluate(LINES), "the line stands at 2 degrees")
    known = tab.session.found.sweep
    tab.drag("taper φ [deg]", -20)
    tab.settle()
    arm = tab.session.state.design
    there = pytest.approx([np.degrees(find_parameter(arm, "taper").value(arm))] * 2)
    tab.wait(lambda: there in tab.page.evaluate(LINES), "the line follows")
    after = tab.session.found.sweep
    assert {*known.value} < {*after.value}  # nothing was computed twice


def test_names_in_a_chart_are_text(tab):
    from softreach.studio.plots.chart import Chart, Curve

    gui = tab.session.client.gui
    folder = gui.add_folder("names")
    chart = Chart(gui, folder, "y")
    name = "<img src=x onerror=alert(1)>"
    chart.show("x", np.array([0.0, 1.0]), (Curve(name, "red"),), (np.array([0.0, 1.0]),))
    tab.page.get_by_text(name).wait_for()
    assert tab.page.locator("img[src=x]").count() == 0
    folder.remove()
