"""The section's quadrature against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import quad

from tests.oracles.sections import (
    Drive,
    Layer,
    active_load,
    disc,
    fiber,
    least_energy_strains,
    pressure_load,
    radial,
    ring_sector,
    stiffness,
)

RING = Layer(inner=0.03, outer=0.05, young_modulus=2e6, poisson_ratio=0.4, density=1100.0)
CORE = Layer(outer=0.03, young_modulus=5e5, poisson_ratio=0.3, density=900.0)
SECTOR = (0.4, 1.7)


def along(x, y):
    return np.stack([0 * x, 0 * x, 1 + 0 * x])


def test_a_core_and_a_ring_resist_as_their_polynomials():
    resists = stiffness([CORE, RING])
    disc2, ring2 = 0.03**2, 0.05**2 - 0.03**2
    disc4, ring4 = 0.03**4, 0.05**4 - 0.03**4
    k1 = np.pi / 4 * (5e5 * disc4 + 2e6 * ring4)
    k3 = np.pi / 4 * (5e5 / 1.3 * disc4 + 2e6 / 1.4 * ring4)
    expected = [np.pi * (5e5 * disc2 + 2e6 * ring2), k1, k1, k3]
    mass = np.pi * (900 * disc2 + 1100 * ring2)
    np.testing.assert_allclose(resists, [*expected, mass], rtol=1e-13)


def test_three_overlapping_rings_are_the_laboratory_s_arm():
    outer = 0.09 / 20
    ring = Layer(
        inner=outer * 5 / 6, outer=outer, young_modulus=1.4e6 * 48 / 360, poisson_ratio=0.495
    )
    core = Layer(outer=outer * 5 / 6, young_modulus=0.1278e6, poisson_ratio=0.5)
    resists = stiffness([core, ring, ring, ring])
    np.testing.assert_allclose(
        [resists.axial, resists.bending_1, resists.torsion],
        [16.53165, 1.132275e-4, 7.569322e-5],
        rtol=5e-7,
    )


def test_a_straight_muscle_pulls_with_the_modulus_times_its_area_moments():
    force, moment = active_load(Drive(layer=RING, sector=SECTOR, direction=along))
    area = (0.05**2 - 0.03**2) / 2 * (SECTOR[1] - SECTOR[0])
    cubic = (0.05**3 - 0.03**3) / 3
    expected = [
        cubic * (math.cos(SECTOR[0]) - math.cos(SECTOR[1])),
        -cubic * (math.sin(SECTOR[1]) - math.sin(SECTOR[0])),
        0.0,
    ]
    np.testing.assert_allclose(force, 2e6 * area, rtol=1e-13)
    np.testing.assert_allclose(moment, 2e6 * np.array(expected), rtol=1e-13, atol=1e-13)


@pytest.mark.parametrize("helical_angle", [0.0, 0.3, -1.2])
@pytest.mark.parametrize("slope", [0.0, -0.05, 0.4])
def test_fibers_pull_by_the_radial_integrals_of_the_theory(helical_angle, slope):
    """N and M of theory (4), with the integrals (1) to (3) by adaptive quadrature."""
    nu, (start, stop) = RING.poisson_ratio, SECTOR
    tan_alpha, ratio = math.tan(helical_angle), RING.inner / RING.outer

    def k(x):
        return (1 + nu) / ((1 + (x * slope) ** 2) * (1 + (x * tan_alpha) ** 2)) - nu

    def t(x):
        return x * tan_alpha / ((1 + (x * tan_alpha) ** 2) * math.sqrt(1 + (x * slope) ** 2))

    i0, i1, i3 = (
        quad(f, ratio, 1, epsabs=1e-14)[0]
        for f in (lambda x: x * k(x), lambda x: x**2 * k(x), lambda x: x**2 * t(x))
    )
    bend = 2e6 * 0.05**3 * i1
    expected = [
        bend * (math.cos(start) - math.cos(stop)),
        -bend * (math.sin(stop) - math.sin(start)),
        2e6 * 0.05**3 * i3 * (stop - start),
    ]
    drive = Drive(layer=RING, sector=SECTOR, direction=fiber(RING, helical_angle, slope))
    force, moment = active_load(drive)
    assert force == pytest.approx(2e6 * 0.05**2 * i0 * (stop - start), rel=1e-11)
    np.testing.assert_allclose(moment, expected, rtol=1e-11, atol=1e-11)


def test_a_radial_muscle_pushes_by_its_girth_and_does_not_twist():
    force, moment = active_load(Drive(layer=RING, sector=SECTOR, direction=radial))
    girth = 0.4 * (0.03**2 - 0.05**2) / 2
    assert force == pytest.approx(2e6 * girth * (SECTOR[1] - SECTOR[0]), rel=1e-13)
    assert abs(moment[2]) < 1e-12 * abs(moment[0])


def test_a_pressure_acts_on_the_lumen_s_area_at_its_centroid():
    force, moment = pressure_load(disc((0.02, -0.01), 0.004))
    area = np.pi * 0.004**2
    np.testing.assert_allclose([force, *moment], area * np.array([1, -0.01, -0.02, 0]), rtol=1e-13)


def test_a_lumen_in_a_sector_has_the_centroid_of_the_sector():
    force, moment = pressure_load(ring_sector(0.02, 0.03, -0.5, 0.5))
    area = (0.03**2 - 0.02**2) / 2
    place = 2 * math.sin(0.5) * (0.03**3 - 0.02**3) / 3 / area
    np.testing.assert_allclose(
        [force, *moment], [area, 0, -area * place, 0], rtol=1e-13, atol=1e-20
    )


def test_the_least_energy_is_where_force_and_moment_are_borne_by_the_stiffness():
    layers = [CORE, RING, RING]
    drive = Drive(layer=RING, sector=SECTOR, direction=fiber(RING, 0.5, -0.03))
    load, resists = active_load(drive), stiffness(layers)
    expected = np.array([load.force, *load.moment]) / resists[:4]
    np.testing.assert_allclose(least_energy_strains(layers, drive), expected, rtol=1e-12)
