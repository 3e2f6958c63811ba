"""End to end: two places, one of them missed, and a slider that changes that."""

from __future__ import annotations


def test_needs_are_seen_met_and_missed_and_follow_a_slider(tab):
    tab.open("Goals")
    tab.press("Add to the needs")  # where the tip is
    tab.page.get_by_text("place 1: reached").wait_for()
    tab.field("numbers").fill("0.37, 0.15, 0.85")
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
