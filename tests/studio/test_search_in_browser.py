"""End to end: two places, one of them missed, a slider that changes that, a search, its best."""

from __future__ import annotations

from softreach.studio.needs import requirements_of


def field(tab, label):
    return tab.page.locator(
        f"xpath=//label[normalize-space()='{label}']/following::input[1] >> visible=true"
    )


def test_needs_are_seen_met_and_missed_and_a_search_finds_a_design_that_meets_them(tab):
    session = tab.session
    tab.open("Goals")
    tab.press("Add to the needs")  # where the tip is
    tab.page.get_by_text("place 1: reached").wait_for()
    field(tab, "numbers").fill("0.37, 0.15, 0.85")
    tab.settle()
    tab.press("Add to the needs")
    tab.page.get_by_text("place 2: missed by 0.0082").wait_for()
    tab.wait(lambda: tab.drawn("/needs/missed"), "the place is a cross")
    assert len(tab.drawn("/needs/reached").points) == 1

    tab.open("Design")
    tab.page.get_by_text("needs: 1 of 2 met · place 2 missed by").wait_for()
    tab.drag("taper φ [deg]", -85)
    tab.wait(lambda: tab.drawn("/needs/missed") is None, "the cross is a ball")
    tab.page.get_by_text("needs: 2 of 2 met").wait_for()
    tab.settle()
    assert len(tab.drawn("/needs/reached").points) == 2
    tab.open("Goals")
    tab.page.get_by_text("place 2: reached").wait_for()
    tab.press("Undo")
    tab.page.get_by_text("place 2: missed by").wait_for()
    before = session.state.design

    tab.choose("free also", "taper")
    tab.wait(lambda: field(tab, "free").input_value() == "taper = -2:5", "it has its range")
    field(tab, "designs").fill("12")
    tab.settle()
    tab.press("Search")
    tab.page.get_by_text("computed to full accuracy").wait_for()
    tab.wait(lambda: tab.drawn("/search"), "the picture is in the scene")
    tab.press("Load the best")
    tab.wait(lambda: session.state.design != before, "the best is the design")
    tab.page.get_by_text("place 2: reached").wait_for()
    tab.settle()
    assert session.state.design == session.search.result.arm
    assert len(requirements_of(session.state.needs).places) == 2
    tab.press("Remove the search")
    tab.wait(lambda: tab.drawn("/search") is None, "the picture is gone")
