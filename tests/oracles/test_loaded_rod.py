"""The shooting of loaded rods against closed forms, published numbers and other programs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.oracles import bend, column, elastica, sorosim
from tests.oracles.loaded_rod import equilibrium
from tests.oracles.rod import Loads, PointLoad, Rod

HORIZONTAL = ((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0))
ROD = Rod(
    length=1.0, axial=lambda z: 40.0, bending=lambda z: 1.0, torsion=lambda z: 0.7, base=HORIZONTAL
)
WOUND = replace(
    ROD,
    bending=lambda z: (1 - 0.3 * z) ** 4,
    stretch=lambda z: 0.9 + 0.1 * z,
    curvature=lambda z: (math.cos(3 * z), math.sin(3 * z), 0.5),
    mass=lambda z: 1 - 0.3 * z,
)


def test_without_loads_the_rod_has_the_shape_it_was_given():
    """Constant û and ζ̂ wind it on a helix, here an arc."""
    arc = replace(ROD, stretch=lambda z: 0.8, curvature=lambda z: (0.0, 2.0, 0.0))
    found = equilibrium(arc, Loads())
    turn = 0.8 * 2.0
    expected = [math.sin(turn) / 2, 0.0, -(1 - math.cos(turn)) / 2]
    np.testing.assert_allclose(found.tip, expected, atol=1e-12)
    np.testing.assert_array_equal(found.base_moment, 0)


def test_a_hanging_rod_stretches_by_the_weight_beyond_each_section():
    hanging = replace(
        ROD, mass=lambda z: 1.5, base=((1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 0.0, -1.0))
    )
    found = equilibrium(hanging, Loads(gravity=(0, 0, -10.0), payload=0.4))
    np.testing.assert_allclose(found.tip, [0, 0, -(1 + (7.5 + 4.0) / 40.0)], atol=1e-12)


def test_a_tip_moment_bends_to_an_arc_or_twists():
    found = equilibrium(ROD, Loads(tip_moment=(0.0, -2.0, 0.0)))
    np.testing.assert_allclose(found.tip, [math.sin(2) / 2, 0, (1 - math.cos(2)) / 2], atol=1e-11)
    found = equilibrium(ROD, Loads(tip_moment=(0.3, 0.0, 0.0)))
    assert math.acos(found.frame[-1, 1, 1]) == pytest.approx(0.3 / 0.7, rel=1e-10)


def test_a_following_force_is_the_dead_one_that_it_has_become():
    followed = equilibrium(
        WOUND, Loads(following_force=(0.6, -0.4, -1.0), following_moment=(0.2, 0.1, -0.3))
    )
    force, moment = (np.array(v) @ followed.frame[-1] for v in ((0.6, -0.4, -1), (0.2, 0.1, -0.3)))
    dead = equilibrium(WOUND, Loads(tip_force=tuple(force), tip_moment=tuple(moment)))
    assert followed.converged
    np.testing.assert_allclose(dead.tip, followed.tip, atol=1e-9)
    np.testing.assert_allclose(dead.base_moment, followed.base_moment, atol=1e-9)


def test_a_payload_is_a_force_and_the_moment_of_its_lever():
    loads = Loads(gravity=(0.5, -1.0, -3.0), payload=0.3, lever=(0.05, 0.02, 0.1))
    found = equilibrium(WOUND, loads)
    weight = 0.3 * np.array(loads.gravity)
    moment = np.cross(np.array(loads.lever) @ found.frame[-1], weight)
    other = replace(loads, payload=0.0, tip_force=tuple(weight), tip_moment=tuple(moment))
    np.testing.assert_allclose(equilibrium(WOUND, other).tip, found.tip, atol=1e-9)
    np.testing.assert_allclose(found.moment[-1], moment, atol=1e-9)


def test_a_force_per_length_is_the_limit_of_many_forces_on_points():
    spread = Loads(force_per_length=lambda z: (0.0, 1.0, -1.0))
    places = (np.arange(8) + 0.5) / 8
    many = tuple(PointLoad(place=float(z), force=(0.0, 0.125, -0.125)) for z in places)
    smooth, rough = (equilibrium(WOUND, loads).tip for loads in (spread, Loads(points=many)))
    assert 1e-5 < np.linalg.norm(smooth - rough) < 1e-3


def test_the_moment_at_the_base_is_that_of_all_loads():
    """The balance of the whole arm, which the shooting does not impose."""
    points = (PointLoad(place=0.4, force=(0.2, 0.3, 0.5), moment=(0.1, 0.0, -0.2)),)
    loads = Loads(
        gravity=(0, -1.0, -2.0), points=points, tip_force=(0.1, 0, 0.4), tip_moment=(0, 0.2, 0)
    )
    half, weights = np.polynomial.legendre.leggauss(16)
    z = np.concatenate([0.2 + 0.2 * half, [0.4], 0.7 + 0.3 * half, [1.0]])
    found = equilibrium(WOUND, loads, z)
    mass = np.array([WOUND.mass(s) for s in z]) * [*(0.2 * weights), 0, *(0.3 * weights), 0]
    expected = mass @ np.cross(found.place, loads.gravity)
    expected += np.cross(found.place[16], points[0].force) + points[0].moment
    expected += np.cross(found.place[-1], loads.tip_force) + loads.tip_moment
    np.testing.assert_allclose(found.base_moment, expected, atol=1e-10)


def test_every_twentieth_of_sorosims_equilibria_is_found():
    assert max(sorosim.deviation(case) for case in sorosim.cases()[::20]) < 0.65e-3


# Cantilevers and columns: the closed forms, their published values, and each other


STIFF = replace(ROD, axial=lambda z: 1e12, mass=lambda z: 1.0)


@pytest.mark.parametrize(
    ("load", "deflection", "along"), [(1, 0.30172077, 0.94356676), (10, 0.81060902, 0.44500440)]
)
def test_a_tip_force_bends_the_elastica_to_its_published_place(load, deflection, along):
    np.testing.assert_allclose(elastica.tip_loaded(load), [deflection, along], atol=6e-9)


@pytest.mark.parametrize(
    ("load", "along", "drop"), [(1, 0.99124640, 0.12347140), (50, 0.24501476, 0.90791712)]
)
def test_the_heavy_cantilever_drops_to_its_published_place(load, along, drop):
    np.testing.assert_allclose(elastica.heavy(load), [drop, along], atol=6e-9)


def test_the_elastica_has_the_limits_of_small_loads_of_small_moments_and_of_an_arc():
    assert elastica.tip_loaded(1e-4)[0] == pytest.approx(1e-4 / 3, rel=1e-6)
    assert elastica.heavy(1e-4)[0] == pytest.approx(1e-4 / 8, rel=1e-6)
    near, far = (np.array(elastica.tip_loaded_with_moment(1.0, m)) for m in (0.02, 0.04))
    np.testing.assert_allclose(2 * near - far, elastica.tip_loaded(1.0), atol=2e-4)
    arc = np.array([1 - np.cos(1.2), np.sin(1.2)]) / 1.2
    np.testing.assert_allclose(elastica.tip_loaded_with_moment(0.0, 1.2), arc, atol=1e-12)


@pytest.mark.parametrize("load", [0.5, 6.0])
def test_the_shooting_in_space_agrees_with_both(load):
    pulled = equilibrium(STIFF, Loads(tip_force=(0, 0, -load))).tip
    np.testing.assert_allclose([-pulled[2], pulled[0]], elastica.tip_loaded(load), atol=1e-10)
    fallen = equilibrium(STIFF, Loads(gravity=(0, 0, -load))).tip
    np.testing.assert_allclose([-fallen[2], fallen[0]], elastica.heavy(load), atol=1e-10)


def test_the_bend_of_45_degrees_goes_to_its_inextensible_place_and_stretches_from_there():
    np.testing.assert_allclose(equilibrium(*bend.bend()).tip, bend.TIP, atol=1e-6)
    moved = equilibrium(*bend.bend(axial=1e7)).tip - bend.TIP
    assert 1e-3 < np.linalg.norm(moved) < 1e-2


def test_ritz_s_method_gives_the_closed_forms_of_the_uniform_column_and_the_cone():
    assert column.greenhill() == pytest.approx(7.83734744, abs=5e-9)  # as published
    uniform = column.buckling_gravity(2.0, lambda z: 3.0, lambda z: 0.5)
    assert uniform * 0.5 * 2.0**3 / 3.0 == pytest.approx(column.greenhill(), rel=1e-10)
    tapered = column.buckling_gravity(1.0, lambda z: (1 - z) ** 4, lambda z: (1 - z) ** 2)
    assert tapered == pytest.approx(column.cone(), rel=1e-6)


def test_a_heavy_payload_buckles_the_column_at_eulers_load():
    gravity = column.buckling_gravity(1.0, lambda z: 1.0, lambda z: 0.0, payload=2.0)
    assert gravity == pytest.approx(np.pi**2 / 4 / 2, rel=1e-10)


def test_the_helix_of_a_force_and_a_moment_balances():
    helix = elastica.Helix(1.5, 1.0, 2.0, bending=1.0, twisting=0.7, axial=30.0)
    force = tuple(helix.force.tolist())
    loads = Loads(tip_force=force, tip_moment=tuple(helix.moment(0.8).tolist()))
    upright = Rod(length=0.8, axial=lambda z: 30.0, bending=lambda z: 1.0, torsion=lambda z: 0.7)
    found = equilibrium(upright, loads)
    np.testing.assert_allclose(found.tip, helix.place(0.8), atol=1e-10)
    np.testing.assert_allclose(found.base_moment, helix.base_moment, atol=1e-10)
