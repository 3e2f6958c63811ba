"""Laws of the section: its stiffness is what elasticity says, and what it may be made of."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import dblquad

from softreach.arm import Material, Ring, Section
from softreach.support.errors import InvalidDesign


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
