"""The chain of links against the rod it approximates, and the sign of its Hessian."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.oracles import column
from tests.oracles.chain import Chain
from tests.oracles.loaded_rod import equilibrium
from tests.oracles.rod import Loads, PointLoad, Rod

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
COLUMN = Rod(
    length=1.0,
    axial=lambda z: 1e9,
    bending=lambda z: 1.0,
    torsion=lambda z: 0.7,
    mass=lambda z: 1.0,
)


def upright(load, links=30):
    """The chain of a straight column under its weight, and its straight coordinates."""
    chain = Chain(COLUMN, Loads(gravity=(0.0, 0.0, -load)), links)
    return chain, chain.solve(chain.rest())


def test_the_gradient_is_the_derivative_of_the_energy():
    chain = Chain(ROD, LOADS, 6)
    q = chain.rest() + 0.05 * np.random.default_rng(3).normal(size=4 * 6 + 3)
    steps = 1e-5 * np.eye(len(q))
    slopes = [(chain.energy(q + s) - chain.energy(q - s)) / 2e-5 for s in steps]
    np.testing.assert_allclose(chain.gradient(q), slopes, atol=1e-8)


def test_the_hessian_is_the_derivative_of_the_gradient():
    chain = Chain(ROD, LOADS, 4)
    q = chain.rest() + 0.05 * np.random.default_rng(3).normal(size=4 * 4 + 3)
    steps = 1e-5 * np.eye(len(q))
    slopes = [(chain.gradient(q + s) - chain.gradient(q - s)) / 2e-5 for s in steps]
    np.testing.assert_allclose(chain.hessian(q), slopes, atol=1e-7)


def test_the_chain_tends_to_the_rod_with_the_square_of_its_links():
    tip = equilibrium(ROD, LOADS).tip
    chains = {links: Chain(ROD, LOADS, links) for links in (12, 24)}
    error = [np.linalg.norm(chain.nodes(chain.solve())[-1] - tip) for chain in chains.values()]
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
