"""Cantilevers and columns: the closed forms, their published values, and each other."""

from __future__ import annotations

import numpy as np
import pytest

from tests.oracles import bend, column, elastica
from tests.oracles.loaded_rod import equilibrium
from tests.oracles.rod import Loads, Rod

STIFF = Rod(
    length=1.0,
    axial=lambda z: 1e12,
    bending=lambda z: 1.0,
    torsion=lambda z: 1.0,
    mass=lambda z: 1.0,
    base=((0.0, 0.0, -1.0), (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
)


@pytest.mark.parametrize(
    ("load", "deflection", "along"), [(1, 0.30172077, 0.94356676), (10, 0.81060902, 0.44500440)]
)
def test_a_tip_force_bends_the_elastica_to_its_published_place(load, deflection, along):
    np.testing.assert_allclose(elastica.tip_loaded(load), [deflection, along], atol=6e-9)


@pytest.mark.parametrize(
    ("load", "along", "drop"),
    [
        (1, 0.99124640, 0.12347140),
        (4, 0.89011075, 0.42515928),
        (10, 0.65635376, 0.70019972),
        (50, 0.24501476, 0.90791712),
    ],
)
def test_the_heavy_cantilever_drops_to_its_published_place(load, along, drop):
    np.testing.assert_allclose(elastica.heavy(load), [drop, along], atol=6e-9)


def test_small_loads_give_the_linear_deflections():
    assert elastica.tip_loaded(1e-4)[0] == pytest.approx(1e-4 / 3, rel=1e-6)
    assert elastica.heavy(1e-4)[0] == pytest.approx(1e-4 / 8, rel=1e-6)


@pytest.mark.parametrize("load", [0.5, 6.0])
def test_the_shooting_in_space_agrees_with_both(load):
    pulled = equilibrium(STIFF, Loads(tip_force=(0, 0, -load))).tip
    np.testing.assert_allclose([-pulled[2], pulled[0]], elastica.tip_loaded(load), atol=1e-10)
    fallen = equilibrium(STIFF, Loads(gravity=(0, 0, -load))).tip
    np.testing.assert_allclose([-fallen[2], fallen[0]], elastica.heavy(load), atol=1e-10)


def test_the_bend_of_45_degrees_goes_to_its_inextensible_place():
    np.testing.assert_allclose(equilibrium(*bend.bend()).tip, bend.TIP, atol=1e-6)


def test_the_bend_of_45_degrees_stretches_with_the_axial_stiffness_of_its_section():
    moved = equilibrium(*bend.bend(axial=1e7)).tip - bend.TIP
    assert 1e-3 < np.linalg.norm(moved) < 1e-2


def test_greenhills_column_buckles_at_its_published_load():
    assert column.greenhill() == pytest.approx(7.83734744, abs=5e-9)


def test_ritz_s_method_gives_the_closed_forms_of_the_uniform_column_and_the_cone():
    uniform = column.buckling_gravity(2.0, lambda z: 3.0, lambda z: 0.5)
    assert uniform * 0.5 * 2.0**3 / 3.0 == pytest.approx(column.greenhill(), rel=1e-10)
    tapered = column.buckling_gravity(1.0, lambda z: (1 - z) ** 4, lambda z: (1 - z) ** 2)
    assert tapered == pytest.approx(column.cone(), rel=1e-6)


def test_a_heavy_payload_buckles_the_column_at_eulers_load():
    gravity = column.buckling_gravity(1.0, lambda z: 1.0, lambda z: 0.0, payload=2.0)
    assert gravity == pytest.approx(np.pi**2 / 4 / 2, rel=1e-10)


def test_the_elastica_of_a_force_is_the_limit_of_small_moments():
    near, far = (np.array(elastica.tip_loaded_with_moment(1.0, m)) for m in (0.02, 0.04))
    np.testing.assert_allclose(2 * near - far, elastica.tip_loaded(1.0), atol=2e-4)


def test_without_a_force_the_moment_bends_an_arc():
    arc = [1 - np.cos(1.2), np.sin(1.2)]
    found = elastica.tip_loaded_with_moment(0.0, 1.2)
    np.testing.assert_allclose(found, np.array(arc) / 1.2, atol=1e-12)


def test_the_helix_of_a_force_and_a_moment_balances():
    helix = elastica.Helix(1.5, 1.0, 2.0, bending=1.0, twisting=0.7, axial=30.0)
    force = tuple(helix.force.tolist())
    found = equilibrium(
        Rod(length=0.8, axial=lambda z: 30.0, bending=lambda z: 1.0, torsion=lambda z: 0.7),
        Loads(tip_force=force, tip_moment=tuple(helix.moment(0.8).tolist())),
    )
    np.testing.assert_allclose(found.tip, helix.place(0.8), atol=1e-10)
    np.testing.assert_allclose(found.base_moment, helix.base_moment, atol=1e-10)
