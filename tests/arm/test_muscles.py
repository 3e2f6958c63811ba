"""Laws of what contracts in a ring: fibers, oblique and radial muscles, by quadrature."""

from __future__ import annotations

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
from softreach.arm.part import AlongArm
from softreach.arm.tables import tables
from softreach.rod.kinematics import tip_positions
from softreach.rod.summary import describe
from tests.kinds import any_arms, layers_at
from tests.laws import arm_of, arms, in_box
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


# Fiber architectures: what is refused, how they wind, where their bundles lie, how they split


@given(arm=arms())
def test_revolution_and_helical_angle_say_the_same(arm):
    facts = describe(arm)
    by_angle = tuple(
        fiber.replace(helical_angle=float(angle))
        for fiber, angle in zip(arm.fibers, facts.helical_angles, strict=True)
    )
    np.testing.assert_allclose(
        describe(arm.replace(actuators=by_angle)).revolutions, facts.revolutions, atol=1e-12
    )
    np.testing.assert_allclose(facts.revolutions, [f.revolution for f in arm.fibers], atol=1e-12)


def test_bounds_are_one_pair_where_all_bundles_share_it():
    pair = FiberArchitecture(
        helical_angle=0.0, extent=0.3, bundles=2, activation_bounds=np.array([[-1, 0], [-1, 0]])
    )
    assert pair.activation_bounds == (-1.0, 0.0)
    np.testing.assert_array_equal(pair.bounds, [[-1, 0], [-1, 0]])
    apart = pair.replace(activation_bounds=((-1, 0), (0, 1)))
    assert apart.activation_bounds == ((-1.0, 0.0), (0.0, 1.0))


@given(arm=arms())
def test_an_outline_turns_by_the_revolution(arm):
    start, end = arm.outline([0.0, arm.length]).center
    each = np.repeat(describe(arm).revolutions, [fiber.bundles for fiber in arm.fibers])
    np.testing.assert_allclose(end - start, each, atol=1e-12)


def test_bundle_geometry_follows_the_architecture():
    arm = arm_of(
        sr.FiberArchitecture(helical_angle=0.0, extent=0.3, offset=0.2, bundles=3, name="ring")
    )
    outline = arm.outline([0.0])
    np.testing.assert_allclose(outline.center[0], 0.2 + 2 * np.pi / 3 * np.arange(3))
    np.testing.assert_array_equal(outline.extent, [0.3] * 3)
    np.testing.assert_array_equal(outline.inner_ratio[0], [arm.section.rings[0].inner_ratio] * 3)
    np.testing.assert_array_equal(outline.outer_ratio[0], [1.0] * 3)
    assert arm.bundle_names == ("ring 1", "ring 2", "ring 3")


def test_parts_that_fill_the_sector_move_the_arm_as_the_whole_did(trunk):
    left, right, longitudinal = trunk.actuators
    extent = right.extent / 3
    places = right.offset + extent * np.array([-1.0, 0.0, 1.0])
    parts = [
        right.replace(name=f"part {k}", offset=place, extent=extent)
        for k, place in enumerate(places.tolist())
    ]
    arm = trunk.replace(actuators=(left, *parts, longitudinal))
    gamma = in_box(trunk, 20)
    same = np.repeat(gamma, [1, 3, 1], axis=1)
    np.testing.assert_allclose(
        tip_positions(arm, same), tip_positions(trunk, gamma), rtol=0, atol=1e-6
    )
