"""Symmetries of the tips of arms of every kind: turned, mirrored, scaled."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import FiberArchitecture, ObliqueMuscle, Pieces, Samples, Tendon
from tests.kinds import KINDS, any_arms
from tests.laws import in_box


def turned(actuator, angle):
    return actuator.replace(offset=actuator.offset + angle)


def opposite(value):
    """The other hand of an angle, constant or along the arm."""
    if isinstance(value, Pieces | Samples):
        return value.replace(values=tuple(-one for one in value.values))
    return None if value is None else -value


def mirrored(actuator):
    """As seen in a mirror that holds the x-axis and the arm."""
    change = {"offset": -actuator.offset}
    if isinstance(actuator, FiberArchitecture):
        for field in ("helical_angle", "revolution"):
            change[field] = opposite(getattr(actuator, field))
    elif isinstance(actuator, ObliqueMuscle):
        change["helical_angle"] = opposite(actuator.helical_angle)
    elif isinstance(actuator, Tendon):
        change |= {"revolution": -actuator.revolution, "routing": opposite(actuator.routing)}
    return actuator.replace(**change)


def in_mirror_order(arm, gamma):
    """Bundle j of n is the image of bundle -j."""
    order, first = [], 0
    for actuator in arm.actuators:
        order += [first + (-j) % actuator.bundles for j in range(actuator.bundles)]
        first += actuator.bundles
    return gamma[:, order]


@pytest.mark.parametrize("kind", KINDS)
def test_turning_all_actuators_turns_the_tips(kind):
    @given(arm=any_arms(kind), angle=st.floats(-4, 4))
    def law(arm, angle):
        gamma = in_box(arm, 5)
        other = arm.replace(actuators=tuple(turned(one, angle) for one in arm.actuators))
        c, s = math.cos(angle), math.sin(angle)
        expected = sr.tip_positions(arm, gamma, tol=1e-9) @ [[c, s, 0], [-s, c, 0], [0, 0, 1]]
        found = sr.tip_positions(other, gamma, tol=1e-9)
        np.testing.assert_allclose(found, expected, atol=3e-9 * arm.length)

    law()


@pytest.mark.parametrize("kind", KINDS)
def test_mirroring_all_actuators_mirrors_the_tips(kind):
    @given(arm=any_arms(kind))
    def law(arm):
        gamma = in_box(arm, 5)
        other = arm.replace(actuators=tuple(mirrored(one) for one in arm.actuators))
        expected = sr.tip_positions(arm, gamma, tol=1e-9) * [1, -1, 1]
        found = sr.tip_positions(other, in_mirror_order(arm, gamma), tol=1e-9)
        np.testing.assert_allclose(found, expected, atol=3e-9 * arm.length)

    law()


@pytest.mark.parametrize("kind", KINDS)
def test_exchanging_bundles_turns_what_they_do(kind):
    """Bundles lie evenly: giving each the activation of the one before turns by 2π/n."""

    @given(arm=any_arms(kind))
    def law(arm):
        arm = arm.replace(actuators=arm.actuators[:1])
        n, gamma = arm.bundles, in_box(arm, 5)
        c, s = math.cos(2 * math.pi / n), math.sin(2 * math.pi / n)
        expected = sr.tip_positions(arm, gamma, tol=1e-9) @ [[c, s, 0], [-s, c, 0], [0, 0, 1]]
        found = sr.tip_positions(arm, np.roll(gamma, 1, axis=1), tol=1e-9)
        np.testing.assert_allclose(found, expected, atol=3e-9 * arm.length)

    law()
