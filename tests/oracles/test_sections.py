"""The section's quadrature against closed forms."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from tests.oracles import column
from tests.oracles.chain import Chain
from tests.oracles.loaded_rod import equilibrium
from tests.oracles.rod import Loads, PointLoad, Rod
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


@pytest.mark.parametrize("helical_angle", [0.0, -1.2])
@pytest.mark.parametrize("slope", [0.0, 0.4])
def test_fibers_pull_by_the_radial_integrals_of_the_theory(helical_angle, slope):
    """N and M of theory (4), with the integrals (1) to (3) by adaptive quadrature."""
    nu, (start, stop) = RING.poisson_ratio, SECTOR
    tan_alpha, ratio = math.tan(helical_angle), RING.inner / RING.outer

    def k(x):
        return (1 + nu) / ((1 + (x * slope) ** 2) * (1 + (x * tan_alpha) ** 2)) - nu

    def t(x):
        return x * tan_alpha / ((1 + (x * tan_alpha) ** 2) * math.sqrt(1 + (x * slope) ** 2))

    parts = (lambda x: x * k(x), lambda x: x**2 * k(x), lambda x: x**2 * t(x))
    i0, i1, i3 = (quad(part, ratio, 1, epsabs=1e-14)[0] for part in parts)
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
    wanted = [area, 0, -area * place, 0]
    np.testing.assert_allclose([force, *moment], wanted, rtol=1e-13, atol=1e-20)


def test_the_least_energy_is_where_force_and_moment_are_borne_by_the_stiffness():
    layers = [CORE, RING, RING]
    drive = Drive(layer=RING, sector=SECTOR, direction=fiber(RING, 0.5, -0.03))
    load, resists = active_load(drive), stiffness(layers)
    expected = np.array([load.force, *load.moment]) / resists[:4]
    np.testing.assert_allclose(least_energy_strains(layers, drive), expected, rtol=1e-12)


# The chain of links against the rod it approximates, and the sign of its Hessian


ROD = Rod(
    length=1.0,
    axial=lambda z: 60.0,
    bending=lambda z: (1 - 0.3 * z) ** 4,
    torsion=lambda z: 0.7 * (1 - 0.3 * z) ** 4,
    mass=lambda z: (1 - 0.3 * z) ** 2,
    stretch=lambda z: 0.9 + 0.1 * z,
    curvature=lambda z: (math.cos(3 * z), math.sin(3 * z), 0.5),
)
LOADS = Loads(
    gravity=(1.0, -0.5, -2.0),
    payload=0.3,
    lever=(0.05, 0.02, 0.1),
    tip_force=(0.1, 0.3, 0.2),
    points=(PointLoad(place=0.37, force=(0.4, -0.2, 0.1)),),
    force_per_length=lambda z: (0.2 * z, 0.0, 0.1),
)
STIFF = {"axial": lambda z: 1e9, "bending": lambda z: 1.0, "torsion": lambda z: 0.7}
COLUMN = Rod(length=1.0, mass=lambda z: 1.0, **STIFF)


def upright(load, links=30):
    """The chain of a straight column under its weight, and its straight coordinates."""
    chain = Chain(COLUMN, Loads(gravity=(0.0, 0.0, -load)), links)
    return chain, chain.solve(chain.rest())


def test_gradient_and_hessian_are_the_derivatives_of_the_energy():
    chain = Chain(ROD, LOADS, 6)
    q = chain.rest() + 0.05 * np.random.default_rng(3).normal(size=4 * 6 + 3)
    steps = 1e-5 * np.eye(len(q))
    slopes = [(chain.energy(q + s) - chain.energy(q - s)) / 2e-5 for s in steps]
    np.testing.assert_allclose(chain.gradient(q), slopes, atol=1e-8)
    slopes = [(chain.gradient(q + s) - chain.gradient(q - s)) / 2e-5 for s in steps]
    np.testing.assert_allclose(chain.hessian(q), slopes, atol=1e-7)


def test_the_chain_tends_to_the_rod_with_the_square_of_its_links():
    tip = equilibrium(ROD, LOADS).tip
    chains = [Chain(ROD, LOADS, links) for links in (12, 24)]
    error = [np.linalg.norm(chain.nodes(chain.solve())[-1] - tip) for chain in chains]
    assert error[1] < 1e-3
    assert error[0] / error[1] == pytest.approx(4, rel=0.1)


def test_the_upright_column_falls_above_greenhills_load_to_any_side():
    chain, straight = upright(0.99 * column.greenhill())
    assert chain.softest(straight)[0] > 0
    chain, straight = upright(1.01 * column.greenhill())
    space, plane = chain.softest(straight), chain.softest(straight, planar=True)
    assert (space[:3] < 0).tolist() == [True, True, False]
    assert (plane[:2] < 0).tolist() == [True, False]


def test_the_fallen_column_is_stable_where_the_upright_one_is_not():
    load = 1.5 * column.greenhill()
    chain, straight = upright(load, links=12)
    lean = replace(COLUMN, curvature=lambda z: (0.0, 0.05, 0.0))
    start = Chain(lean, chain.loads, 12)
    fallen = chain.solve(start.solve())
    assert np.linalg.norm(chain.nodes(fallen)[-1] - chain.nodes(straight)[-1]) > 0.5
    assert chain.energy(fallen) < chain.energy(straight)
    # it may still turn about the vertical, which costs nothing
    np.testing.assert_allclose(chain.softest(fallen)[0], 0, atol=1e-6)
    assert chain.softest(fallen)[1] > 1e-3


def test_a_hanging_arm_is_stable_under_any_load():
    chain = Chain(COLUMN, Loads(gravity=(0.0, 0.0, 50.0)), 20)
    assert chain.softest(chain.solve(chain.rest()))[0] > 0


@pytest.mark.parametrize(
    "change",
    [{"tip_moment": (1, 0, 0)}, {"following_force": (1, 0, 0)}, {"following_moment": (0, 1, 0)}],
)
def test_loads_without_a_potential_are_refused(change):
    with pytest.raises(ValueError, match="no potential"):
        Chain(ROD, replace(LOADS, **change))
