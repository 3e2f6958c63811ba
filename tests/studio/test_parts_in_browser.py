"""Any arm is made in the page: parts are added, removed and renamed, their numbers typed."""

from __future__ import annotations

import numpy as np

from softreach.arm import designs


def design(tab):
    return tab.session.state.design


def become(tab, condition, what):
    tab.wait(lambda: condition(design(tab)), what)
    tab.settle()


def field_of(tab, label):
    return tab.page.locator(
        f"xpath=//label[normalize-space()='{label}']/following::input[1] >> visible=true"
    )


def typed(tab, label, text):
    field = field_of(tab, label)
    field.scroll_into_view_if_needed()
    field.fill(text)
    field.press("Enter")


def test_parts_are_taken_added_renamed_changed_and_removed(tab):
    tab.open("Parts")
    before = design(tab)
    tab.unfold("add a part")
    tab.choose("kind", "tendon")
    tab.press("Add")
    tab.page.get_by_role("alert").filter(has_text="choose what it is made of").wait_for()
    assert design(tab) == before
    tab.choose("made of", "dragon_skin_30")
    tab.press("Add")
    become(tab, lambda arm: arm.actuators[-1].name == "tendon 1", "a tendon is added")
    assert {ring.material.name for ring in design(tab).section.rings} == {"dragon_skin_30"}
    assert design(tab).actuators[:-1] == before.actuators

    tab.open("Design")
    tab.choose("start from", "three_chamber_arm")
    become(tab, lambda arm: arm == designs.three_chamber_arm(), "the design is taken")
    assert tab.session.reach.arm == designs.three_chamber_arm()

    start = design(tab)
    tab.open("Parts")
    tab.choose("kind", "fiber")
    tab.press("Add")
    become(tab, lambda arm: len(arm.actuators) == len(start.actuators) + 1, "one more")
    old = field_of(tab, "σ [deg]").element_handle()
    typed(tab, "name", "<b>rib</b>")
    become(tab, lambda arm: arm.actuators[-1].name == "<b>rib</b>", "it is renamed")
    old.wait_for_element_state("hidden")  # its fields are made anew
    assert tab.page.locator("b", has_text="rib").count() == 0  # a name is no markup
    typed(tab, "σ [deg]", "25")
    become(
        tab,
        lambda arm: np.isclose(arm.actuators[-1].extent, np.radians(25)),
        "its extent is what was typed",
    )
    tab.press("Remove")
    become(tab, lambda arm: arm == start, "it is removed")

    tab.choose("kind", "ring")
    tab.press("Add")
    become(tab, lambda arm: len(arm.section.rings) == 2, "one more ring")
    tab.choose("material", "dragon_skin_30")
    become(
        tab,
        lambda arm: arm.section.rings[1].material.name == "dragon_skin_30",
        "its material is another",
    )
