"""Any arm is made in the page: parts are added, removed and renamed, their numbers typed."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs


@pytest.fixture(scope="module")
def parts_tab(tab):
    tab.open("Parts")
    return tab


def design(tab):
    return tab.session.state.design


def become(tab, condition, what):
    tab.wait(lambda: condition(design(tab)), what)
    tab.settle()


def field_of(tab, label):
    return tab.page.locator(f"xpath=//label[normalize-space()='{label}']/following::input[1]")


def typed(tab, label, text):
    field = field_of(tab, label)
    field.scroll_into_view_if_needed()
    field.fill(text)
    field.press("Enter")


def test_a_tendon_asks_for_a_modulus_by_name(parts_tab):
    before = design(parts_tab)
    parts_tab.choose("kind", "tendon")
    parts_tab.press("Add")
    parts_tab.page.get_by_role("alert").filter(has_text="young_modulus").wait_for()
    assert design(parts_tab) == before


def test_a_named_design_is_taken_and_its_bundles_are_drawn(parts_tab):
    parts_tab.choose("named design", "three_chamber_arm")
    parts_tab.press("Take this design")
    become(parts_tab, lambda arm: arm == designs.three_chamber_arm(), "the design is taken")
    assert parts_tab.session.reach.arm == designs.three_chamber_arm()


def test_an_actuator_is_added_renamed_changed_and_removed(parts_tab):
    start = design(parts_tab)
    parts_tab.choose("kind", "fiber")
    parts_tab.press("Add")
    become(parts_tab, lambda arm: len(arm.actuators) == len(start.actuators) + 1, "one more")
    typed(parts_tab, "name", "<b>rib</b>")
    old = field_of(parts_tab, "σ [deg]").element_handle()
    parts_tab.press("Rename")
    become(parts_tab, lambda arm: arm.actuators[-1].name == "<b>rib</b>", "it is renamed")
    old.wait_for_element_state("hidden")  # its fields are made anew
    assert parts_tab.page.locator("b", has_text="rib").count() == 0  # a name is no markup
    typed(parts_tab, "σ [deg]", "25")
    become(
        parts_tab,
        lambda arm: np.isclose(arm.actuators[-1].extent, np.radians(25)),
        "its extent is what was typed",
    )
    parts_tab.press("Remove")
    become(parts_tab, lambda arm: arm == start, "it is removed")


def test_a_ring_is_added_and_takes_a_material(parts_tab):
    parts_tab.choose("kind", "ring")
    parts_tab.press("Add")
    become(parts_tab, lambda arm: len(arm.section.rings) == 2, "one more ring")
    parts_tab.choose("material", "dragon_skin_30")
    become(
        parts_tab,
        lambda arm: arm.section.rings[1].material.name == "dragon_skin_30",
        "its material is another",
    )
    assert parts_tab.errors == []
