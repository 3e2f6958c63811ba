"""What is called stable is a minimum of energy, and what is called unstable is not."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from softreach.arm import Measured, Pieces, designs
from softreach.arm.loads import Loads, PointLoad
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.tip_map import TipStatus
from tests.bodies import SIDE, UP, of_body, oracle_rod, rubber, weighed
from tests.oracles import column
from tests.oracles.chain import Chain

ASLANT = (3.0, 4.0, -8.0)
CYLINDER, MINIMAL = designs.minimal_trunk(taper=0.0), designs.minimal_trunk()
# Bent in the plane of symmetry, upright arms may fall out of it.
SYMMETRIC = np.array([[-0.5, -0.5, -0.6], [-1.2, -1.2, -1.4], [-1.3, -1.3, -1.4]])
ANY = np.array([[-1.2, -0.3, -0.8], [-1.6, -1.6, -1.6]])


def solver_of(arm):
    return Solver(LoadTables(arm=arm), 32, 1e-9)


def chain_of(arm, gamma, links=32):
    return Chain(*oracle_rod(arm, gamma, arm.loads), links)


def index(chain, moment, tip):
    """The number of ways to fall from the chain's equilibrium near a rod's."""
    found = chain.solve(chain.bent_by(moment))
    assert np.linalg.norm(chain.nodes(found)[-1] - tip) < 0.03 * chain.rod.length
    return int((chain.softest(found) < 0).sum())


@pytest.mark.parametrize("payload", [0.0, 0.5])
@pytest.mark.parametrize("taper", [-0.02, 0.0, 0.05])
def test_columns_buckle_where_ritz_has_them_buckle(taper, payload):
    """A column that bends and twists alone."""
    rigid, rest = Measured(axial_stiffness=1e15), np.zeros(3)
    arm = of_body(designs.minimal_trunk(taper=taper), rigid, Loads(payload=payload))
    of_column, _ = oracle_rod(arm, rest, arm.loads)
    critical = column.buckling_gravity(1.0, of_column.bending, of_column.mass, payload=payload)
    for share, status in ((0.9995, TipStatus.STABLE), (1.0005, TipStatus.UNSTABLE)):
        fallen = arm.replace(loads=arm.loads.replace(gravity=(0, 0, -share * critical)))
        found = Postures(solver_of(fallen)).find(rest[None])
        assert found.status[0] == status
        np.testing.assert_allclose(found.tips[0], [0, 0, 1], atol=1e-9)


@pytest.mark.parametrize(
    ("load", "gravity", "more"),
    [
        (5.0, UP, {}),
        pytest.param(8.0, UP, {}, marks=pytest.mark.large),
        (12.0, ASLANT, {}),
        (5.0, UP, {"payload": 1.0, "payload_arm": (0.0, 0.02, 0.1)}),
        (2.5, SIDE, {"tip_force": (0.0, 3.0, -20.0)}),
        (5.0, UP, {"force_per_length": (0.0, 0.0, -20.0), "tip_force": (2.0, 0.0, 0.0)}),
    ],
)
def test_of_the_reported_equilibria_the_stable_ones_are_minima_of_energy(load, gravity, more):
    arm = weighed(CYLINDER, load, gravity, **more)
    gamma, solver = np.concatenate([SYMMETRIC, ANY]), solver_of(arm)
    found = Postures(solver).find(gamma)
    assert (found.status != TipStatus.NO_EQUILIBRIUM).all()
    stations = chain_of(arm, gamma[0], 64).joints
    moments = solver.shapes(gamma, stations, found).moment
    for one, moment, tip, status in zip(gamma, moments, found.tips, found.status, strict=True):
        stable = index(chain_of(arm, one, 64), moment, tip) == 0
        assert stable == (status == TipStatus.STABLE)


# What turns, mirrors or scales an arm together with its loads does the same to its shape


GAMMA = np.array([[-1.2, -0.3, -0.8], [-0.2, -1.5, 0.0], [-1.6, -1.6, -1.6], [0.0, 0.0, -0.4]])
KINDS = {
    "one direction": Loads(gravity=(9.81, 0.0, 0.0), payload=0.2, payload_arm=(0.0, 0.0, 0.05)),
    "any": Loads(
        gravity=(6.0, 0.0, -6.0),
        tip_force=(0.0, 2.0, 1.0),
        tip_moment=(0.1, 0.2, -0.3),
        follower_force=(0.0, 0.5, -1.0),
        follower_moment=(0.1, 0.0, 0.2),
        point_loads=(PointLoad(station=0.6, force=(0.0, 1.0, 0.0), moment=(0.0, 0.1, 0.1)),),
        force_per_length=(0.0, 1.0, 0.5),
    ),
}
of_kinds = pytest.mark.parametrize("loads", KINDS.values(), ids=KINDS.keys())


def tips(arm, loads, young=1e6, gamma=GAMMA):
    arm = rubber(arm, loads, young)
    return Postures(Solver(LoadTables(arm=arm), 24, 1e-9)).find(gamma).tips


def changed(loads, change):
    """Loads whose vectors were changed: change(value, unit) with the unit's name."""
    units = dict.fromkeys(("tip_force", "follower_force"), "N")
    units |= dict.fromkeys(("tip_moment", "follower_moment"), "N m")
    units |= {"gravity": "m/s²", "payload_arm": "m", "force_per_length": "N/m"}
    values = {name: change(np.array(getattr(loads, name)), unit) for name, unit in units.items()}
    points = tuple(
        replace(
            one, force=change(np.array(one.force), "N"), moment=change(np.array(one.moment), "N m")
        )
        for one in loads.point_loads
    )
    return loads.replace(point_loads=points, **values)


@of_kinds
def test_turning_the_actuators_and_the_loads_about_the_base_turns_the_tips(loads):
    """Directors turn with the actuators, so that what is told in them turns too."""
    angle = 0.7
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = tuple(a.replace(offset=a.offset + angle) for a in MINIMAL.actuators)
    found = tips(MINIMAL.replace(actuators=turned), changed(loads, lambda v, _: turn @ v))
    np.testing.assert_allclose(found, tips(MINIMAL, loads) @ turn.T, atol=2e-9)


@of_kinds
def test_mirroring_the_loads_mirrors_the_tips_of_mirrored_activations(loads):
    """In the plane of symmetry x = 0; moments are mirrored as axial vectors."""
    mirror = np.array([-1.0, 1.0, 1.0])

    def mirrored(vector, unit):
        return -mirror * vector if unit == "N m" else mirror * vector

    found = tips(MINIMAL, changed(loads, mirrored), gamma=GAMMA[:, [1, 0, 2]].copy())
    np.testing.assert_allclose(found, tips(MINIMAL, loads) * mirror, atol=2e-9)


@of_kinds
def test_loads_in_proportion_to_young_s_modulus_leave_the_tips_where_they_are(loads):
    """A factor of gravity is one of weights."""
    stiffer = changed(loads, lambda v, unit: v if unit == "m" else 8.0 * v)
    np.testing.assert_allclose(tips(MINIMAL, stiffer, young=8e6), tips(MINIMAL, loads), atol=2e-9)


@of_kinds
def test_an_arm_of_another_size_with_loads_to_match_has_the_same_shape(loads):
    """Stresses are the same where forces grow as the square of the size, and gravity falls."""
    size = 0.1
    powers = {"N": 2, "N m": 3, "m": 1, "N/m": 1, "m/s²": -1}
    small = changed(loads, lambda v, unit: size ** powers[unit] * v)
    points = tuple(replace(one, station=size * one.station) for one in small.point_loads)
    small = small.replace(point_loads=points, payload=size**3 * loads.payload)
    found = tips(designs.minimal_trunk(length=size), small)
    np.testing.assert_allclose(found / size, tips(MINIMAL, loads), atol=2e-9)


def test_a_payload_is_the_limit_of_a_short_heavy_end():
    """The end's center is half its length before the tip, so that it tends there in proportion."""
    mass, of_arm, side = 0.2, 8.0, Loads(gravity=(9.81, 0.0, 0.0))

    def tips_of(mass_per_length, loads):
        arm = of_body(MINIMAL, Measured(mass_per_length=mass_per_length), loads)
        return Postures(Solver(LoadTables(arm=arm), 24, 1e-9)).find(GAMMA).tips

    expected, apart = tips_of(of_arm, side.replace(payload=mass)), []
    for length in (0.002, 0.001):
        places, values = (0.0, 1.0 - length, 1.0), (of_arm, of_arm + mass / length)
        found = tips_of(Pieces(stations_over_length=places, values=values), side)
        apart.append(np.linalg.norm(found - expected, axis=1))
    assert 1e-5 < apart[0].min() < apart[0].max() < 2e-3
    np.testing.assert_allclose(apart[0] / apart[1], 2.0, rtol=0.02)
