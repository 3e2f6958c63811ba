"""Parameters as a person reads them: sliders of a design, numbers of its parts."""

import math
import re
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given

from softreach.arm import designs, edits
from softreach.arm.actuators import FiberArchitecture
from softreach.arm.number import number
from softreach.arm.parameters import changed, find_parameter, parameters
from softreach.rod.kinematics import tip_positions
from softreach.studio import shown_parameters as shown
from softreach.studio.fields import attribute
from softreach.studio.shown_parameters import part_parameters, parts, slider_ends, slider_parameters
from softreach.studio.state import Slice, StudioState
from softreach.studio.widgets import number_kind, unit_in, vector_kind
from softreach.support.errors import InvalidDesign
from tests.cable import Cable
from tests.laws import arm_of, arms


@given(arms())
def test_sliders_start_within_their_ends_at_the_value_of_the_design_and_leave_it_unmoved(arm):
    for control in slider_parameters(arm):
        low, high = control.limits
        assert low <= control.shown <= high
        value = find_parameter(arm, control.name).value(arm)
        assert control.shown * control.scale == pytest.approx(value, abs=1e-6 * control.scale)
        made = changed(arm, {control.name: control.shown * control.scale})
        for name, one in parameters(arm).items():
            before = pytest.approx(one.values(arm), rel=1e-9, abs=1e-9, nan_ok=True)
            assert one.values(made) == before, name


@pytest.fixture(params=designs.__all__)
def named(request):
    return getattr(designs, request.param)()


def bent_tip(arm):
    """Where the tip is with every bundle at another share of its range."""
    low, high = arm.input_bounds.T
    return tip_positions(arm, [low + (high - low) * np.linspace(0.8, 0.3, len(low))])[0]


def test_a_moved_slider_shows_its_own_value_in_the_new_design_and_moves_its_tip(named):
    before = bent_tip(named)
    for control in slider_parameters(named):
        to = 0.95 * control.shown + 0.05 * control.limits[control.shown == control.limits[0]]
        to = 2 if control.name.endswith(".bundles") else to
        made = changed(named, {control.name: to * control.scale})
        again = {one.name: one.shown for one in slider_parameters(made)}
        assert again[control.name] == pytest.approx(to, abs=1e-6)
        assert np.linalg.norm(bent_tip(made) - before) > 1e-5 * named.length, control.name


def test_sliders_end_at_numbers_that_a_person_would_type(named):
    typed = changed(named, {"taper": find_parameter(named, "taper").value(named) - 0.0123456789})
    for arm in (named, typed, named.replace(display_unit="in")):
        ends = slider_ends(arm, {}, lambda: None)
        for control in slider_parameters(arm):
            for end in (*control.limits, *ends[control.name]):
                assert f"{end:.12g}" == f"{float(f'{end:.3g}'):.12g}"


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


def test_sliders_end_where_the_design_ends_and_not_before(named):
    ends = slider_ends(named, {}, lambda: None)
    for control in slider_parameters(named):
        for end, limit in zip(ends[control.name], control.limits, strict=True):
            made = changed(named, {control.name: end * control.scale})
            value = find_parameter(made, control.name).value(made)
            assert value == pytest.approx(end * control.scale, abs=1e-9)
            if end != limit:
                beyond = end + 0.011 * np.copysign(end, limit - end)
                with pytest.raises(InvalidDesign):
                    changed(named, {control.name: beyond * control.scale})


def test_ends_are_those_of_the_design_when_they_are_looked_for_near_others(trunk):
    ends = slider_ends(trunk, {}, lambda: None)
    for taper in (0.02, 0.036, 0.05):
        arm = changed(trunk, {"taper": taper})
        ends = slider_ends(arm, ends, lambda: None)
        assert ends == slider_ends(arm, {}, lambda: None)


def test_refusals_use_the_words_of_the_panel(trunk):
    """No name of a file, and no symbol that the page does not show."""
    sliders = slider_parameters(trunk)
    for change, value in ((changed, {"taper": 0.1}), (edits.with_actuator, "tendon")):
        with pytest.raises(InvalidDesign) as refused:
            change(trunk, value)
        said = shown.refusal(refused.value, sliders, trunk)
        assert not re.search(r"R2|_|rings\[", said)
    assert said.startswith("modulus [kPa] of ring 0: must be given")


def fiber(name, turn, extent=0.3):
    return FiberArchitecture(name=name, revolution=turn, extent=extent)


def test_what_differs_between_fibers_is_on_sliders_and_in_fields_of_each():
    one = fiber("a", -0.5)
    same, differing = arm_of(one), arm_of(one, fiber("b", 0.4, 0.2))
    shared = {"revolution", "extent"}
    assert shared <= {one.name for one in slider_parameters(same)}
    own = {f"{name}.{field}" for name in "ab" for field in shared}
    found = {one.name: one.shown * one.scale for one in slider_parameters(differing)}
    assert own <= found.keys()
    assert not shared & found.keys()
    assert found["a.revolution"] == pytest.approx(-0.5)
    assert not shared & {one.name for one in shown.body_numbers(differing)}


def test_sliders_of_fibers_bear_their_names_whatever_these_are():
    arm = arm_of(fiber("a b", 0.0), fiber("a_b", 0.5))
    labels = [control.label for control in slider_parameters(arm)]
    wanted = ["bundles of a b", "offset of a b [deg]", "offset of a_b [deg]"]
    assert [label for label in labels if " of " in label] == wanted


def test_forces_and_moduli_have_sliders_of_their_size():
    found = {control.name: control for control in slider_parameters(designs.three_tendon_robot())}
    modulus = found["rings[0].material.young_modulus"]
    assert modulus.low > 0
    assert modulus.limits[1] == 2 * modulus.shown
    assert modulus.label == "modulus of backbone [kPa]"
    assert "[N]" in next(one.label for name, one in found.items() if name.endswith("upper"))


def test_sliders_of_a_design_are_made_once_and_none_of_what_it_leaves_open(trunk):
    same = changed(trunk, {"taper": find_parameter(trunk, "taper").value(trunk)})
    assert slider_parameters(trunk) is slider_parameters(same)
    straight = trunk.replace(actuators=trunk.actuators[2:])
    names, left = ({one.name for one in slider_parameters(arm)} for arm in (trunk, straight))
    assert "revolution" in names - left  # what does not turn has none
    assert not [name for name in names if "modulus" in name]


def test_a_parameter_is_shown_in_one_part_and_is_its_value_in_the_unit_that_is_shown(named):
    typed = [one for part in parts(named).values() for one in part_parameters(named, part)]
    typed += shown.body_numbers(named)
    assert len({one.name for one in typed}) == len(typed)
    for one in [*typed, *shown.named_parameters(named), *slider_parameters(named)]:
        value = find_parameter(named, one.name).value(named)
        assert one.shown * one.scale == pytest.approx(value, rel=1e-11, nan_ok=True)


# Values of the state that fields show, and texts that are typed into them


def test_an_attribute_reads_and_writes_its_own_value_alone():
    state = StudioState(design=designs.minimal_trunk()).showing(slice=Slice(axis="x"))
    center = attribute("appearance.slice.center")
    written = center.write(state, 0.25)
    assert center.read(written) == 0.25
    assert written == state.showing(slice=Slice(axis="x", center=0.25))


@pytest.mark.parametrize(
    ("text", "label", "value"),
    [
        ("100g", "payload [g]", 100.0), ("0.1 kg", "payload [g]", 100.0), ("5", "L [mm]", 5.0),
        ("0.5 rad", "taper φ [deg]", pytest.approx(math.degrees(0.5), rel=1e-14)),
        ("5 cm", "L [mm]", 50.0), ("0.1 L", "L [mm]", 40.0), ("2 deg", "taper φ [deg]", 2.0),
        ("-0.5", "ratio", -0.5), ("5 %", "ratio", None), ("1 kg", "L [mm]", None),
        ("m", "L [mm]", None), ("nan m", "L [mm]", None), ("\N{MINUS SIGN}0.5", "ratio", -0.5),
        (" 1e-5 ", "ratio", 1e-5), ("0,25", "ratio", 0.25), ("", "ratio", None),
        ("nan", "ratio", None), ("1 2", "ratio", None), ("1,000.5", "ratio", None),
    ],
)  # fmt: skip
def test_a_number_is_what_a_person_types_in_any_unit_that_measures_the_same(text, label, value):
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
