"""The sliders of a design."""

from __future__ import annotations

import pytest
from hypothesis import given

from softreach.arm import designs
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.parameters import changed, find_parameter
from softreach.studio.controls import controls
from tests.laws import arm_of, arms


@given(arms())
def test_every_slider_starts_within_its_ends_at_the_value_of_the_design(arm):
    for control in controls(arm):
        low, high = control.limits
        assert low <= control.shown <= high
        value = find_parameter(arm, control.name).value(arm)
        assert control.shown * control.scale == pytest.approx(value, abs=1e-6 * control.scale)


@pytest.mark.parametrize("arm", [designs.minimal_trunk(), designs.redundant_trunk()])
def test_a_moved_slider_shows_its_own_value_in_the_new_design(arm):
    for control in controls(arm):
        to = (control.shown + control.limits[0]) / 2 if control.name != "taper" else 1.0
        to = 2 if control.name.endswith(".bundles") else to
        made = changed(arm, {control.name: to * control.scale})
        again = next((c for c in controls(made) if c.name == control.name), None)
        assert again is not None
        assert again.shown == pytest.approx(to)


def test_sliders_of_fibers_bear_their_names_whatever_these_are():
    fibers = [
        FiberArchitecture(name=name, revolution=turn, extent=0.3)
        for name, turn in (("a.b", 0.0), ("a_b", 0.5))
    ]
    labels = [control.label for control in controls(arm_of(*fibers))]
    wanted = ["bundles of a.b", "offset of a.b [deg]", "offset of a_b [deg]"]
    assert [label for label in labels if " of " in label] == wanted


def test_what_does_not_turn_has_no_revolution_to_change(trunk):
    assert "revolution" in [control.name for control in controls(trunk)]
    straight = trunk.replace(actuators=trunk.actuators[2:])
    assert "revolution" not in [control.name for control in controls(straight)]
