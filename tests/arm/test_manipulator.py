"""Arms are values: checked, frozen, replaceable, named."""

from __future__ import annotations

import dataclasses
import math
import pickle

import numpy as np
import pytest
from hypothesis import given

import softreach as sr
from softreach.arm import LinearTaper, Material, Ring, Section, designs, edits
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.laws import arm_of, arms


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"inner_radius": 1 / 12},
            r"inner_radius = 0.0833333: must be below outer_radius = 0.0625 m",
        ),
        ({"activation_bounds": (0.5, -0.5)}, "lower <= upper"),
        ({"activation_bounds": ((-1, 0),) * 2}, "one pair, or 3 pairs"),
        ({"actuators": (3,)}, r"actuators\[0\] = 3: must be an actuator"),
    ],
)
def test_an_impossible_arm_is_refused_with_value_and_allowed_range(trunk, change, message):
    tube = {"length": 1.0, "outer_radius": 1 / 16, "inner_radius": 3 / 64}
    with pytest.raises(sr.InvalidDesign, match=message):
        sr.Manipulator.tapered(**(tube | {"actuators": trunk.actuators} | change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"profile": 1.0}, "profile = 1: must be a Profile"),
        ({"section": Ring(inner_ratio=0.5)}, "section = Ring.*: must be a Section"),
        ({"actuators": iter(())}, "must be a sequence"),
        ({"base": np.eye(3)}, r"base.*: must be a Base, such as"),
        ({"loads": (0, 0, -9.81)}, "must be Loads or None"),
    ],
)
def test_parts_of_another_kind_are_refused(trunk, change, message):
    with pytest.raises(sr.InvalidDesign, match=message):
        trunk.replace(**change)


@pytest.mark.parametrize("bounds", [(1, 0), ((-1, 0),) * 2, None, "ab", (0, math.inf)])
def test_other_bounds_are_checked_like_those_of_a_new_arm(trunk, bounds):
    with pytest.raises(sr.InvalidDesign, match="activation_bounds"):
        trunk.with_bounds(bounds)


def test_all_faults_are_named_at_once(trunk):
    with pytest.raises(sr.InvalidDesign) as error:
        sr.Manipulator.tapered(
            length=1.0,
            outer_radius=0.1,
            inner_radius=1.0,
            poisson_ratio=2.0,
            activation_bounds=(1, 0),
            actuators=(*trunk.actuators, 3),
        )
    assert {fault.path for fault in error.value.faults} == {
        "inner_radius",
        "poisson_ratio",
        "activation_bounds",
        "actuators[3]",
    }


def test_designs_are_frozen_hashable_values(trunk):
    assert trunk == designs.minimal_trunk()
    assert hash(trunk) == hash(designs.minimal_trunk())
    with pytest.raises(dataclasses.FrozenInstanceError):
        trunk.profile = None
    with pytest.raises(dataclasses.FrozenInstanceError):
        trunk.profile.length = 2.0
    with pytest.raises(ValueError, match="read-only"):
        trunk.bounds[0, 0] = 1.0


@given(arm=arms())
def test_a_design_survives_a_pickle(arm):
    again = pickle.loads(pickle.dumps(arm))
    assert again == arm
    assert hash(again) == hash(arm)


def test_a_tapered_arm_is_its_profile_its_section_and_its_actuators(trunk):
    arm = sr.Manipulator.tapered(
        length=2.0, outer_radius=0.2, inner_radius=0.1, taper=0.01, actuators=[*trunk.actuators]
    )
    profile = LinearTaper(length=2.0, outer_radius=0.2, taper=0.01)
    section = Section(rings=(Ring(inner_ratio=0.5),))
    assert arm == sr.Manipulator(profile=profile, section=section, actuators=trunk.actuators)
    assert arm.length == 2.0


class TestBounds:
    def test_bounds_follow_the_bundles_and_belong_to_their_actuators(self):
        pair = sr.FiberArchitecture(helical_angle=0.0, extent=0.3, bundles=2)
        each = ((-1.0, 0.0), (-0.5, 0.0), (-0.25, 0.25))
        arm = arm_of(pair, pair.replace(bundles=1), activation_bounds=each)
        np.testing.assert_array_equal(arm.bounds, each)
        np.testing.assert_array_equal(arm.actuators[0].bounds, each[:2])
        np.testing.assert_array_equal(arm.actuators[1].bounds, each[2:])

    def test_without_bounds_of_its_own_an_arm_has_those_of_its_actuators(self):
        fiber = sr.FiberArchitecture(helical_angle=0.0, extent=0.3, activation_bounds=(-0.3, 0.1))
        np.testing.assert_array_equal(arm_of(fiber, activation_bounds=None).bounds, [[-0.3, 0.1]])

    @given(arm=arms())
    def test_replacing_bounds_by_themselves_changes_nothing(self, arm):
        assert arm.with_bounds(arm.bounds) == arm

    def test_one_pair_for_all_is_the_same_as_one_for_each(self, trunk):
        assert trunk.with_bounds((-1, 0)) == trunk.with_bounds(((-1, 0),) * 3)


class TestNames:
    def test_whoever_has_no_name_is_called_after_its_place(self):
        fiber = sr.FiberArchitecture(helical_angle=0.0, extent=0.1)
        arm = arm_of(fiber, fiber.replace(name="own"), fiber)
        assert arm.bundle_names == ("fiber 1", "own", "fiber 3")
        assert arm.actuators[2].name == "fiber 3"

    def test_a_name_that_is_taken_is_not_given_again(self):
        fiber = sr.FiberArchitecture(helical_angle=0.0, extent=0.1)
        names = arm_of(fiber.replace(name="fiber 2"), fiber, fiber).bundle_names
        assert names[0] == "fiber 2"
        assert len(set(names)) == 3

    def test_two_bundles_of_one_name_are_refused(self):
        fiber = sr.FiberArchitecture(helical_angle=0.0, extent=0.1)
        with pytest.raises(sr.InvalidDesign, match="'a 1': names two bundles"):
            arm_of(fiber.replace(name="a", bundles=2), fiber.replace(name="a 1"))


def test_an_arm_prints_its_size_and_its_bundles(trunk):
    assert repr(trunk) == (
        "Manipulator: L = 1 m, R2 = 0.0625 to 0.02758 m\n  bundles: left, right, longitudinal"
    )
    left, right, longitudinal = trunk.actuators
    forty = longitudinal.replace(bundles=40, extent=0.1)
    names = repr(trunk.replace(actuators=(left, right, forty))).splitlines()[1]
    assert names.startswith("  bundles: left, right, longitudinal 1, ")
    assert names.endswith(", longitudinal 4, ... (42 in all)")


# Parts of an arm are added, removed and renamed one at a time


SOFT = "dragon_skin_30"


@pytest.fixture
def silicone(trunk):
    return edits.with_changed_ring(trunk, 0, material=SOFT)


@pytest.mark.parametrize("kind", edits.ACTUATOR_KINDS)
def test_a_new_actuator_of_each_kind_drives_the_arm(silicone, kind):
    arm = edits.with_actuator(silicone, kind)
    assert arm.actuators[:-1] == silicone.actuators
    assert arm.actuators[-1].name == f"{kind} 1"
    assert edits.with_actuator(arm, kind).actuators[-1].name == f"{kind} 2"
    moved = np.zeros((1, arm.bundles))
    end = arm.bounds[-1]
    moved[0, -1] = end[np.abs(end).argmax()]
    apart = sr.tip_positions(arm, moved) - sr.tip_positions(arm, 0 * moved)
    assert 0.01 < np.linalg.norm(apart) / arm.length < 1.5


def test_a_new_actuator_lies_where_there_is_most_room(silicone):
    arm = edits.with_actuator(silicone, "fiber")
    angles = np.degrees(arm.outline([0.0]).center[0]) % 360
    np.testing.assert_allclose(sorted(angles[:3]), [66, 114, 270])
    np.testing.assert_allclose(min(abs(angles[3] - angles[:3])), (270 - 114) / 2)


@pytest.mark.parametrize("kind", ["tendon", "chamber"])
def test_forces_need_a_modulus(trunk, kind):
    with pytest.raises(InvalidDesign, match=r"rings\[0\].material.young_modulus: must be given"):
        edits.with_actuator(trunk, kind)


def test_what_is_added_can_be_removed(silicone):
    arm = edits.with_ring(edits.with_actuator(silicone, "tendon"))
    assert edits.without_actuator(edits.without_ring(arm, 1), "tendon 1") == silicone


def test_the_last_actuator_and_the_last_ring_stay(trunk):
    for name in ("left", "right"):
        trunk = edits.without_actuator(trunk, name)
    with pytest.raises(InvalidInput, match="the last one cannot be removed"):
        edits.without_actuator(trunk, "longitudinal")
    with pytest.raises(InvalidInput, match="the last one cannot be removed"):
        edits.without_ring(trunk, 0)


def test_a_new_ring_of_the_same_matter_changes_no_tip(silicone):
    gamma = np.full((1, 3), -0.5)
    arm = edits.with_ring(silicone)
    assert len(arm.section.rings) == 2
    np.testing.assert_allclose(
        sr.tip_positions(arm, gamma), sr.tip_positions(silicone, gamma), atol=1e-12
    )


def test_removing_a_ring_leaves_actuators_in_theirs(silicone):
    arm = edits.with_ring(edits.with_ring(silicone))
    inner = arm.actuators[0].replace(ring=2)
    arm = arm.replace(actuators=(inner, *arm.actuators[1:]))
    left = edits.without_ring(arm, 1)
    assert left.section.ring(left.actuators[0].ring) == arm.section.rings[2]
    with pytest.raises(InvalidInput, match="move or remove left first"):
        edits.without_ring(arm, 2)


def test_an_actuator_moves_into_another_ring_alone(silicone):
    arm = edits.with_ring(silicone)
    moved = edits.with_changed_actuator(arm, "left", ring=1)
    assert [arm.section.rings.index(arm.section.ring(one.ring)) for one in moved.actuators] == [
        int(one.name == "left") for one in arm.actuators
    ]


def test_renaming_a_ring_keeps_its_actuators(silicone):
    named = edits.with_changed_ring(silicone, 0, name="skin")
    inside = named.replace(actuators=tuple(one.replace(ring="skin") for one in named.actuators))
    again = edits.with_changed_ring(inside, 0, name="wall")
    assert [again.section.ring(one.ring).name for one in again.actuators] == ["wall"] * 3


def test_a_name_that_another_has_is_refused(silicone):
    with pytest.raises(InvalidDesign, match="must differ"):
        edits.with_changed_actuator(silicone, "left", name="right")
    two = edits.with_changed_ring(edits.with_ring(silicone), 0, name="skin")
    with pytest.raises(InvalidDesign, match="must differ"):
        edits.with_changed_ring(two, 1, name="skin")


def test_core_and_rings_take_named_materials(silicone):
    arm = edits.with_core(silicone, "ecoflex_00_30")
    assert arm.section.core_material.name == "ecoflex_00_30"
    assert edits.with_core(arm, "").section.core is None
    assert isinstance(arm.section.core_material, Material)
    assert arm.section.rings == silicone.section.rings
