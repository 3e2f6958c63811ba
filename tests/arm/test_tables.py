"""Laws of the tables: the paper's equations of extension and curvature, and their ranges."""

from __future__ import annotations

import cmath
import itertools
import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.arm import designs
from softreach.arm.actuators.ring_integrals import ring_integrals
from softreach.arm.tables import check_extension, extension_range, tables
from softreach.support.errors import InvalidDesign
from tests.laws import arms, in_box, single


@given(arm=arms())
def test_the_map_is_the_papers_equations_of_extension_and_curvature(arm):
    """Section 2: a0, a1, b1 summed over bundles, with δ from the integrals."""
    z = np.linspace(0, arm.length, 5)
    gamma = in_box(arm, 1)[0]
    table = tables(arm, z)
    radius, ring = arm.profile.radius(z), arm.section.rings[0]
    nu = ring.material.poisson_ratio
    zeta, u = np.ones(5), np.zeros((5, 3))
    bundle = iter(gamma)
    for fiber in arm.fibers:
        alpha = fiber.helical_angle_on(arm.profile, arm.section)
        i0, i1, i3 = ring_integrals(ring.inner_ratio, arm.profile.taper, alpha, nu)
        d0, d1, d3 = 4 * radius**2 * i0, 6 * radius**3 * i1, 6 * radius**3 * i3
        turn = math.tan(alpha) * arm.profile.surface_coordinate(z)
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
            u[:, 2] += 2 * (1 + nu) / (3 * radius**4) * d3 * a0
    np.testing.assert_allclose(1 + table.extension @ gamma, zeta, rtol=1e-12)
    np.testing.assert_allclose(table.curvature @ gamma, u, rtol=1e-9, atol=1e-11 / arm.length)


@given(arm=arms())
def test_the_range_of_extension_holds_every_sample(arm):
    corners = np.array(list(itertools.islice(itertools.product(*arm.bounds), 1024)))
    gamma = np.concatenate([in_box(arm, 200), corners])
    table = tables(arm, np.linspace(0.0, arm.length, 101))
    zeta = 1 + gamma @ table.extension.T
    low, high = extension_range(arm)
    assert low - 1e-12 <= zeta.min()
    assert zeta.max() <= high + 1e-12


def test_curvature_grows_as_the_arm_thins():
    z = np.array([0.0, 1.0])
    arm = designs.minimal_trunk(taper=math.radians(3))
    table = tables(arm, z)
    size = np.linalg.norm(table.curvature[:, :, 2], axis=1)
    assert size[1] / size[0] == pytest.approx(np.divide(*arm.profile.radius(z)), rel=1e-12)


def test_contraction_shortens():
    table = tables(single(), [0.0])
    assert table.extension[0, 0] > 0


def test_an_arm_that_an_activation_would_shorten_to_nothing_is_refused(trunk):
    with pytest.raises(InvalidDesign, match=r"reaches extension ζ = -0.5\d+; must keep ζ > 0"):
        check_extension(trunk.with_bounds((-9.0, 0.0)))
    with pytest.raises(InvalidDesign, match="extension"):
        check_extension(trunk.split("longitudinal", 98))


@given(arm=arms())
def test_stations_do_not_see_each_other(arm):
    z = np.linspace(0, arm.length, 5)
    whole, alone = tables(arm, z), tables(arm, z[3])
    np.testing.assert_array_equal(whole.extension[3], alone.extension[0])
    np.testing.assert_array_equal(whole.curvature[3], alone.curvature[0])


# Laws of the ring integrals: the closed forms of Appendix A, their limits, symmetries


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
    axial, bending, torsion = ring_integrals(rho, phi, alpha, nu)
    # The printed arctangents may cross their branch cut, which adds to the imaginary part alone.
    expected = [d0, d1, d3.real]
    np.testing.assert_allclose(
        [4 * axial, 6 * bending, 6 * torsion], expected, rtol=1e-9, atol=1e-10
    )


def test_a_longitudinal_fiber_in_a_full_cylinder_has_elementary_integrals():
    axial, bending, torsion = ring_integrals(0.0, 0.0, 0.0, 0.3)
    np.testing.assert_allclose([axial, bending, torsion], [1 / 2, 1 / 3, 0], rtol=1e-14)


@given(alpha=st.floats(0, 1.4), phi=st.floats(-0.5, 0.5))
def test_torsion_is_odd_and_the_rest_even_in_the_helical_angle(alpha, phi):
    plus, minus = (ring_integrals(0.7, phi, sign * alpha, 0.5) for sign in (1, -1))
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
    np.testing.assert_allclose(ring_integrals(rho, phi, alpha, nu)[:2], exact, atol=2e-13)


def by_adaptive_quadrature(rho, phi, alpha, nu):
    """I0, I1, I3 in v = log x, decade by decade: what is near the axis gets as many nodes."""
    from scipy.integrate import quad

    cp, ca = math.tan(phi), math.tan(alpha)

    def k(x):
        return 1 / ((1 + (cp * x) ** 2) * (1 + (ca * x) ** 2))

    def t(x):
        return ca * x / ((1 + (ca * x) ** 2) * math.sqrt(1 + (cp * x) ** 2))

    ends = np.log([max(rho, 1e-17), *(10.0**e for e in range(-16, 0) if 10.0**e > rho), 1.0])

    def over(f):
        pieces = (
            quad(lambda v: math.exp(v) * f(math.exp(v)), a, b, epsabs=0, epsrel=1e-13)[0]
            for a, b in itertools.pairwise(ends)
        )
        return math.fsum(pieces)

    axial = (1 + nu) * over(lambda x: x * k(x)) - nu * (1 - rho**2) / 2
    bending = (1 + nu) * over(lambda x: x**2 * k(x)) - nu * (1 - rho**3) / 3
    return [axial, bending, over(lambda x: x**2 * t(x))]


@pytest.mark.parametrize("rho", [0.0, 0.01, 0.049, 0.051, 0.5])
@pytest.mark.parametrize("nu", [0.0, 0.5])
@pytest.mark.parametrize("to_circumferential", [0.1, 0.05, 0.01, 1e-3, 1e-6, 1e-8])
def test_fibers_that_nearly_wind_around_the_axis_keep_all_digits(rho, nu, to_circumferential):
    alpha = math.pi / 2 - to_circumferential
    for phi in (0.0, 0.5):
        found = ring_integrals(rho, phi, alpha, nu)
        np.testing.assert_allclose(found, by_adaptive_quadrature(rho, phi, alpha, nu), rtol=1e-12)


def test_steep_and_shallow_fibers_in_one_array_do_not_see_each_other():
    alpha = np.array([-1.57, 0.0, 0.4, 1.5, 1.57])
    together = ring_integrals(0.0, 0.05, alpha, 0.5)
    alone = [ring_integrals(0.0, 0.05, one, 0.5) for one in alpha]
    np.testing.assert_array_equal(together, np.transpose(alone))
