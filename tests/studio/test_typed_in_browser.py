"""Numbers are kept as they are typed, and a refused one says why under its field."""

from __future__ import annotations

import numpy as np
import pytest

from softreach import tip_positions
from softreach.arm import designs


def test_every_control_has_a_tooltip_with_its_meaning(tab):
    gui = tab.session.client.gui
    inputs = [h for h in gui._gui_input_handle_from_uuid.values() if hasattr(h, "hint")]
    lacking = [getattr(h, "label", "") for h in inputs if not h.hint]
    assert len(inputs) > 40
    assert not lacking
    tab.open("Design")
    thumb = tab.slider("extent σ [deg]")
    tab.center(thumb)
    thumb.hover()
    meaning = tab.page.get_by_text("the angle of the cross-section")
    meaning.wait_for()
    box, panel = meaning.bounding_box(), tab.page.locator("[data-softreach]").bounding_box()
    assert box["x"] + box["width"] < panel["x"]  # it covers no row
    assert "hull" in tab.page.get_by_text("UNR").first.get_attribute("title")


@pytest.mark.large
def test_an_arm_is_read_and_aimed_in_the_unit_of_its_design(tab):
    arm = designs.lce_arm().replace(display_unit="mm")
    tab.session.update(lambda state: state.replace(design=arm))
    tab.settle()
    volume = tab.session.found.reach.exact.volume * 1e6
    tab.page.get_by_text(f"volume {volume:.0f}").first.wait_for()
    assert " mL" in tab.page.get_by_text(f"volume {volume:.0f}").first.inner_text()
    tab.open("Move")
    place = tab.field("target [mm]")
    aim = np.round(1e3 * tip_positions(arm, [arm.bounds @ (0.4, 0.6)])[0], 2)
    place.fill(", ".join(map(str, aim)))
    place.press("Enter")
    tab.wait(lambda: tab.session.found.answer is not None, "it is solved")
    tab.settle()
    np.testing.assert_allclose(tab.session.state.target, 1e-3 * aim, atol=1e-12)
    there = "({:.3f}, {:.3f}, {:.3f}) mm".format(*(aim + 0.0))
    tab.page.get_by_text(f"1 activation reaches {there} to").wait_for()
    at = "({:.5f}, {:.5f}, {:.5f}) mm".format(*(1e3 * arm.length * tab.session.found.tip))
    tab.page.get_by_text(f"tip at {at}, pointing along (").wait_for()
    axes = [tab.drawn(f"/axes/label {k}") for k in range(60)]
    assert {label.text for label in axes if label is not None} >= {"x [mm]", "z [mm]"}
