"""Targets out of reach that another base would reach."""

from __future__ import annotations

import pytest

import softreach as sr
from softreach.arm.base import POINTS
from softreach.inverse import Status, twin_hints


@pytest.mark.large  # the command line is asked for one in the usual run
def test_a_place_below_is_reached_by_a_hanging_arm_when_asked_just_so():
    arm = sr.designs.minimal_trunk(length=0.3)
    hanging = arm.replace(base=sr.Base(points="down"))
    place = [[0.08, 0.05, -0.24]]
    assert sr.solve_inverse(arm, place).statuses[0] != Status.REACHED
    assert sr.solve_inverse(hanging, place).statuses[0] == Status.REACHED
    (hint,) = twin_hints(arm, place)
    assert "--base hanging" in hint


@pytest.mark.parametrize(
    "word",
    [*(pytest.param(word, marks=pytest.mark.large) for word in [*POINTS][1:-1]), [*POINTS][-1]],
)
def test_the_hint_names_a_base_that_reaches_it(word, trunk):
    base = sr.Base(position=(0.4, 0.1, 1.0), turn=0.3)
    arm = trunk.replace(base=base)
    there = arm.replace(base=base.replace(points=word))
    place = sr.tip_positions(there, [[-0.4, -0.9, -0.3]])
    (hint,) = twin_hints(arm, place)
    assert hint
    name = hint.rpartition("--base ")[2]
    named = {"hanging": "down", "upright": "up"}.get(name, name)
    found = sr.solve_inverse(arm.replace(base=base.replace(points=named)), place)
    assert found.statuses[0] == Status.REACHED


def test_what_no_base_reaches_has_no_hint(trunk):
    assert twin_hints(trunk, [[5.0, 0.0, 0.0], [0.2, 0.1, -0.6]])[0] == ""
