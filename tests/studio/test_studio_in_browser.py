"""End to end: what a person does in the page, and what the library says about it."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest

import softreach as sr
from softreach.arm.parameters import find_parameter
from softreach.studio import StudioState
from softreach.studio.captions import size_text
from softreach.studio.work import all_cores
from tests.studio.tab import Tab


@pytest.mark.large
def test_the_page_opens_with_the_volume_of_the_design_and_a_slider_changes_it(tab):
    assert not tab.page.evaluate("flashed")
    reach = tab.session.found.reach
    assert reach.fine
    tab.page.get_by_text(size_text(reach.size, reach.arm)).wait_for()
    assert reach.volume == pytest.approx(0.69, abs=0.02)
    assert tab.page.locator("canvas").count() > 0

    tab.open("Design")
    end = float(tab.slider("taper φ [deg]").get_attribute("aria-valuemax"))
    assert 3.5 < end < np.degrees(np.arctan(0.0625))  # beyond there is no tip
    before = tab.session.found.reach
    tab.drag("revolution Ω [deg]", 40)
    tab.wait(lambda: tab.session.state.design != before.arm, "the design changes")
    tab.settle()
    after = tab.session.found.reach
    assert after.fine
    assert after.arm == tab.session.state.design
    assert np.degrees(parameter(tab, "revolution")) > 130
    tab.page.get_by_text(size_text(after.size, after.arm)).wait_for()
    assert after.volume != before.volume
    first = slice(1 << 10)  # a tab keeps more samples than it needs
    assert not np.allclose(after.cloud.tip[first], before.cloud.tip[first])


@pytest.mark.large
def test_a_click_on_the_cloud_is_a_target_whose_other_solutions_are_ghosts(tab):
    tab.open("Move")
    tab.choose("mouse", "sets the target")
    tab.wait(lambda: tab.session.state.appearance.mouse == "target", "the mouse is for the target")
    tab.click_at(tab.session.found.reach.cloud.tip.values[100] / tab.session.state.design.length)
    tab.wait(lambda: tab.session.found.answer is not None, "a target is solved for")
    tab.settle()
    state, cloud = tab.session.state, tab.session.found.reach.cloud
    target = np.array(state.target)
    nearest = np.linalg.norm(cloud.tip.values - target, axis=1).argmin()
    known = sr.tip_positions(state.design, cloud.activation.values[[nearest]])[0]
    np.testing.assert_array_equal(target, known)
    tip = sr.tip_positions(state.design, [state.activation])[0]
    assert np.linalg.norm(tip - target) < 1e-6 * state.design.length
    tab.page.get_by_text("activation").filter(has_text="to ").first.wait_for()

    tab.open("Move")
    answer = tab.session.found.answer
    assert tab.page.get_by_role("button", name="\N{CHECK MARK}").count() == 1
    ghosts = [tab.drawn(f"/ghosts/{k}/0") for k in range(len(answer))]
    assert all(ghosts)
    tab.session.aim(np.array([0.0, 0.0, 1.5]))
    tab.settle()
    assert len(tab.session.found.answer) == 0
    tab.page.get_by_text("out of reach").wait_for()
    tab.page.get_by_text("m away").wait_for()


def parameter(tab, name: str) -> float:
    """What the design of a tab has of a parameter."""
    design = tab.session.state.design
    return find_parameter(design, name).value(design)


@pytest.mark.large
def test_a_state_is_saved_and_loaded(tab, tmp_path):
    tab.open("Export")
    kept = tab.session.state
    file = tab.save("Save this work", tmp_path)
    assert json.loads(file.read_text())["softreach_studio"] == 3
    tab.choose("data", "design (.toml)")
    design = tab.save("Save data", tmp_path)
    assert tomllib.loads(design.read_text())["profile"]["length_m"] == 1.0
    tab.session.update(
        lambda s: StudioState(design=sr.designs.minimal_trunk(1.0)).showing(level=12)
    )
    tab.settle()
    tab.upload("Load state or design", file)
    tab.wait(lambda: tab.session.state.design == kept.design, "the design is back")
    tab.settle()
    assert tab.session.state.replace(camera=None) == kept.replace(camera=None)
    assert tab.session.found.reach.arm == kept.design


@pytest.mark.large
def test_tabs_stay_apart(tab, browser, studio):
    kept, known = tab.session.state, set(studio.sessions)
    other = Tab(browser, studio)
    other.drag("revolution Ω [deg]", -30)
    other.wait(lambda: other.session.state != studio.start.state, "the other tab changes")
    other.settle()
    assert other.session.state.design != kept.design
    assert tab.session.state == kept
    assert tab.session.found.reach.arm == kept.design
    assert not other.errors
    other.close()
    tab.wait(lambda: set(studio.sessions) <= known, "the session of the closed tab ends")


def test_nothing_leaves_the_machine(tab, studio):
    assert tab.requests
    assert all(url.startswith((studio.url, f"blob:{studio.url}", "data:")) for url in tab.requests)


def test_a_bar_under_each_slider_says_how_the_volume_changes_and_fades_with_the_design(tab):
    bars = tab.page.locator("[role=img][title*='change of V']")
    tab.wait(lambda: tab.session.found.slopes and bars.count(), "the bars are there")
    slopes = tab.session.found.slopes
    assert bars.count() == len(slopes.slopes)
    slope, first = slopes.slopes["revolution"], bars.first
    assert f"∂V/∂(revolution) = {slope.value:.5f}"[:22] in first.get_attribute("title")
    percent = 100 * 0.01 * 359 * slope.value / slopes.volume
    shown = first.inner_text().split()[0].replace("\N{MINUS SIGN}", "-")
    assert float(shown) == pytest.approx(percent, rel=0.01)
    box, thumb = first.bounding_box(), tab.slider("revolution Ω [deg]").bounding_box()
    assert 0 < box["y"] - thumb["y"] < 45
    with all_cores:  # so that the new volume waits
        tab.drag("revolution Ω [deg]", 20)
        tab.page.locator("[role=img][title^='of the design before']").first.wait_for()
    tab.settle()
    assert tab.session.found.slopes.arm == tab.session.state.design
    tab.page.locator("[role=img][title^='of the design before']").first.wait_for(state="detached")

    last = tab.slider("offset of longitudinal [deg]")
    below = last.bounding_box()["y"] - first.bounding_box()["y"]
    tab.session.learn({"slopes": None})  # as in a tab that was opened a moment ago
    tab.page.locator("[role=img][title='not known yet']").first.wait_for()
    none = tab.page.locator("[role=img][title='not known yet']").first
    assert last.bounding_box()["y"] - none.bounding_box()["y"] == pytest.approx(below, abs=1)
