"""Parameters as a person reads them: sliders of a design, numbers of its parts."""

from __future__ import annotations

import math
import re
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given

from softreach.arm import designs, edits
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.number import number
from softreach.arm.parameters import changed, find_parameter, parameters
from softreach.studio.fields import Attribute, Fields, attribute
from softreach.studio.found import Found
from softreach.studio.shown_parameters import (
    named_parameters,
    part_parameters,
    parts,
    refusal,
    slider_ends,
    slider_parameters,
)
from softreach.studio.state import Slice, StudioState
from softreach.studio.widgets import Line, number_kind, number_of, unit_in, vector_kind
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.cable import Cable
from tests.laws import arm_of, arms


@given(arms())
def test_every_slider_starts_within_its_ends_at_the_value_of_the_design(arm):
    for control in slider_parameters(arm):
        low, high = control.limits
        assert low <= control.shown <= high
        value = find_parameter(arm, control.name).value(arm)
        assert control.shown * control.scale == pytest.approx(value, abs=1e-6 * control.scale)


@pytest.mark.parametrize("design", designs.__all__)
def test_a_moved_slider_shows_its_own_value_in_the_new_design(design):
    arm = getattr(designs, design)()
    for control in slider_parameters(arm):
        to = 0.95 * control.shown + 0.05 * control.limits[0]
        to = 2 if control.name.endswith(".bundles") else to
        made = changed(arm, {control.name: to * control.scale})
        again = next((c for c in slider_parameters(made) if c.name == control.name), None)
        assert again is not None
        assert again.shown == pytest.approx(to, abs=1e-6)


@given(arms())
def test_a_slider_that_is_not_moved_leaves_the_design_as_it_is(arm):
    for control in slider_parameters(arm):
        made = changed(arm, {control.name: control.shown * control.scale})
        for name, one in parameters(arm).items():
            assert one.values(made) == pytest.approx(
                one.values(arm), rel=1e-9, abs=1e-9, nan_ok=True
            ), name


def test_fields_of_an_actuator_of_ones_own_are_on_sliders_within_their_ranges():
    @dataclass(frozen=True, kw_only=True)
    class Slid(Cable):
        gain: float = 4.0
        turns: int = 3
        angle: float = number("α", "rad", "an angle", default=0.0)
        share: float = number("s", "", "a share", above=0.0, high=1.0, default=0.8)
        width: float = number("w", "m", "a width", low=0.0, default=0.02)
        unknown: float = 0.0

    arm = arm_of(Slid(place=(0.02, -0.01)), activation_bounds=None, length=0.5)
    name = arm.actuators[0].name
    sliders = {one.name.removeprefix(f"{name}."): one for one in slider_parameters(arm)}
    found = {field: one[4:7] for field, one in sliders.items()}
    assert found["gain"] == pytest.approx((4.0, 0.0, 8.0))
    assert found["turns"] == pytest.approx((3, 0, 6))
    assert sliders["turns"].step == 1
    assert found["angle"] == pytest.approx((0.0, -360.0, 360.0))
    assert found["share"] == pytest.approx((0.8, 0.008, 1.0))
    assert found["width"] == pytest.approx((20.0, 0.0, 40.0))  # mm
    assert found["place[1]"] == pytest.approx((-0.01, -0.02, 0.0))
    assert "unknown" not in found
    assert sliders["width"].label == f"w of {name} [mm]"
    typed = part_parameters(arm, parts(arm)[name])
    assert f"{name}.unknown" in {one.name for one in typed}


@pytest.mark.parametrize("design", designs.__all__)
def test_sliders_end_where_the_design_ends_and_not_before(design):
    arm = getattr(designs, design)()
    ends = slider_ends(arm)
    for control in slider_parameters(arm):
        for end, limit in zip(ends[control.name], control.limits, strict=True):
            made = changed(arm, {control.name: end * control.scale})
            assert find_parameter(made, control.name).value(made) == pytest.approx(
                end * control.scale, abs=1e-9
            )
            if end != limit:
                beyond = end + 0.011 * np.copysign(end, limit - end)
                with pytest.raises(InvalidDesign):
                    changed(arm, {control.name: beyond * control.scale})


def test_ends_are_those_of_the_design_when_they_are_looked_for_near_others(trunk):
    ends = slider_ends(trunk)
    for taper in (0.02, 0.036, 0.05):
        arm = changed(trunk, {"taper": taper})
        ends = slider_ends(arm, ends)
        assert ends == slider_ends(arm)


def test_refusals_use_the_words_of_the_panel(trunk):
    """No name of a file, and no symbol that the page does not show."""
    shown = slider_parameters(trunk)
    for change in (
        lambda: changed(trunk, {"taper": 0.1}),
        lambda: edits.with_actuator(trunk, "tendon"),
    ):
        with pytest.raises(InvalidDesign) as refused:
            change()
        said = refusal(refused.value, shown, trunk)
        assert not re.search(r"R2|_|rings\[", said)
    assert said.startswith("E [kPa] of ring 0: must be given")


def test_what_differs_between_fibers_is_on_sliders_and_in_fields_of_each():
    fibers = [
        FiberArchitecture(name=name, revolution=turn, extent=extent)
        for name, turn, extent in (("a", -0.5, 0.3), ("b", 0.4, 0.2))
    ]
    same, differing = arm_of(fibers[0]), arm_of(*fibers)
    shared = {"revolution", "extent"}
    assert shared <= {one.name for one in slider_parameters(same)}
    own = {f"{name}.{field}" for name in "ab" for field in shared}
    found = {one.name: one.shown * one.scale for one in slider_parameters(differing)}
    assert own <= found.keys()
    assert not shared & found.keys()
    assert found["a.revolution"] == pytest.approx(-0.5)
    body, *_ = parts(differing).values()
    assert not shared & {one.name for one in part_parameters(differing, body)}


def test_sliders_of_fibers_bear_their_names_whatever_these_are():
    fibers = [
        FiberArchitecture(name=name, revolution=turn, extent=0.3)
        for name, turn in (("a b", 0.0), ("a_b", 0.5))
    ]
    labels = [control.label for control in slider_parameters(arm_of(*fibers))]
    wanted = ["bundles of a b", "offset of a b [deg]", "offset of a_b [deg]"]
    assert [label for label in labels if " of " in label] == wanted


def test_what_does_not_turn_has_no_revolution_to_change(trunk):
    assert "revolution" in [control.name for control in slider_parameters(trunk)]
    straight = trunk.replace(actuators=trunk.actuators[2:])
    assert "revolution" not in [control.name for control in slider_parameters(straight)]


def test_forces_and_moduli_have_sliders_of_their_size():
    found = {control.name: control for control in slider_parameters(designs.three_tendon_robot())}
    modulus = found["rings[0].material.young_modulus"]
    assert modulus.low > 0
    assert modulus.limits[1] == 2 * modulus.shown
    assert modulus.label == "modulus of backbone [kPa]"
    assert "[N]" in next(one.label for name, one in found.items() if name.endswith("upper"))


def test_what_a_design_leaves_open_has_no_slider(trunk):
    assert not [control for control in slider_parameters(trunk) if "modulus" in control.name]


def test_sliders_of_a_design_are_made_once(trunk):
    assert slider_parameters(trunk) is slider_parameters(
        changed(trunk, {"taper": find_parameter(trunk, "taper").value(trunk)})
    )


@pytest.mark.parametrize("design", designs.__all__)
def test_a_parameter_is_shown_in_one_part_and_is_its_value_in_the_unit_that_is_shown(design):
    arm = getattr(designs, design)()
    typed = [one for part in parts(arm).values() for one in part_parameters(arm, part)]
    assert len({one.name for one in typed}) == len(typed)
    for one in [*typed, *named_parameters(arm), *slider_parameters(arm)]:
        value = find_parameter(arm, one.name).value(arm)
        assert one.shown * one.scale == pytest.approx(value, rel=1e-11, nan_ok=True)


# Fields show values of the state and change them; a stand-in for the page takes their widgets


class Widget(SimpleNamespace):
    """Widget of a page: it has a value, and tells who listens that it was moved."""

    def __init__(self, **properties: Any) -> None:
        super().__init__(**properties)
        self.listeners: list[Callable[[Any], object]] = []
        self.removed = False
        self.on_update = self.on_click = self.on_submit = self.listeners.append

    def moved(self, value: Any = None, client: int | None = 1) -> None:
        if value is not None:
            self.value = value
        for listener in self.listeners:
            listener(SimpleNamespace(client_id=client))

    def remove(self) -> None:
        self.removed = True


class Form(Widget, AbstractContextManager):
    """Form, in whose context its fields are made."""

    def __exit__(self, *_: object) -> None:
        pass


class Gui:
    """Page that keeps its widgets in order."""

    def __init__(self) -> None:
        self.widgets: list[Widget] = []

    def __getattr__(self, adds: str) -> Callable[..., Widget]:
        def add(label, *given, **options) -> Widget:
            value = options.pop("initial_value", given[-1] if given else None)
            kind = Form if adds == "add_form" else Widget
            widget = kind(label=label, content=label, value=value, **options)
            widget.options = given[0] if adds == "add_dropdown" else ()
            self.widgets.append(widget)
            return widget

        return add


class Tab:
    """Session without a server."""

    def __init__(self) -> None:
        self.state = StudioState(design=designs.minimal_trunk())
        self.found = Found()
        self.client: Any = SimpleNamespace(gui=Gui())
        self.lock = threading.RLock()
        self.revision, self.updates = 0, 0
        self.failures: list[Exception] = []

    def update(self, change, *, by_widget=False, goes_on=False):
        before, self.state = self.state, change(self.state)
        self.updates += self.state != before
        self.revision += not by_widget

    def fail(self, error):
        self.failures.append(error)

    @property
    def widgets(self) -> list[Any]:
        return self.client.gui.widgets


@pytest.fixture
def page() -> Any:
    return Tab()


CENTER = attribute("appearance.slice.center")


def field(page, *, at=CENTER):
    """Fields with one slider: its parts, in the order in which a panel shows them."""
    fields = Fields(page)
    bound = fields.slider("center / L", (-1.5, 1.5), 0.01, at, "hint")
    slider, form, text, line = page.widgets
    return fields, bound, slider, form, text, line


def typed(text, form, value):
    text.moved(value)
    form.moved()


def test_an_attribute_reads_and_writes_its_own_value_alone():
    state = StudioState(design=designs.minimal_trunk()).showing(slice=Slice(axis="x"))
    written = CENTER.write(state, 0.25)
    assert CENTER.read(written) == 0.25
    assert written == state.showing(slice=Slice(axis="x", center=0.25))


def test_a_field_writes_what_a_person_changes_and_nothing_else(page):
    box = Fields(page).checkbox("cloud", attribute("appearance.cloud"), "hint")
    box.moved(True, client=None)  # as the program sets it
    assert not page.state.appearance.cloud
    box.moved(True)
    assert page.state.appearance.cloud
    box.moved(True)
    assert page.updates == 1  # a page reports again what was only drawn anew


def test_a_field_shows_what_others_change_but_is_not_set_back_while_it_is_dragged(page):
    fields, bound, slider, *_ = field(page)
    slider.moved(0.5)
    slider.value = 0.7  # the hand is ahead of its events
    fields.show()
    assert (page.state.appearance.slice.center, slider.value) == (0.5, 0.7)
    page.update(lambda state: CENTER.write(state, -0.2))
    fields.show()
    assert (bound.value, slider.value) == (-0.2, -0.2)


def test_a_slider_and_its_text_show_one_number_also_beyond_the_ends(page):
    _, bound, slider, form, text, _ = field(page)
    typed(text, form, "2.25")
    assert (bound.value, slider.value, page.state.appearance.slice.center) == (2.25, 1.5, 2.25)
    slider.moved(0.5)
    assert (text.value, page.state.appearance.slice.center) == ("0.5", 0.5)


def test_nothing_is_applied_before_enter(page):
    *_, form, text, line = field(page)
    text.moved("0.25")
    assert (page.updates, "Enter" in line.content) == (0, True)
    form.moved()
    assert (page.state.appearance.slice.center, line.content) == (0.25, "")


def test_a_refused_value_stays_in_its_field_beside_the_reason(page):
    fields, _, _, form, text, line = field(page)
    other = fields.typed("thickness", attribute("appearance.slice.thickness"), "hint")
    *_, other_form, other_text, other_line = page.widgets
    typed(text, form, "5000")
    assert (page.updates, text.value) == (0, "5000")
    assert "slice.center = 5000" in line.content
    typed(other_text, other_form, "-1")
    assert "slice.thickness = -1" in other_line.content
    assert line.content == ""
    typed(other_text, other_form, "0.5")
    assert (other.value, other_line.content, page.updates) == (0.5, "", 1)
    typed(text, form, "far")
    assert "must be a number" in line.content
    assert page.failures == []


def test_a_refusal_of_a_widget_without_a_line_is_said_in_that_of_the_panel(page):
    def refuse(state, value):
        raise InvalidInput("box", value, "empty")

    at = Attribute(lambda _: False, refuse)
    Fields(page).checkbox("alone", at, "hint").moved(True)
    assert "box = True" in str(page.failures[0])
    fields = Fields(page)
    fields.message = Line(page.client.gui)
    fields.checkbox("with a line", at, "hint").moved(True)
    *_, line, _ = page.widgets
    assert "box = True" in line.content
    assert len(page.failures) == 1


def test_a_button_gives_up_what_was_refused(page):
    fields, bound, _, form, text, line = field(page)
    fields.change("Rest", lambda state: state, "hint")
    typed(text, form, "5000")
    page.widgets[-1].moved()
    assert (bound.value, text.value, line.content) == (0.0, "0", "")


def test_a_menu_offers_what_the_design_has(page):
    fields = Fields(page)
    menu = fields.dropdown(
        "parameter",
        lambda state: {one.name: one.label for one in slider_parameters(state.design)},
        Attribute(lambda state: "taper", lambda state, name: state.showing(color=name)),
        "hint",
    )
    assert menu.value == "taper φ [deg]"
    menu.moved("extent σ [deg]")
    assert page.state.appearance.color == "extent"
    straight = page.state.design.replace(actuators=page.state.design.actuators[2:])
    page.update(lambda state: state.replace(design=straight), by_widget=True)
    fields.show()
    assert "revolution Ω [deg]" not in menu.options
    menu.moved("revolution Ω [deg]")  # an event from before
    assert page.state.appearance.color == "extent"


def test_fields_follow_a_design_that_others_change(page):
    fields = Fields(page)
    at = Attribute(lambda state: state.design.length, lambda state, value: state)
    bound = fields.typed("L [m]", at, "hint")
    longer = changed(page.state.design, {"length": 1.2})
    page.update(lambda state: state.replace(design=longer), by_widget=True)
    fields.show()
    assert bound.value == 1.2


def test_fields_that_are_removed_leave_nothing(page):
    fields = field(page)[0]
    fields.change("Rest", lambda state: state, "hint")
    fields.remove()
    assert all(widget.removed for widget in page.widgets)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("-0.5", -0.5), ("\N{MINUS SIGN}0.5", -0.5), (" 1e-5 ", 1e-5), ("0,25", 0.25),
        ("", None), ("nan", None), ("inf", None), ("1 2", None), ("1,000.5", None),
    ],
)  # fmt: skip
def test_a_number_is_what_a_person_types(text, value):
    assert number_of(text) == value


def test_a_number_with_a_unit_is_applied_and_shown_in_that_of_the_field(page):
    _, bound, _, form, text, line = field(page)
    page.state = page.state.replace(design=changed(page.state.design, {"length": 0.2}))
    typed(text, form, "5 cm")
    assert (bound.value, text.value, line.content) == (0.25, "0.25", "")
    for wrong in ("5 deg", "1/2", "cm"):
        typed(text, form, wrong)
        assert (bound.value, text.value, page.updates) == (0.25, wrong, 1)
        demand = "must be a number, without a unit or in L, m, cm"
        assert f"&#x27;{wrong}&#x27;: {demand}" in line.content


@pytest.mark.parametrize(
    ("text", "label", "value"),
    [
        ("100g", "payload [g]", 100.0), ("0.1 kg", "payload [g]", 100.0), ("5", "L [mm]", 5.0),
        ("0.5 rad", "taper φ [deg]", pytest.approx(math.degrees(0.5), rel=1e-14)),
        ("5 cm", "L [mm]", 50.0), ("0.1 L", "L [mm]", 40.0), ("2 deg", "taper φ [deg]", 2.0),
        ("0.5", "ratio", 0.5), ("5 %", "ratio", None), ("1 kg", "L [mm]", None),
        ("m", "L [mm]", None), ("nan m", "L [mm]", None),
    ],
)  # fmt: skip
def test_units_that_measure_the_same_may_be_typed(text, label, value):
    assert number_kind(unit_in(label), lambda: 0.4).value(text) == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("0, 0, -9.81", (0.0, 0.0, -9.81)), ("1 2 3", (1.0, 2.0, 3.0)), ("1; 2; 3", (1, 2, 3)),
        ("80 mm, 5cm, -0.24 L", (0.08, 0.05, -0.12)), ("1, 2", None), ("1, 2, 3, 4", None),
        ("1, 2, x", None), ("1, 2, inf", None), ("1, 2, 3 kg", None),
    ],
)  # fmt: skip
def test_a_vector_is_three_numbers_with_their_units(text, value):
    assert vector_kind("m", lambda: 0.5).value(text) == value
