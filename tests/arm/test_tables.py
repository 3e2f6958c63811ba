"""Laws of the actuation map: the closed forms of Appendix A, their limits, symmetries."""

from __future__ import annotations

import cmath
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from softreach.cross_section import section_integrals

from softreach import designs, taper
from softreach.arm.tables import actuation, curvature_range, extension_range
from tests.laws import arms, in_box, single


def closed_forms(rho, phi, alpha, nu):
    """δ0, δ1, δ3 of Appendix A at R2 = 1, δ3 without its misprint (the 3 multiplies T alone)."""
    cp, ca = math.tan(phi), math.tan(alpha)
    square = cp**2 - ca**2
    ratio = (1 + rho**2 * cp**2) * (1 + ca**2) / ((1 + cp**2) * (1 + rho**2 * ca**2))
    d0 = 2 * (rho**2 - 1) * nu - 2 * (1 + nu) / square * math.log(ratio)
    tans = (math.atan(rho * cp) - math.atan(cp)) * ca
    rest = 3 * (1 + nu) * (math.atan(rho * ca) - math.atan(ca)) + (rho**3 - 1) * nu * ca**3
    d1 = 2 / (cp * ca * square) * (3 * (1 + nu) * tans + (rho**3 - 1) * nu * cp**3 * ca - cp * rest)

    def s(r):
        return cmath.sqrt(square * (1 + cp**2 * r**2))

    def t(r):
        return cmath.atan((ca + 1j * cp**2 * r) / s(r))

    bracket = 3 * cp**2 * (t(-rho) + t(rho) - t(-1) - t(1)) + 6 * ca * (s(1) - s(rho))
    d3 = bracket / (cp**2 * ca**2 * cmath.sqrt(square))
    return d0, d1, d3


@given(
    rho=st.floats(0, 0.95),
    phi=st.floats(0.02, 0.5),
    alpha=st.floats(0.6, 1.3),
    nu=st.floats(0, 0.5),
)
def test_the_integrals_are_the_papers_functions(rho, phi, alpha, nu):
    d0, d1, d3 = closed_forms(rho, phi, alpha, nu)
    axial, bending, torsion = section_integrals(rho, phi, alpha, nu)
    # The printed arctangents may cross their branch cut, which adds to the imaginary part alone.
    expected = [d0, d1, d3.real]
    np.testing.assert_allclose(
        [4 * axial, 6 * bending, 6 * torsion], expected, rtol=1e-9, atol=1e-10
    )


def test_a_longitudinal_fiber_in_a_full_cylinder_has_elementary_integrals():
    axial, bending, torsion = section_integrals(0.0, 0.0, 0.0, 0.3)
    np.testing.assert_allclose([axial, bending, torsion], [1 / 2, 1 / 3, 0], rtol=1e-14)


@given(alpha=st.floats(0, 1.4), phi=st.floats(-0.5, 0.5))
def test_torsion_is_odd_and_the_rest_even_in_the_helical_angle(alpha, phi):
    plus, minus = (section_integrals(0.7, phi, sign * alpha, 0.5) for sign in (1, -1))
    np.testing.assert_array_equal(plus.axial, minus.axial)
    np.testing.assert_array_equal(plus.bending, minus.bending)
    np.testing.assert_array_equal(plus.torsion, -minus.torsion)


@pytest.mark.parametrize("alpha_deg", [0, 45, 80, 88])
@pytest.mark.parametrize("rho", [0.01, 0.5, 0.99])
def test_quadrature_is_converged_to_rounding(rho, alpha_deg):
    from scipy.integrate import quad

    alpha, phi, nu = math.radians(alpha_deg), 0.1, 0.5

    def k(x):
        cone, helix = 1 + (x * math.tan(phi)) ** 2, 1 + (x * math.tan(alpha)) ** 2
        return (1 + nu) / (cone * helix) - nu

    exact = [quad(lambda x, p=p: x**p * k(x), rho, 1, epsabs=1e-14, limit=200)[0] for p in (1, 2)]
    np.testing.assert_allclose(section_integrals(rho, phi, alpha, nu)[:2], exact, atol=2e-13)


@given(arm=arms())
def test_the_map_is_the_papers_equations_of_extension_and_curvature(arm):
    """Section 2: a0, a1, b1 summed over bundles, with δ from the integrals."""
    z = np.linspace(0, arm.length, 5)
    gamma = in_box(arm, 1)[0]
    table = actuation(arm, z)
    radius = arm.radius(z)
    zeta, u = np.ones(5), np.zeros((5, 3))
    bundle = iter(gamma)
    for fiber, alpha in zip(arm.fibers, arm.helical_angles, strict=True):
        i0, i1, i3 = section_integrals(arm.radius_ratio, arm.taper, alpha, arm.poisson_ratio)
        d0, d1, d3 = 4 * radius**2 * i0, 6 * radius**3 * i1, 6 * radius**3 * i3
        turn = math.tan(alpha) * taper.rotation_per_tangent(z, arm.outer_radius, arm.taper)
        for j in range(fiber.bundles):
            g = next(bundle)
            theta = fiber.offset + 2 * math.pi * j / fiber.bundles
            a0 = fiber.extent / math.pi * g
            chord = 2 * math.sin(fiber.extent / 2) / math.pi * g
            a1, b1 = chord * math.cos(theta), chord * math.sin(theta)
            size, phase = np.hypot(a1, b1), -np.arctan2(b1, a1)
            zeta += d0 * a0 / (4 * radius**2)
            u[:, 0] += -2 / (3 * radius**4) * d1 * size * np.sin(phase - turn)
            u[:, 1] += -2 / (3 * radius**4) * d1 * size * np.cos(phase - turn)
            u[:, 2] += 2 * (1 + arm.poisson_ratio) / (3 * radius**4) * d3 * a0
    np.testing.assert_allclose(1 + table.extension @ gamma, zeta, rtol=1e-12)
    np.testing.assert_allclose(table.curvature @ gamma, u, rtol=1e-9, atol=1e-11 / arm.length)


@given(arm=arms())
def test_the_slender_coordinate_and_its_inverse_undo_each_other(arm):
    z = np.linspace(0, arm.length, 7)
    s = taper.slender_coordinate(z, arm.outer_radius, arm.taper)
    back = taper.station_of(s, arm.outer_radius, arm.taper)
    np.testing.assert_allclose(back, z, atol=1e-13 * arm.length)


@pytest.mark.parametrize("taper_deg", [-2, 1e-12, 1, 3])
def test_rotation_of_a_fiber_is_the_integral_of_appendix_b(taper_deg):
    from scipy.integrate import quad

    phi, radius = math.radians(taper_deg), 1 / 16
    slope = math.sqrt(1 + math.tan(phi) ** 2)
    expected = quad(lambda z: slope / (radius - z * math.tan(phi)), 0, 1, epsabs=1e-12)[0]
    np.testing.assert_allclose(taper.rotation_per_tangent(1.0, radius, phi), expected, rtol=1e-12)


def test_the_untapered_rotation_is_z_over_radius():
    assert taper.rotation_per_tangent(0.7, 1 / 16, 0.0) == pytest.approx(0.7 * 16, rel=1e-15)


@given(arm=arms())
def test_ranges_hold_every_sample_and_are_reached(arm):
    corners = np.array(list(itertools.islice(itertools.product(*arm.bounds), 1024)))
    gamma = np.concatenate([in_box(arm, 200), corners])
    stations, bending = curvature_range(arm, stations=5)
    table = actuation(arm, stations)
    zeta = 1 + gamma @ table.extension.T
    low, high = extension_range(arm)
    assert low - 1e-12 <= zeta.min()
    assert zeta.max() <= high + 1e-12
    kappa = np.linalg.norm(np.einsum("scf,nf->nsc", table.curvature[:, :2], gamma), axis=-1)
    assert (kappa <= bending * (1 + 1e-5) + 1e-12).all()
    np.testing.assert_allclose(kappa.max(axis=0), bending, rtol=1e-5, atol=1e-12)


def test_curvature_grows_as_the_arm_thins():
    z = np.array([0.0, 1.0])
    arm = designs.minimal_trunk(taper=math.radians(3))
    table = actuation(arm, z)
    size = np.linalg.norm(table.curvature[:, :, 2], axis=1)
    assert size[1] / size[0] == pytest.approx(arm.outer_radius / arm.tip_radius, rel=1e-12)


def test_contraction_shortens():
    table = actuation(single(), [0.0])
    assert table.extension[0, 0] > 0
