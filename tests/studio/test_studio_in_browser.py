"""End to end: what a person does in the page, and what the library says about it."""

from __future__ import annotations

import json
import tomllib

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.studio import Quality, StudioState
from softreach.studio import reach as stages
from softreach.studio.captions import size_text
from softreach.studio.work import all_cores
from tests.studio.conftest import SMALL


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


@pytest.mark.large
def test_a_state_is_saved_and_loaded(tab, tmp_path):
    tab.open("Export")
    kept = tab.session.state
    file = tab.save("Save this work", tmp_path)
    assert json.loads(file.read_text())["softreach_studio"] == 4
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


def test_nothing_leaves_the_machine_and_no_panel_of_viser_is_seen(tab, studio):
    assert not tab.page.evaluate("flashed")
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


# No design and no failure takes the server or the tab away


ENDLESS = Quality(coarse_level=12, fine_level=12, fine_accuracy=1e-5, most_seconds=3600.0)


@pytest.mark.large
def test_a_running_computation_is_canceled_and_taken_up_again(tab):
    tab.session.quality = ENDLESS
    five = changed(designs.minimal_trunk(), {"longitudinal.bundles": 3})
    tab.session.update(lambda s: s.replace(design=five))
    tab.page.get_by_text("computing the exact set").first.wait_for()
    tab.press("Cancel")
    tab.settle()
    tab.page.get_by_text("Canceled").first.wait_for()
    tab.session.quality = SMALL
    tab.press("Compute what is missing")
    tab.wait(lambda: tab.session.found.reach.fine, "the rest is computed")
    tab.settle()
    tab.page.get_by_text(
        size_text(tab.session.found.reach.size, tab.session.found.reach.arm)
    ).first.wait_for()


@pytest.mark.large
def test_what_runs_out_of_memory_says_so_and_the_next_change_is_computed(tab, monkeypatch):
    def fails(*_, **__):
        raise MemoryError

    monkeypatch.setattr(stages, "compute_cloud", fails)
    tab.session.update(lambda s: s.replace(design=changed(s.design, {"taper": 0.02})))
    tab.page.get_by_text("there is not enough free memory").first.wait_for()
    tab.settle()
    assert tab.page.get_by_text("computing").count() == 0
    monkeypatch.undo()
    tab.session.update(lambda s: s.replace(design=changed(s.design, {"taper": 0.03})))
    tab.settle()
    tab.page.get_by_text(
        size_text(tab.session.found.reach.size, tab.session.found.reach.arm)
    ).first.wait_for()


@pytest.mark.large
def test_a_hundred_bundles_show_a_cloud_and_say_what_is_left_out(tab):
    changes = {"longitudinal.bundles": 98, "extent": 0.02}
    tab.session.update(lambda s: s.replace(design=changed(designs.minimal_trunk(), changes)))
    tab.wait(lambda: tab.session.found.reach.arm == tab.session.state.design, "a cloud is there")
    tab.open("Move")
    tab.page.get_by_text("60 more bundles have no slider here").wait_for()
    tab.session.cancel()
    tab.settle()
