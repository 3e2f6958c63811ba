"""Laws of design parameters: what an arm has of each, and what becomes of it when one changes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.arm import designs
from softreach.arm.actuators import Actuator, FiberArchitecture, Outline, Resultants
from softreach.arm.parameters import changed, find_parameter, parameters
from softreach.arm.variable import Variable
from softreach.errors import InvalidDesign, InvalidInput, Range
from softreach.rod.kinematics import tip_positions
from tests.laws import arm_of, arms, in_box

VALUES = {
    "bundles": 2,
    "length": 1.3,
    "outer_radius": 0.05,
    "lower": -0.8,
    "upper": -0.05,
    "taper": 0.01,
    "helical_angle": 0.01,
}
"""Of fields that 0.3 would make an impossible trunk of."""


def value_of(arm, name):
    return find_parameter(arm, name).value(arm)


@pytest.mark.parametrize("name", list(parameters(designs.minimal_trunk())))
def test_a_parameter_that_was_changed_has_its_new_value(trunk, name):
    parameter = find_parameter(trunk, name)
    value = VALUES.get(parameter.field, 0.3)
    made = changed(trunk, {name: value})
    assert parameter.value(made) == pytest.approx(value, rel=1e-12)
    assert made != trunk


@given(arms())
def test_the_values_that_an_arm_has_make_the_same_arm(arm):
    gamma = in_box(arm, 3)
    tips = tip_positions(arm, gamma)
    # Ω and α say the same, and `revolution` and `extent` would make fibers alike that are not.
    own = {
        name: one.value(arm)
        for name, one in parameters(arm).items()
        if one.field != "helical_angle" and (one.owner or name not in ("revolution", "extent"))
    }
    np.testing.assert_allclose(tip_positions(changed(arm, own), gamma), tips, atol=1e-9)


def test_no_values_change_nothing(trunk):
    assert changed(trunk, {}) is trunk


@given(st.lists(st.text(min_size=1, max_size=8), min_size=2, max_size=3, unique=True))
def test_every_actuator_has_parameters_of_its_own_whatever_it_is_called(names):
    fibers = [FiberArchitecture(name=name, revolution=0.5, extent=0.3) for name in names]
    arm = arm_of(*fibers)
    assert len([one for one in parameters(arm).values() if one.field == "offset"]) == len(names)
    made = changed(arm, {f"{name}.offset": k + 1 for k, name in enumerate(names)})
    assert [fiber.offset for fiber in made.fibers] == list(range(1, len(names) + 1))


@pytest.mark.parametrize(("first", "second"), [("a b", "a_b"), ("left", "left.offset"), ("ä", "a")])
def test_similar_names_do_not_move_each_other(first, second):
    fibers = [FiberArchitecture(name=name, revolution=0.5, extent=0.3) for name in (first, second)]
    made = changed(arm_of(*fibers), {f"{second}.offset": 2.0})
    assert [fiber.offset for fiber in made.fibers] == [0.0, 2.0]


def test_two_fibers_of_one_name_are_refused(trunk):
    twins = tuple(fiber.replace(name="twin") for fiber in trunk.fibers[:2])
    with pytest.raises(InvalidDesign, match=r"actuators\[1\]\.name = 'twin': must differ"):
        trunk.replace(actuators=twins)


def test_fibers_without_a_name_have_one_by_their_place():
    arm = arm_of(FiberArchitecture(revolution=0.5, extent=0.3))
    assert value_of(arm, "fiber 1.extent") == 0.3


def test_a_valid_design_behind_an_invalid_one_is_found():
    base = designs.minimal_trunk(taper=np.radians(3))
    with pytest.raises(InvalidDesign, match="leaves no tip"):
        changed(base, {"outer_radius": 0.01})
    assert value_of(changed(base, {"outer_radius": 0.01, "taper": 0.0}), "outer_radius") == 0.01


def test_all_faults_are_named_at_once_and_by_their_owner(trunk):
    with pytest.raises(InvalidDesign) as caught:
        changed(trunk, {"radius_ratio": 1.0, "left.extent": 7.0, "right.bundles": 1.5})
    paths = [fault.path for fault in caught.value.faults]
    assert paths == ["inner_ratio", "left.extent", "right.bundles"]


@pytest.mark.parametrize("name", ["revolution", "left.revolution"])
def test_revolutions_stay_when_the_taper_changes(name):
    angled = [
        FiberArchitecture(name="left", helical_angle=-0.1, extent=0.3),
        FiberArchitecture(name="right", helical_angle=0.1, extent=0.3),
    ]
    arm = arm_of(*angled)
    tapered = changed(arm, {"taper": 0.02})
    assert value_of(tapered, name) == pytest.approx(value_of(arm, name), rel=1e-12)
    assert value_of(tapered, "left.helical_angle") != value_of(arm, "left.helical_angle")


def test_a_new_outer_radius_keeps_the_ratio_and_the_helical_angles():
    arm = arm_of(FiberArchitecture(name="left", helical_angle=0.1, extent=0.3))
    wide = changed(arm, {"outer_radius": 0.1})
    assert value_of(wide, "radius_ratio") == value_of(arm, "radius_ratio")
    assert value_of(wide, "left.helical_angle") == 0.1


def test_helical_fibers_keep_their_sense_and_longitudinal_ones_stay(trunk):
    turned = changed(trunk, {"revolution": 0.7})
    turns = [value_of(turned, f"{name}.revolution") for name in ("left", "right", "longitudinal")]
    assert turns == [-0.7, 0.7, 0.0]


def test_an_arm_without_helical_fibers_does_not_turn(trunk):
    straight = trunk.replace(actuators=trunk.actuators[2:])
    assert value_of(straight, "revolution") == 0.0
    assert changed(straight, {"revolution": 1.0}) == straight


@pytest.mark.parametrize("order", [1, -1])
def test_an_actuators_own_value_wins_over_that_of_all(trunk, order):
    pairs = [("extent", 0.5), ("left.extent", 0.2), ("taper", 0.0), ("left.helical_angle", 0.05)]
    made = changed(trunk, dict(pairs[::order]))
    assert [fiber.extent for fiber in made.fibers] == [0.2, 0.5, 0.5]
    assert value_of(made, "left.helical_angle") == 0.05


def test_a_bound_changes_alone():
    pairs = ((-1.0, 0.1), (-0.5, 0.2))
    fiber = FiberArchitecture(revolution=0.0, extent=0.3, bundles=2, activation_bounds=pairs)
    arm = arm_of(fiber, activation_bounds=None)
    np.testing.assert_array_equal(changed(arm, {"lower": -0.8}).bounds, [[-0.8, 0.1], [-0.8, 0.2]])


def test_bounds_of_the_first_bundle_are_those_of_another_number_of_them():
    pairs = ((-1.0, 0.1), (-0.5, 0.2))
    fiber = FiberArchitecture(
        name="one", revolution=0.0, extent=0.3, bundles=2, activation_bounds=pairs
    )
    arm = arm_of(fiber, activation_bounds=None)
    made = changed(arm, {"one.bundles": 3, "one.upper": 0.0})
    np.testing.assert_array_equal(made.bounds, [[-1.0, 0.0]] * 3)


@pytest.mark.parametrize(
    ("name", "meant"),
    [("tapper", "taper"), ("offset_left", "left.offset"), ("lefd.offset", "left.offset")],
)
def test_an_unknown_parameter_costs_one_line_with_the_closest_one(trunk, name, meant):
    for ask in (lambda: changed(trunk, {name: 1.0}), lambda: find_parameter(trunk, name)):
        with pytest.raises(
            InvalidInput, match=f'parameter = {name}.*did you mean "{meant}"'
        ) as caught:
            ask()
        assert "\n" not in str(caught.value)


@dataclass(frozen=True, kw_only=True)
class Pull(Actuator):
    """A force along the axis: an actuator that nothing else knows of."""

    unit: ClassVar[str] = "N"
    variables: ClassVar[tuple[Variable, ...]] = (
        Variable("area", "A", "area that the force spreads over", Range(low=0.0, unit="m2")),
    )
    name: str = "pull"
    area: float = 1e-4
    activation_bounds: tuple[float, float] = (-1.0, 0.0)

    def resultants(self, profile, section, z):
        return Resultants(np.full((len(z), 1), self.area), np.zeros((len(z), 3, 1)))

    def outline(self, profile, section, z):
        return Outline(
            center=np.zeros((len(z), 1)),
            extent=np.ones(1),
            inner_ratio=np.zeros((len(z), 1)),
            outer_ratio=np.ones((len(z), 1)),
            shape=("sector",),
            acts=self.acts(profile, z),
        )


def test_another_kind_of_actuator_has_the_parameters_that_it_declares(trunk):
    arm = trunk.replace(actuators=(*trunk.actuators, Pull()))
    known = parameters(arm)
    assert {name for name in known if name.startswith("pull.")} == {
        "pull.area",
        "pull.lower",
        "pull.upper",
    }
    assert (known["pull.area"].unit, known["pull.lower"].unit) == ("m2", "N")
    made = changed(arm, {"pull.area": 2e-4, "pull.lower": -3.0, "extent": 0.5})
    assert made.actuators[3] == Pull(area=2e-4, activation_bounds=(-3.0, 0.0))
    assert "lower" not in known  # newtons and strains have no common bound
