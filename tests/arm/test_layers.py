"""Laws of layered sections: stiffness by quadrature, and layers that make no difference."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import dblquad

from softreach.arm import (
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    Ring,
    Section,
    Tendon,
)
from softreach.arm.tables import compliance, tables
from softreach.support.errors import InvalidDesign
from tests.kinds import any_arms, layers_at, materials, profiles, sections
from tests.laws import arm_of
from tests.oracles.sections import stiffness

RUBBER = Material(young_modulus=2e6, poisson_ratio=0.4, density=1100.0, name="rubber")
SLEEVE = {"length": 0.3, "outer_radius": 0.02, "taper": 0.01}


@given(section=sections(), radius=st.floats(1e-3, 1.0))
def test_layers_resist_and_weigh_what_the_quadrature_over_their_area_says(section, radius):
    expected = stiffness(layers_at(section, radius))
    found = section.stiffness(radius)
    np.testing.assert_allclose(found.axial, expected.axial, rtol=1e-12)
    np.testing.assert_allclose(found.bending, [expected.bending_1], rtol=1e-12)
    np.testing.assert_allclose(found.torsion, expected.torsion, rtol=1e-12)
    if all(layer.material.density for layer in section.layers):
        np.testing.assert_allclose(section.mass_per_length(radius), expected.mass, rtol=1e-12)


def test_the_laboratory_arm_of_three_overlapping_rings_has_its_published_stiffness():
    """Three families of fibers in one layer, each a ring of E σ/2π of its own."""
    layer = Material(young_modulus=1.4e6 * 48 / 360, poisson_ratio=0.495)
    rings = tuple(Ring(inner_ratio=5 / 6, material=layer) for _ in range(3))
    core = Material(young_modulus=0.1278e6, poisson_ratio=0.5)
    found = Section(rings=rings, core=core).stiffness(0.09 / 20)
    np.testing.assert_allclose(found, [16.53165, 1.132275e-4, 7.569322e-5], rtol=5e-7)


@given(
    inner=st.floats(0.3, 0.9),
    taper=st.floats(-0.02, 0.05),
    revolution=st.floats(-3, 3),
    modulus=st.floats(1e3, 1e9),
)
def test_a_ring_and_a_core_of_one_material_are_the_homogeneous_arm(
    inner, taper, revolution, modulus
):
    fiber = FiberArchitecture(revolution=revolution, extent=0.7, offset=0.3)
    whole = arm_of(fiber, inner_radius=inner / 16, taper=taper, poisson_ratio=0.4)
    material = RUBBER.replace(young_modulus=modulus)
    z, expected = np.linspace(0, 1, 5), tables(whole, np.linspace(0, 1, 5))
    for rings in (
        (Ring(inner_ratio=inner, material=material),),
        (
            Ring(inner_ratio=inner, material=material),
            Ring(inner_ratio=0.2, outer_ratio=inner, material=material.replace(name="inner")),
        ),
    ):
        layered = whole.replace(section=Section(rings=rings, core=material.replace(name="core")))
        found = tables(layered, z)
        np.testing.assert_allclose(found.extension, expected.extension, rtol=1e-13)
        np.testing.assert_allclose(found.curvature, expected.curvature, rtol=1e-12, atol=1e-13)


@given(
    material=materials(),
    inner=st.floats(0.2, 0.7),
    share=st.floats(0.1, 0.9),
    angle=st.floats(-1.2, 1.2),
    taper=st.floats(-0.02, 0.03),
)
def test_two_thin_rings_in_place_of_one_thick_do_the_same(material, inner, share, angle, taper):
    """At the radius R the angle is atan(R tan α / R2): that of the inner ring at its own rim."""
    between = inner + share * (1 - inner)
    thick = Section(rings=(Ring(inner_ratio=inner, material=material),))
    thin = Section(
        rings=(
            Ring(inner_ratio=inner, outer_ratio=between, material=material, name="inner"),
            Ring(inner_ratio=between, material=material, name="outer"),
        )
    )

    def fiber(angle, ring):
        return FiberArchitecture(helical_angle=angle, extent=0.5, offset=1.0, ring=ring)

    within = math.atan(between * math.tan(angle))
    profile = LinearTaper(**(SLEEVE | {"taper": taper}))
    one = Manipulator(profile=profile, section=thick, actuators=(fiber(angle, 0),))
    two = Manipulator(
        profile=profile, section=thin, actuators=(fiber(within, "inner"), fiber(angle, "outer"))
    )
    # On a cone the fibers near the axis wind a little less: there only the base is the same.
    z = [0.0] if taper else [0.0, 0.1, 0.3]
    whole, parts = tables(one, z), tables(two, z)
    np.testing.assert_allclose(
        parts.extension.sum(axis=1), whole.extension[:, 0], rtol=1e-12, atol=1e-14
    )
    summed = parts.curvature.sum(axis=2)
    np.testing.assert_allclose(summed, whole.curvature[..., 0], rtol=1e-11, atol=1e-11)


@given(arm=any_arms(), factor=st.floats(1e-3, 1e3))
def test_a_stiffer_arm_resists_forces_in_proportion_and_muscles_not_at_all(arm, factor):
    """Young's modulus scales K and what fibers pull with; tensions and pressures stay."""

    def scaled(material):
        return material and material.replace(young_modulus=factor * material.young_modulus)

    rings = tuple(ring.replace(material=scaled(ring.material)) for ring in arm.section.rings)
    stiff = arm.replace(section=arm.section.replace(rings=rings, core=scaled(arm.section.core)))
    z = np.linspace(0, arm.length, 5)
    before, after = tables(arm, z), tables(stiff, z)
    less = np.array([1.0 if unit == "1" else factor for unit in arm.bundle_units])
    np.testing.assert_allclose(after.extension * less, before.extension, rtol=1e-11)
    np.testing.assert_allclose(
        after.curvature * less, before.curvature, rtol=1e-10, atol=1e-12 / arm.length
    )


@given(section=sections(), profile=profiles())
def test_compliance_is_one_over_stiffness_all_along(section, profile):
    fiber = FiberArchitecture(helical_angle=0.0, extent=0.3)
    arm = Manipulator(profile=profile, section=section, actuators=(fiber,))
    z = np.linspace(0, profile.length, 4)
    for yields, resists in zip(
        compliance(arm, z), section.stiffness(profile.radius(z)), strict=True
    ):
        np.testing.assert_allclose(yields * resists, 1.0, rtol=1e-14)


def test_the_core_fills_what_is_between_bore_and_innermost_ring():
    ring = Ring(inner_ratio=0.6, material=RUBBER)
    solid, bored = (Section(rings=(ring,), bore_ratio=bore) for bore in (0.0, 0.6))
    tube = math.pi * RUBBER.young_modulus * (1 - 0.36)
    assert bored.stiffness(1.0).axial == pytest.approx(tube, rel=1e-14)
    assert len(bored.layers) == 1
    assert solid.stiffness(1.0).axial == pytest.approx(math.pi * RUBBER.young_modulus, rel=1e-14)


def test_a_ring_is_found_by_its_index_or_name():
    inner = Ring(inner_ratio=0.3, outer_ratio=0.6, name="inner")
    section = Section(rings=(inner, Ring(inner_ratio=0.6)))
    assert section.ring("inner") is section.ring(0) is inner
    assert [section.ring_index(which) for which in ("inner", 0, 1)] == [0, 0, 1]


@pytest.mark.parametrize("which", [-1, 2, "outer"])
def test_no_ring_is_counted_from_behind_or_beyond_the_last(which):
    section = Section(rings=(Ring(inner_ratio=0.3, outer_ratio=0.6), Ring(inner_ratio=0.6)))
    with pytest.raises(InvalidDesign, match=f"ring = .*{which}.*: must be one of .*: 0, 1"):
        section.ring_index(which)


class TestYoungsModulus:
    def arm(self, section, actuator):
        return Manipulator(profile=LinearTaper(**SLEEVE), section=section, actuators=(actuator,))

    def test_it_may_be_left_out_while_fibers_drive_one_material(self):
        section = Section(rings=(Ring(inner_ratio=0.5), Ring(inner_ratio=0.2, outer_ratio=0.4)))
        arm = self.arm(section, FiberArchitecture(helical_angle=0.1, extent=0.5))
        assert np.isfinite(tables(arm, [0.0]).curvature).all()

    def test_it_is_asked_for_by_name_where_materials_differ(self):
        soft = Material(poisson_ratio=0.3, name="soft")
        with pytest.raises(InvalidDesign) as caught:
            Section(
                rings=(Ring(inner_ratio=0.5, material=RUBBER), Ring(inner_ratio=0.5)), core=soft
            )
        assert [fault.path for fault in caught.value.faults] == [
            "core.young_modulus",
            "rings[1].material.young_modulus",
        ]
        assert "must be given in Pa where materials differ" in str(caught.value)

    def test_it_is_asked_for_by_name_where_an_activation_is_a_force(self):
        section = Section(rings=(Ring(inner_ratio=0.5),))
        tendon = Tendon(name="left", distance=0.01, activation_bounds=(0, 5))
        with pytest.raises(
            InvalidDesign,
            match=r"^rings\[0\].material.young_modulus: must be given in Pa for tendon 'left'",
        ):
            self.arm(section, tendon)

    def test_it_is_asked_for_by_name_where_loads_need_it(self):
        fiber = FiberArchitecture(helical_angle=0.1, extent=0.5)
        arm = self.arm(Section(rings=(Ring(inner_ratio=0.5),)), fiber)
        with pytest.raises(
            InvalidDesign, match=r"^rings\[0\].material.young_modulus: .* where loads act$"
        ):
            compliance(arm, [0.0])

    def test_the_density_is_asked_for_by_name_where_weight_counts(self):
        rings = (Ring(inner_ratio=0.5, material=Material(young_modulus=1e6)),)
        with pytest.raises(
            InvalidDesign, match=r"rings\[0\].material.density: .*kg/m³ where weight"
        ):
            Section(rings=rings).mass_per_length(0.1)


# Laws of the section: its stiffness is what elasticity says, and what it may be made of


def section(poisson_ratio: float = 0.5, inner_ratio: float = 0.75) -> Section:
    ring = Ring(inner_ratio=inner_ratio, material=Material(poisson_ratio=poisson_ratio))
    return Section(rings=(ring,))


@pytest.mark.parametrize("radius", [0.3, 2.0])
def test_stiffness_is_area_and_moments_of_area(radius):
    """K0/E = ∫ dA, K1/E = ∫ y² dA; the shear modulus is E / (2 (1 + ν)), and K3 = G ∫ R² dA."""

    def over_disk(f):
        return dblquad(lambda a, r: r * f(r, a), 0, radius, 0, 2 * math.pi)[0]

    found = section(poisson_ratio=0.3).stiffness(radius)
    assert found.axial == pytest.approx(over_disk(lambda r, a: 1.0))
    assert found.bending == pytest.approx(over_disk(lambda r, a: (r * math.sin(a)) ** 2))
    assert found.torsion == pytest.approx(over_disk(lambda r, a: r**2) / (2 * 1.3))


@given(st.floats(0.0, 0.5), st.floats(0.0, 0.99))
def test_the_ring_does_not_change_the_stiffness_of_one_material(poisson_ratio, inner_ratio):
    radius = np.array([0.5, 1.0])
    for one, other in zip(
        section(poisson_ratio, inner_ratio).stiffness(radius),
        section(poisson_ratio, 0.5).stiffness(radius),
        strict=True,
    ):
        np.testing.assert_array_equal(one, other)


def test_the_ratio_of_a_ring_is_that_of_its_own_radii():
    assert Ring(inner_ratio=0.4, outer_ratio=0.8).radius_ratio == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Ring(inner_ratio=0.5, outer_ratio=0.5), "must be below outer_ratio = 0.5"),
        (lambda: Ring(inner_ratio=0.5, material=0.5), "material = 0.5: must be a Material"),
        (lambda: Section(rings=()), r"section.rings = \(\): must hold one Ring"),
        (
            lambda: Section(rings=Ring(inner_ratio=0.5)),
            r"section.rings = Ring\(.*must hold one Ring",
        ),
        (
            lambda: Section(rings=(Ring(inner_ratio=0.5, outer_ratio=0.9),)),
            r"rings\[0\].outer_ratio = 0.9: must be 1",
        ),
    ],
)
def test_an_impossible_section_is_refused(call, message):
    with pytest.raises(InvalidDesign, match=message):
        call()
