"""Loaded rods against closed forms, published places, and solvers written in another way."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import FiberArchitecture, LinearTaper, designs
from softreach.arm.loads import Loads, PointLoad
from softreach.arm.tables import tables
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import ArmBody, LoadTables
from softreach.rod.tip_map import TipStatus
from tests.bodies import oracle_rod, uniform
from tests.oracles import bend, elastica, loaded_rod

NOTHING = Loads(gravity=(0.0, 0.0, 0.0))
REST = np.zeros((1, 3))


def straight(body, loads, length=1.0, steps=32):
    """The solver of a straight passive rod."""
    arm = designs.minimal_trunk(taper=0.0, length=length)
    return Solver(LoadTables(arm, loads, body), steps, 1e-10)


def test_a_tip_force_and_a_moment_bend_an_elastica():
    for load, moment in ((1.0, 0.5), (2.0, 1.0)):
        loads = NOTHING.replace(tip_force=(load, 0, 0), tip_moment=(0, moment, 0))
        tip = straight(uniform(1.0), loads).find(REST).tips[0]
        expected = elastica.tip_loaded_with_moment(load, moment)
        np.testing.assert_allclose(tip[[0, 2]], expected, atol=1e-9)


@pytest.mark.parametrize("force", [2.0, -1.0])
def test_a_force_and_a_moment_about_its_direction_wind_a_helix(force):
    helix = elastica.Helix(1.5, 1.0, force, bending=1.0, twisting=0.7, axial=30.0)
    loads = NOTHING.replace(tip_force=tuple(helix.force), tip_moment=tuple(helix.moment(1.0)))
    solver = straight(uniform(1.0, axial=30.0, torsion=0.7), loads)
    stations = np.linspace(0.0, 1.0, 6)
    shapes = solver.shapes(REST, stations)
    places = [helix.place(z) for z in stations]
    np.testing.assert_allclose(shapes.frames.position[0], places, atol=1e-9)
    moment = np.einsum("sd,sdc->sc", shapes.moment[0], shapes.frames.directors[0])
    np.testing.assert_allclose(moment, [helix.moment(z) for z in stations], atol=1e-8)


def bent_arm(length, curvature):
    """An untapered arm, and activations that bend it to a curvature in x and z at its length."""
    sides = FiberArchitecture(
        bundles=2, revolution=0.0, offset=0.0, extent=0.5, activation_bounds=(-1, 1)
    )
    arm = designs.minimal_trunk().replace(
        profile=LinearTaper(length=length, outer_radius=length / 20), actuators=(sides,)
    )
    per_unit = tables(arm, [0.0]).curvature[0, 1] @ [1.0, -1.0]
    return arm, curvature / per_unit * np.array([[1.0, -1.0]])


def test_a_bend_of_45_degrees_goes_to_its_published_place():
    """The fixed frame of the oracle is that of the arm."""
    bar, loads = bend.bend()
    arm, gamma = bent_arm(bar.length, 0.01)
    body = uniform(bar.bending(0.0), bar.axial(0.0), bar.torsion(0.0))
    pulled = NOTHING.replace(tip_force=loads.tip_force)
    tip = Solver(LoadTables(arm, pulled, body), 32, 1e-10).find(gamma).tips[0]
    np.testing.assert_allclose(tip, bend.TIP, atol=1e-6)


ARMS = {
    "layers": (
        designs.lce_arm(),
        [-3.0, -1.0, -4.0],
        Loads(gravity=(6.0, 0.0, 7.0), payload=0.005, payload_arm=(0.0, 0.005, 0.01)),
    ),
    "tendons in two segments": (
        designs.three_tendon_robot(segments=2),
        [0.5, 0.0, 0.2, 0.0, 0.6, 0.1],
        Loads(gravity=(9.81, 0.0, 0.0), payload=0.01, tip_force=(0.0, 0.05, 0.0)),
    ),
    "helical tendons": (
        designs.helical_tendon_robot(),
        [6.0, 2.0, 0.0, 0.0],
        Loads(
            gravity=(0.0, 9.81, 0.0),
            follower_force=(0.1, 0.0, -0.1),
            point_loads=(PointLoad(station=0.3, force=(0.3, 0.0, 0.0)),),
        ),
    ),
    "oblique muscles": (
        designs.elephant_trunk(),
        None,
        Loads(gravity=(0.0, 0.0, 9.81), tip_force=(1.0, 0.0, 0.0)),
    ),
    "chambers": (
        designs.three_chamber_arm(),
        None,
        Loads(gravity=(0.0, 5.0, 8.0), payload=0.02),
    ),
}


@pytest.mark.parametrize(("arm", "activation", "loads"), ARMS.values(), ids=ARMS.keys())
def test_arms_of_all_kinds_rest_where_a_shooting_from_the_base_puts_them(arm, activation, loads):
    arm = arm.replace(loads=loads)
    found = LoadedRod(arm, 1e-8)
    if activation is None:
        activation = found.box.from_cube(np.random.default_rng(4).random((1, found.box.dimension)))[
            0
        ]
    gamma = np.asarray(activation, float)
    tip, status = found.tips(gamma[None])[0], found.status(gamma[None])[0]
    expected = loaded_rod.equilibrium(*oracle_rod(arm, ArmBody(arm), gamma, loads), rtol=1e-10)
    unloaded = loaded_rod.equilibrium(*oracle_rod(arm, ArmBody(arm), gamma, NOTHING), rtol=1e-8)
    assert expected.converged
    assert status == TipStatus.STABLE
    assert np.linalg.norm(expected.tip - unloaded.tip) > 0.02 * arm.length
    np.testing.assert_allclose(tip, expected.tip, atol=1e-8 * arm.length)
