"""Undone, done again, reset, and still there after the page or the server begins anew."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed, find_parameter
from softreach.studio import Start, Studio, StudioState
from softreach.studio.captions import size_text
from softreach.studio.start import KeptWork
from tests.studio.conftest import SMALL
from tests.studio.tab import Tab

TRUNK = designs.minimal_trunk()


def start():
    return Start(state=StudioState(design=TRUNK).showing(level=12), quality=SMALL)


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "work"


def taper(tab):
    design = tab.session.state.design
    return find_parameter(design, "taper").value(design)


def shown_taper(tab):
    return float(tab.slider("taper φ [deg]").get_attribute("aria-valuenow"))


def become(tab, condition, what):
    tab.wait(condition, what)
    tab.settle()


def test_a_change_is_undone_and_done_again_by_buttons_and_keys(tab):
    tab.open("Design")
    first = tab.session.state.design
    tab.type("taper φ [deg]", "1")
    second = tab.session.state.design
    tab.press("Undo")
    become(tab, lambda: tab.session.state.design == first, "the design is back")
    tab.wait(lambda: abs(shown_taper(tab) - np.degrees(taper(tab))) < 0.03, "the slider is back")
    tab.press("Redo")
    become(tab, lambda: tab.session.state.design == second, "the change is there again")
    tab.page.locator("canvas").first.focus()
    tab.page.keyboard.press("Control+z")
    become(tab, lambda: tab.session.state.design == first, "the key undoes")
    tab.page.keyboard.press("Control+Shift+z")
    become(tab, lambda: tab.session.state.design == second, "the key does it again")
    assert tab.session.found.reach.arm == second


def reloaded(tab, studio):
    """The session of a page after it was loaded again."""
    known = set(studio.sessions)
    tab.page.reload()
    tab.page.get_by_text("volume 0").first.wait_for()  # a page may connect twice
    tab.wait(lambda: set(studio.sessions) - known, "the page connects again")
    session = studio.sessions[max(studio.sessions)]
    assert session.settle()
    return session


@pytest.mark.large
def test_a_page_that_is_reloaded_goes_on_where_it_was(browser, folder):
    with Studio(start(), work=KeptWork(folder)) as studio:
        tab = Tab(browser, studio)
        tab.session.update(lambda s: s.replace(design=changed(TRUNK, {"taper": 0.02})))
        tab.settle()
        tab.session = reloaded(tab, studio)
        assert taper(tab) == 0.02
        tab.page.get_by_text(
            size_text(tab.session.found.reach.size, tab.session.found.reach.arm)
        ).wait_for()
        tab.close()
