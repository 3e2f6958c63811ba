"""Laws of what contracts in a ring: fibers, oblique and radial muscles, by quadrature."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import (
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    ObliqueMuscle,
    RadialMuscle,
    Ring,
    Section,
    SectorActuator,
)
from softreach.arm.along import AlongArm
from softreach.arm.tables import tables
from softreach.support.errors import InvalidDesign
from tests.kinds import any_arms, layers_at
from tests.oracles.sections import (
    Drive,
    Layer,
    active_load,
    fiber,
    least_energy_strains,
    radial,
    stiffness,
)

RUBBER = Material(young_modulus=2e6, poisson_ratio=0.4)
TRUNK = {
    "profile": LinearTaper(length=1.0, outer_radius=0.06, taper=0.02),
    "section": Section(rings=(Ring(inner_ratio=0.6, material=RUBBER),)),
}


def arm(*muscles):
    return Manipulator(actuators=muscles, **TRUNK)


def drive_of(body, actuator, bundle, z):
    """The sector of one bundle at Z, and the direction of its fibers."""
    ring = body.section.ring(actuator.ring)
    radius = float(body.profile.radius(z))
    layer = Layer(
        inner=ring.inner_ratio * radius,
        outer=ring.outer_ratio * radius,
        young_modulus=ring.material.young_modulus,
        poisson_ratio=ring.material.poisson_ratio,
    )
    center = actuator.outline(body.profile, body.section, np.array([z])).center[0, bundle]
    sector = (center - actuator.extent / 2, center + actuator.extent / 2)
    if isinstance(actuator, RadialMuscle):
        return Drive(layer=layer, sector=sector, direction=radial)
    angle = actuator.helical_angle
    if isinstance(actuator, FiberArchitecture):
        angle = actuator.helical_angle_on(body.profile, body.section)
    alpha = float(angle(z / body.length)) if isinstance(angle, AlongArm) else angle
    slope = -ring.outer_ratio * float(body.profile.slope(z))
    return Drive(layer=layer, sector=sector, direction=fiber(layer, alpha, slope))


@pytest.mark.parametrize("kind", [FiberArchitecture, ObliqueMuscle, RadialMuscle])
def test_a_sector_pulls_as_the_quadrature_of_its_active_stress_says(kind):
    @given(body=any_arms(kind), share=st.floats(0.0, 0.999))
    def law(body, share):
        z = share * body.length
        table, bundle = tables(body, [z]), 0
        resists = np.array(stiffness(layers_at(body.section, float(body.profile.radius(z))))[:4])
        for actuator in body.actuators:
            acts = actuator.acts(body.profile, np.array([z]))[0]
            for k in range(actuator.bundles):
                if isinstance(actuator, SectorActuator):
                    force, moment = active_load(drive_of(body, actuator, k, z))
                    expected = acts[k] * np.array([force, *moment]) / resists
                    found = [table.extension[0, bundle], *table.curvature[0, :, bundle]]
                    scale = np.abs(expected).max() + 1e-12
                    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-10 * scale)
                bundle += 1

    law()


def test_the_strains_of_a_layered_section_are_those_of_least_energy():
    layers = Section(
        rings=(
            Ring(inner_ratio=0.5, material=RUBBER, name="skin"),
            Ring(
                inner_ratio=0.3,
                outer_ratio=0.7,
                material=Material(young_modulus=9e6, poisson_ratio=0.2),
            ),
        ),
        core=Material(young_modulus=1e5),
    )
    muscle = ObliqueMuscle(helical_angle=0.7, extent=0.8, offset=0.4, ring=1)
    body = Manipulator(profile=TRUNK["profile"], section=layers, actuators=(muscle,))
    resists = layers_at(layers, float(body.profile.radius(0.3)))
    expected = least_energy_strains(resists, drive_of(body, muscle, 0, 0.3))
    table = tables(body, [0.3])
    np.testing.assert_allclose(table.extension[0], expected[:1], rtol=1e-11)
    np.testing.assert_allclose(table.curvature[0, :, 0], expected[1:], rtol=1e-11)


@given(angle=st.floats(-1.2, 1.2), offset=st.floats(-4, 4), extent=st.floats(0.1, 6.0))
def test_an_oblique_muscle_is_a_fiber_that_does_not_wind(angle, offset, extent):
    """At the base they are one; further on the muscle keeps the section it has there."""
    place = {"helical_angle": angle, "extent": extent, "offset": offset}
    muscle, wound = arm(ObliqueMuscle(**place)), arm(FiberArchitecture(**place))
    start = tables(wound, [0.0])
    found = tables(muscle, [0.0, 0.7])
    np.testing.assert_array_equal(found.extension[0], start.extension[0])
    np.testing.assert_array_equal(found.curvature[0], start.curvature[0])
    thinner = TRUNK["profile"].radius(0.0) / TRUNK["profile"].radius(0.7)
    np.testing.assert_allclose(found.extension[1], start.extension[0], rtol=1e-12)
    np.testing.assert_allclose(
        found.curvature[1], thinner * start.curvature[0], rtol=1e-12, atol=1e-13
    )


def test_oblique_muscles_of_both_hands_cancel_their_twist_and_bend_together():
    pair = [
        ObliqueMuscle(name=name, helical_angle=angle, extent=0.9, offset=0.2)
        for name, angle in (("right", 0.8), ("left", -0.8))
    ]
    table = tables(arm(*pair), [0.0, 0.5])
    together = table.curvature.sum(axis=2)
    np.testing.assert_allclose(together[:, 2], 0.0, atol=1e-14)
    np.testing.assert_allclose(together[:, :2], 2 * table.curvature[:, :2, 0], rtol=1e-13)
    assert np.abs(table.curvature[:, 2, 0]).min() > 1.0


def test_a_radial_muscle_all_around_makes_the_arm_longer_and_no_more():
    """It contracts the girth; ν times that, in the share of the section it fills, is length."""
    muscle = arm(RadialMuscle(extent=2 * math.pi))
    table = tables(muscle, [0.0, 0.5])
    np.testing.assert_allclose(table.extension, -0.4 * (1 - 0.6**2) / 2 * 2, rtol=1e-13)
    np.testing.assert_allclose(table.curvature, 0.0, atol=1e-14)
    assert sr.tip_positions(muscle, [[-0.5]])[0, 2] > 1.0


def test_a_radial_muscle_on_one_side_bends_away_from_it():
    tip = sr.tip_positions(arm(RadialMuscle(extent=1.0, offset=0.6)), [[-1.0]])[0]
    assert tip[:2] @ [math.cos(0.6), math.sin(0.6)] < -0.01


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: ObliqueMuscle(
                helical_angle=sr.arm.Pieces(stations_over_length=(0, 1), values=(0.1,)), extent=0.5
            ),
            r"helical_angle = Pieces\(.*must be a finite number",
        ),
        (
            lambda: RadialMuscle(extent=1.0, ring=1.0),
            "ring = 1: must be the index, from 0, or the name",
        ),
        (lambda: RadialMuscle(extent=1.0, ring=-1), "ring = -1: must be the index, from 0"),
        (
            lambda: arm(RadialMuscle(extent=1.0, ring="skin", name="m")),
            r"^m.ring = 'skin': must be one of the section's rings: 0$",
        ),
        (
            lambda: arm(RadialMuscle(extent=1.0, ring=1, name="m")),
            r"^m.ring = 1: must be one of the section's rings: 0$",
        ),
    ],
)
def test_an_impossible_muscle_is_refused(make, message):
    with pytest.raises(InvalidDesign, match=message):
        make()
