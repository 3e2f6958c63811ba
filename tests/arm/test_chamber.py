"""Laws of pressure chambers: end forces on a lumen, and what a tendon does the same with."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import (
    Chamber,
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    Ring,
    Section,
    Tendon,
)
from softreach.arm.tables import check_extension, tables
from softreach.rod.summary import design_warnings
from softreach.support.errors import InvalidDesign
from tests.kinds import any_arms, layers_at
from tests.oracles.sections import disc, pressure_load, stiffness

LENGTH, RADIUS, MODULUS = 0.2, 0.015, 3e5
K0, K1 = math.pi * MODULUS * RADIUS**2, math.pi / 4 * MODULUS * RADIUS**4
SECTION = Section(rings=(Ring(inner_ratio=0.5, material=Material(young_modulus=MODULUS)),))
CYLINDER = LinearTaper(length=LENGTH, outer_radius=RADIUS)


def arm(*actuators, profile=CYLINDER):
    return Manipulator(profile=profile, section=SECTION, actuators=actuators)


def chamber(**fields):
    given = {"distance": 0.008, "radius": 0.004, "activation_bounds": (-2e4, 1e5)}
    return Chamber(**(given | fields))


@pytest.mark.parametrize(("distance", "warned"), [(0.5, False), (0.75, False), (0.76, True)])
def test_a_chamber_that_leaves_the_arm_is_warned_of(distance, warned):
    inside = arm(chamber(distance=None, distance_ratio=distance, radius=None, radius_ratio=0.25))
    assert any("does not enclose" in line for line in design_warnings(inside)) == warned


@given(body=any_arms(Chamber), share=st.floats(0.0, 0.999))
def test_a_chamber_pushes_as_the_quadrature_of_its_pressure_says(body, share):
    z = share * body.length
    radius = float(body.profile.radius(z))
    table, bundle = tables(body, [z]), 0
    resists = np.array(stiffness(layers_at(body.section, radius))[:4])
    for actuator in body.actuators:
        acts = actuator.acts(body.profile, np.array([z]))[0]
        for k in range(actuator.bundles):
            if isinstance(actuator, Chamber):
                angle = actuator.offset + 2 * math.pi * k / actuator.bundles
                distance = actuator.distance_ratio * radius
                center = (distance * math.cos(angle), distance * math.sin(angle))
                force, moment = pressure_load(disc(center, actuator.radius_ratio * radius))
                expected = acts[k] * actuator.area_factor * np.array([force, *moment]) / resists
                found = [table.extension[0, bundle], *table.curvature[0, :, bundle]]
                scale = np.abs(expected).max()
                np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-11 * scale)
            bundle += 1


@given(pressure=st.floats(1e3, 1e5), offset=st.floats(-4, 4))
def test_a_chamber_lengthens_the_arm_and_bends_it_away_to_an_arc(pressure, offset):
    area = math.pi * 0.004**2
    zeta, curvature = 1 + pressure * area / K0, pressure * area * 0.008 / K1
    angle, bent = curvature * LENGTH, zeta / curvature
    side = bent * (1 - math.cos(angle))
    expected = [-side * math.cos(offset), -side * math.sin(offset), bent * math.sin(angle)]
    tip = sr.tip_positions(arm(chamber(offset=offset)), [[pressure]], tol=1e-11)[0]
    np.testing.assert_allclose(tip, expected, atol=1e-11)


@given(tension=st.floats(0.1, 4.0))
def test_a_chamber_opposite_a_tendon_doubles_its_bending_and_gives_back_its_length(tension):
    """P A = τ at opposite places: equal moments, opposite forces."""
    pressure = tension / (math.pi * 0.004**2)
    pair = arm(
        Tendon(distance=0.008, offset=0.3, activation_bounds=(0, 5)),
        chamber(offset=0.3 + math.pi, activation_bounds=(0, 1e5)),
    )
    curvature = 2 * tension * 0.008 / K1
    angle = curvature * LENGTH
    side = (1 - math.cos(angle)) / curvature
    expected = [side * math.cos(0.3), side * math.sin(0.3), math.sin(angle) / curvature]
    tip = sr.tip_positions(pair, [[tension, pressure]], tol=1e-11)[0]
    np.testing.assert_allclose(tip, expected, atol=1e-11)
    np.testing.assert_allclose(tables(pair, [0.1]).extension @ [tension, pressure], 0.0, atol=1e-14)


@given(tension=st.floats(0.1, 4.0), taper=st.floats(-0.02, 0.04))
def test_a_chamber_around_a_tendon_takes_its_tension_away(tension, taper):
    """A cable in a tube of its own: what the fluid pushes, the cable holds."""
    pair = arm(
        Tendon(distance=0.006, offset=0.3, activation_bounds=(0, 5)),
        chamber(distance=0.006, offset=0.3, activation_bounds=(0, 1e5)),
        profile=CYLINDER.replace(taper=taper),
    )
    tip = sr.tip_positions(pair, [[tension, tension / (math.pi * 0.004**2)]])[0]
    np.testing.assert_allclose(tip, [0, 0, LENGTH], atol=1e-13)


def test_fibers_that_leave_no_length_of_matter_are_refused_also_where_pressure_lengthens_the_arm():
    fiber = FiberArchitecture(extent=6.0, helical_angle=0.0, activation_bounds=(-5.0, 0.0))
    alone = arm(fiber)
    shortest = 1.0 - 5.0 * float(tables(alone, [0.0]).extension[0, 0])
    assert shortest < 0
    area = math.pi * 0.004**2
    pressure = (1.0 - shortest) * K0 / area  # ζ = 1 and more
    with pytest.raises(InvalidDesign, match="of matter itself, without forces; must keep ζ > 0"):
        check_extension(arm(fiber, chamber(activation_bounds=(pressure, pressure))))


def test_sizes_that_are_ratios_shrink_with_the_arm_and_lengths_do_not():
    tapered = CYLINDER.replace(taper=0.03)
    z = np.array([0.0, LENGTH])
    share = tapered.radius(LENGTH) / RADIUS
    by_length = arm(chamber(), profile=tapered)
    by_ratio = arm(
        Chamber(distance_ratio=8 / 15, radius_ratio=4 / 15, activation_bounds=(0, 1)),
        profile=tapered,
    )
    ends = [
        tables(body, z).extension[:, 0] * SECTION.stiffness(tapered.radius(z)).axial
        for body in (by_length, by_ratio)
    ]
    area = math.pi * 0.004**2
    np.testing.assert_allclose(ends, [[area, area], [area, area * share**2]], rtol=1e-13)
