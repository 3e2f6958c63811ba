"""No design and no failure takes the server or the tab away."""

from __future__ import annotations

import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.studio import Quality
from softreach.studio import reach as stages
from softreach.studio.captions import size_text
from tests.studio.conftest import SMALL

ENDLESS = Quality(coarse_level=12, fine_level=12, fine_accuracy=1e-5, most_seconds=3600.0)


def five_bundles():
    return changed(designs.minimal_trunk(), {"longitudinal.bundles": 3})


def begin_endless(tab):
    tab.session.quality = ENDLESS
    tab.session.update(lambda s: s.replace(design=five_bundles()))
    tab.page.get_by_text("computing the exact set").first.wait_for()


@pytest.mark.large
def test_a_running_computation_is_canceled_and_taken_up_again(tab):
    begin_endless(tab)
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
