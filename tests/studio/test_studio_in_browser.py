"""End to end: what a person does in the page, and what the library says about it."""

from __future__ import annotations

import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.studio import Quality
from softreach.studio import reach as stages
from softreach.studio.captions import size_text
from softreach.studio.work import all_cores
from tests.studio.conftest import SMALL


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
