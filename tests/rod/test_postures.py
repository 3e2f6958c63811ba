"""Laws of postures: where an arm is that hangs first, and is then activated."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize

import softreach as sr
from softreach.arm import Manipulator, designs
from softreach.arm.loads import Loads
from softreach.rod.loaded import flood
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipStatus
from tests.bodies import by_lines, oracle_rod
from tests.oracles.chain import Chain

EXAMPLES = Path(__file__).parents[2] / "examples"
TWIST = 1e-4  # [rad] over the length, by which an arm leans to the side that softreach tells


def carrying(arm, payload):
    """The arm with a payload [kg]."""
    return arm.replace(loads=(arm.loads or Loads()).replace(payload=payload))


def example(name, payload):
    return carrying(Manipulator.load(EXAMPLES / f"{name}.toml"), payload)


def lce(points, payload):
    return carrying(designs.lce_arm().replace(base=sr.Base(points=points)), payload)


ARMS = {  # with the least share of their activations that are stable
    "tentacle 20 g": (lambda: example("tentacle", 0.02), 0.998),
    "tentacle 100 g": (lambda: example("tentacle", 0.1), 1.0),
    "tentacle 500 g": (lambda: example("tentacle", 0.5), 1.0),
    "tendon_arm 50 g": (lambda: example("tendon_arm", 0.05), 1.0),
    "lce_arm 10 g": (lambda: lce("down", 0.01), 0.998),
    "lce_arm aside 5 g": (lambda: lce("x", 0.005), 0.998),
}


def random_activations(rod, n, seed=0):
    return rod.box.from_cube(np.random.default_rng(seed).random((n, rod.box.bundles)))


@pytest.mark.parametrize("name", ARMS)
def test_strict_steps_along_lines_lead_to_the_same_postures(name, monkeypatch):
    """At least 99.9 % of all, with a tenth of the correction that is allowed otherwise."""
    make, share = ARMS[name]
    rod = LoadedRod(make())
    gamma = random_activations(rod, 100)
    found = rod.equilibria(gamma)
    assert (found.status == TipStatus.STABLE).mean() >= share
    for limit in ("_CORRECTION", "_CORRECTION_OF_NODES"):
        monkeypatch.setattr(flood, limit, 0.1 * getattr(flood, limit))
    strictly = by_lines(rod.solver, gamma)
    both = (found.status == TipStatus.STABLE) & (strictly.status == TipStatus.STABLE)
    assert both.mean() > 0.98
    apart = np.linalg.norm(found.tips[both] - strictly.tips[both], axis=1)
    assert (apart > 1e-6 * rod.length).mean() <= 1e-3


def pulled_chain(arm, rod, gamma, links=40, steps=10):
    """The tip of a chain of links that hangs, is pulled step by step, and comes to rest in each."""
    twist, q = np.array([0.0, 0.0, TWIST / arm.length]), None
    for share in np.linspace(0.0, 1.0, steps + 1):
        one, loads = oracle_rod(arm, share * gamma, rod.tables.loads)
        chain = Chain(replace(one, curvature=lambda z, u=one.curvature: u(z) + twist), loads, links)
        scale = 1.0 / chain.stiffness.max()
        ways = [
            partial(lambda of, scale, x: scale * of(x), of, scale)
            for of in (chain.energy, chain.gradient, chain.hessian)
        ]
        start = chain.rest() if q is None else q
        fun, jac, hess = ways
        q = minimize(fun, start, jac=jac, hess=hess, method="trust-exact", options=STRICT).x
    return chain.nodes(q)[-1]


STRICT = {"gtol": 1e-7}
FEW = {("tentacle 100 g", 0), ("tendon_arm 50 g", 0)}


@pytest.mark.parametrize(
    ("name", "sample"),
    [
        pytest.param(name, k, marks=[] if (name, k) in FEW else pytest.mark.large)
        for name in ARMS
        for k in range(5)
    ],
)
def test_a_chain_that_hangs_and_is_pulled_comes_to_rest_in_the_posture(name, sample):
    """Minima of another energy, each from the last one: no rod is walked, no margin is asked."""
    arm = ARMS[name][0]()
    rod = LoadedRod(arm)
    gamma = random_activations(rod, 5, seed=3)[sample]
    found = rod.equilibria(gamma[None])
    assert found.status[0] == TipStatus.STABLE
    assert np.linalg.norm(pulled_chain(arm, rod, gamma) - found.tips[0]) < 0.005 * arm.length


def test_a_hanging_arm_leans_to_a_side_where_its_plane_of_symmetry_loses_its_stability():
    """At a pitchfork: continuously, and to the other side with the other twist."""
    rod = as_tip_map(example("tentacle", 0.02), 1e-8)
    postures = Postures(rod.rod.solver)
    planar = postures.find(np.array([[6.25, 6.25]]))
    assert planar.status[0] == TipStatus.STABLE
    assert abs(planar.tips[0, 1]) < 1e-9
    pulled = np.array([6.2534, 6.2540, 6.2550])
    sides = [
        replace(postures, side=side).find(pulled[:, None] * np.ones(2)).tips[:, 1]
        for side in (1, -1)
    ]
    np.testing.assert_allclose(sides[0], -sides[1], atol=1e-7)
    fork = np.polyfit(sides[0] ** 2, pulled, 1)[1]  # the way aside grows like a square root
    assert fork == pytest.approx(6.2524, abs=1e-3)
    other = replace(postures, side=-1).find(np.array([[8.0, 2.0]])).tips
    there = np.array([[-15.40592, 85.85417, -246.39666]])
    np.testing.assert_allclose(1e3 * rod.pose.to_world(other), there, atol=1e-3)


@pytest.mark.parametrize(
    ("payload", "gamma", "tip"),
    [
        (0.02, (2.0, 3.0), (17.49238, -16.45184, -327.82713)),
        (0.02, (6.0, 6.0), (81.23935, 0.0, -277.04289)),
        (0.02, (8.0, 2.0), (55.22934, 17.88536, -246.39666)),
        (0.1, (6.0, 4.0), (5.20014, 12.19369, -318.78130)),
        (0.5, (8.0, 2.0), (-20.49970, 9.87300, -340.94453)),
    ],
)
def test_a_tentacle_that_hangs_first_is_where_a_shooting_from_the_base_has_it(payload, gamma, tip):
    """By DOP853 from the base [mm], refined; under up to 500 g, in one to eight segments."""
    found, status = as_tip_map(example("tentacle", payload), warn=False).tips_and_status([gamma])
    assert status[0] == TipStatus.STABLE
    np.testing.assert_allclose(1e3 * found[0], tip, atol=1e-3)


@pytest.mark.parametrize(
    ("payload", "side"),
    [
        (0.1, 3),
        pytest.param(0.1, 7, marks=pytest.mark.large),
        pytest.param(0.02, 25, marks=pytest.mark.large),
    ],
)
def test_a_stable_equilibrium_is_listed_at_every_activation_of_a_tentacle(payload, side):
    arm = example("tentacle", payload)
    ends = np.linspace(0.0, 8.0, side)
    for gamma in np.stack(np.meshgrid(ends, ends), axis=-1).reshape(-1, 2):
        assert TipStatus.STABLE in sr.equilibria(arm, gamma).status


@pytest.mark.large
def test_the_compliance_under_500_g_is_the_difference_of_tips():
    """To 1e-5 of itself, along eight segments."""
    arm, force, gamma = example("tentacle", 0.5), np.array([3e-3, -2e-3, 4e-3]), [[8.0, 2.0]]
    there, at, back = (
        as_tip_map(
            arm.replace(loads=arm.loads.replace(tip_force=tuple(sign * force))), 1e-10, warn=False
        )
        for sign in (1, 0, -1)
    )
    moved = (there.tips(gamma) - back.tips(gamma)) / 2
    found = sr.stiffness.tip_compliance(at, gamma) @ force
    np.testing.assert_allclose(found, moved, atol=1e-5 * np.linalg.norm(moved))


def test_the_blocked_force_under_500_g_holds_the_tip_in_its_place():
    arm, gamma = example("tendon_arm", 0.5), np.array([[4.0, 2.0, 1.0]])
    found = sr.forces.blocked_force(arm, None, (1.0, 0.0, 0.0), start=gamma)
    assert found.force[0] > 0
    pushed = arm.replace(loads=arm.loads.replace(tip_force=tuple(found.tip_force.values[0])))
    place, tip = sr.tip_positions(arm, gamma), sr.tip_positions(pushed, found.activation.values)
    np.testing.assert_allclose(tip, place, atol=2e-6 * arm.length)
