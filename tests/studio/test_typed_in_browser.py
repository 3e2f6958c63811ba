"""Numbers are kept as they are typed, and a refused one says why under its field."""

from __future__ import annotations

import numpy as np
import pytest

from softreach import tip_positions
from softreach.arm import designs
from softreach.arm.parameters import find_parameter


def field(tab, label):
    """What is typed into, beside the slider of a label or behind the label."""
    row = f"xpath=//label[normalize-space()='{label}']"
    return tab.page.locator(f"{row}/following::form[1]//input[1]")


def typed(tab, label, text, enter=True):
    """Key by key, as a person types."""
    tab.settle()
    place = field(tab, label)
    place.scroll_into_view_if_needed()
    place.press("Control+a")
    place.press_sequentially(text, delay=15)
    if enter:
        place.press("Enter")
    return place


def value(tab, name):
    arm = tab.session.state.design
    return find_parameter(arm, name).value(arm)


@pytest.mark.large
def test_numbers_are_kept_to_the_last_digit(tab):
    for numbers in (
        [
            ("taper φ [deg]", "taper", "-0.00884", np.radians(-0.00884)),
            ("lowest γ", "lower", "-0.123456789", -0.123456789),
            ("revolution Ω [deg]", "revolution", "400", np.radians(400)),
        ],
        [("extent σ [deg]", "extent", "2.5e-1", np.radians(0.25))],
    ):
        places = []
        for label, name, text, wanted in numbers:
            places.append(typed(tab, label, text))
            tab.wait(lambda n=name, w=wanted: abs(value(tab, n) - w) < 1e-15, f"{label} is {text}")
        tab.settle()
        tab.page.wait_for_timeout(300)
        for place, (_, name, text, wanted) in zip(places, numbers, strict=True):
            assert place.input_value() == text
            assert value(tab, name) == pytest.approx(wanted, abs=1e-15)


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
