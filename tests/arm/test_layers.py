"""Laws of layered sections: stiffness by quadrature, and layers that make no difference."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.arm import (
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    Ring,
    Section,
)
from softreach.arm.tables import compliance, tables
from softreach.support.errors import InvalidDesign
from tests.kinds import layers_at, profiles, sections
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


@given(section=sections(), profile=profiles())
def test_compliance_is_one_over_stiffness_all_along(section, profile):
    fiber = FiberArchitecture(helical_angle=0.0, extent=0.3)
    arm = Manipulator(profile=profile, section=section, actuators=(fiber,))
    z = np.linspace(0, profile.length, 4)
    axial, yields = compliance(arm, z)
    stretched, bent, twisted = section.stiffness(profile.radius(z))
    np.testing.assert_allclose(axial * stretched, 1.0, rtol=1e-14)
    np.testing.assert_allclose(yields.T * [bent, bent, twisted], 1.0, rtol=1e-14)


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


# Laws of the section: its stiffness is what elasticity says, and what it may be made of


def section(poisson_ratio: float = 0.5, inner_ratio: float = 0.75) -> Section:
    ring = Ring(inner_ratio=inner_ratio, material=Material(poisson_ratio=poisson_ratio))
    return Section(rings=(ring,))


def test_the_ratio_of_a_ring_is_that_of_its_own_radii():
    assert Ring(inner_ratio=0.4, outer_ratio=0.8).radius_ratio == pytest.approx(0.5)
