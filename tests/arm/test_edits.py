"""Parts of an arm are added, removed and renamed one at a time."""

from __future__ import annotations

import math

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Material, edits
from softreach.support.errors import InvalidDesign, InvalidInput

SOFT = "dragon_skin_30"


@pytest.fixture
def silicone(trunk):
    return edits.with_ring_material(trunk, 0, SOFT)


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
    with pytest.raises(InvalidInput, match="more than one to remove"):
        edits.without_actuator(trunk, "longitudinal")
    with pytest.raises(InvalidInput, match="more than one to remove"):
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
    moved = edits.with_actuator_ring(arm, "left", 1)
    assert [arm.section.rings.index(arm.section.ring(one.ring)) for one in moved.actuators] == [
        int(one.name == "left") for one in arm.actuators
    ]


def test_renaming_a_ring_keeps_its_actuators(silicone):
    named = edits.with_ring_name(silicone, 0, "skin")
    inside = named.replace(actuators=tuple(one.replace(ring="skin") for one in named.actuators))
    again = edits.with_ring_name(inside, 0, "wall")
    assert [again.section.ring(one.ring).name for one in again.actuators] == ["wall"] * 3


def test_a_name_that_another_has_is_refused(silicone):
    with pytest.raises(InvalidDesign, match="must differ"):
        edits.with_actuator_name(silicone, "left", "right")
    two = edits.with_ring_name(edits.with_ring(silicone), 0, "skin")
    with pytest.raises(InvalidDesign, match="must differ"):
        edits.with_ring_name(two, 1, "skin")


def test_core_and_rings_take_named_materials(silicone):
    arm = edits.with_core(silicone, "ecoflex_00_30")
    assert arm.section.core_material.name == "ecoflex_00_30"
    assert edits.with_core(arm, "").section.core is None
    assert isinstance(arm.section.core_material, Material)
    assert math.isclose(arm.section.rings[0].modulus, silicone.section.rings[0].modulus)
