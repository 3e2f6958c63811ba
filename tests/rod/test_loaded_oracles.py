"""Loaded rods against closed forms, published places, and solvers written in another way."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from softreach.arm import Chamber, FiberArchitecture, LinearTaper, Material, Tendon, designs
from softreach.arm.loads import Loads, PointLoad
from softreach.arm.tables import tables
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.tip_map import TipStatus, has_tip
from tests.bodies import (
    DOWN,
    SIDE,
    UP,
    of_body,
    oracle_rod,
    posture_shapes,
    straight,
    uniform,
    weighed,
)
from tests.oracles import bend, elastica, linear_strains, loaded_rod, sorosim

NOTHING = Loads(gravity=(0.0, 0.0, 0.0))
REST = np.zeros((1, 3))


def test_a_tip_force_and_a_moment_bend_an_elastica():
    for load, moment in ((1.0, 0.5), (2.0, 1.0)):
        loads = NOTHING.replace(tip_force=(load, 0, 0), tip_moment=(0, moment, 0))
        tip = Postures(straight(uniform(1.0), loads)).find(REST).tips[0]
        expected = elastica.tip_loaded_with_moment(load, moment)
        np.testing.assert_allclose(tip[[0, 2]], expected, atol=1e-9)


@pytest.mark.parametrize("force", [2.0, -1.0])
def test_a_force_and_a_moment_about_its_direction_wind_a_helix(force):
    helix = elastica.Helix(1.5, 1.0, force, bending=1.0, twisting=0.7, axial=30.0)
    loads = NOTHING.replace(tip_force=tuple(helix.force), tip_moment=tuple(helix.moment(1.0)))
    solver = straight(uniform(1.0, axial=30.0, torsion=0.7), loads)
    stations = np.linspace(0.0, 1.0, 6)
    shapes = posture_shapes(solver, REST, stations)
    places = [helix.place(z) for z in stations]
    np.testing.assert_allclose(shapes.position[0], places, atol=1e-9)
    moment = np.einsum("sd,sdc->sc", shapes.moment[0], shapes.directors[0])
    np.testing.assert_allclose(moment, [helix.moment(z) for z in stations], atol=1e-8)


def bent_arm(length, curvature, body, loads):
    """An untapered arm, and activations that bend it to a curvature in x and z at its length."""
    sides = FiberArchitecture(
        bundles=2, revolution=0.0, offset=0.0, extent=0.5, activation_bounds=(-1, 1)
    )
    arm = designs.minimal_trunk().replace(
        profile=LinearTaper(length=length, outer_radius=length / 20), actuators=(sides,)
    )
    arm = of_body(arm, body, loads)
    per_unit = tables(arm, [0.0]).curvature[0, 1] @ [1.0, -1.0]
    return arm, curvature / per_unit * np.array([[1.0, -1.0]])


def test_a_bend_of_45_degrees_goes_to_its_published_place():
    """The fixed frame of the oracle is that of the arm."""
    bar, loads = bend.bend()
    body = uniform(bar.bending(0.0), bar.axial(0.0), bar.torsion(0.0))
    arm, gamma = bent_arm(bar.length, 0.01, body, NOTHING.replace(tip_force=loads.tip_force))
    tip = Postures(Solver(LoadTables(arm=arm), 32, 1e-10)).find(gamma).tips[0]
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
    "a fiber, whose length counts, and forces, whose does not": (
        designs.minimal_trunk(material=Material(young_modulus=1e6, density=1000.0)).replace(
            actuators=(
                designs.minimal_trunk().actuators[0],
                Tendon(distance_ratio=0.8, revolution=1.0, offset=2.0, activation_bounds=(0, 60)),
                Chamber(
                    distance_ratio=0.4, radius_ratio=0.3, offset=4.0, activation_bounds=(0, 1e5)
                ),
            )
        ),
        [-0.8, 60.0, 5e4],
        Loads(
            gravity=SIDE,
            tip_moment=(0.2, 0.3, -0.4),
            follower_force=(1.0, 2.0, -2.0),
            force_per_length=(0.0, 2.0, 0.0),
        ),
    ),
    "chambers": (designs.three_chamber_arm(), None, Loads(gravity=(0.0, 5.0, 8.0), payload=0.02)),
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
    expected = loaded_rod.equilibrium(*oracle_rod(arm, gamma, loads), rtol=1e-10)
    unloaded = loaded_rod.equilibrium(*oracle_rod(arm, gamma, NOTHING), rtol=1e-8)
    assert expected.converged
    assert status == TipStatus.STABLE
    assert np.linalg.norm(expected.tip - unloaded.tip) > 0.02 * arm.length
    np.testing.assert_allclose(tip, expected.tip, atol=1e-8 * arm.length)


# The 500 equilibria of a steel rod that SoRoSim published: `tests/data/README.md`


STEEL = sorosim.steel_rod()
ARM = designs.minimal_trunk(taper=0.0, length=sorosim.LENGTH)
BODY = uniform(STEEL.bending(0), STEEL.axial(0), STEEL.torsion(0), STEEL.mass(0))
BASE = np.array(STEEL.base)
STATIONS = np.unique(sorosim.STATIONS)
PLACE_ROUNDING, WRENCH_ROUNDING = 0.5e-4, 0.5e-4


def solver(loads, steps=12):
    """Of the rod, whose base frame is seen from the fixed frame of the file."""
    (point,) = loads.points
    turned = Loads(
        gravity=BASE @ loads.gravity,
        tip_force=BASE @ loads.tip_force,
        tip_moment=BASE @ loads.tip_moment,
        point_loads=(
            PointLoad(station=point.place, force=BASE @ point.force, moment=BASE @ point.moment),
        ),
    )
    return Solver(LoadTables(arm=of_body(ARM, BODY, turned)), steps, 1e-8)


def places(loads):
    return posture_shapes(solver(loads), REST, STATIONS).position[0] @ BASE


def of_file(case):
    """Places at the stations; the middle is there twice."""
    return np.delete(case.place, 7, axis=0)


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.large)])
def test_all_of_sorosim_s_equilibria_are_those_of_the_branch_and_stable(step):
    """As far as rounded wrenches and the file's strains are right: a thousandth of the length."""
    assert len(sorosim.cases()) == 500
    cases = sorosim.cases()[::step]
    found = [Postures(solver(case.loads)).find(REST) for case in cases]
    assert {int(one.status[0]) for one in found} == {TipStatus.STABLE}
    tips = np.concatenate([one.tips for one in found]) @ BASE
    apart = np.linalg.norm(tips - [case.place[-1] for case in cases], axis=1)
    assert apart.max() < 0.61e-3
    assert np.median(apart) < 0.26e-3


def test_the_rods_lie_along_sorosim_s_from_base_to_tip():
    for case in sorosim.cases()[::25]:
        apart = np.linalg.norm(places(case.loads) - of_file(case), axis=1)
        assert apart.max() < 0.61e-3


def by_wrenches(loads):
    """Derivatives of all places by the components of both wrenches, (place component, 12)."""
    step, (point,) = 2e-4, loads.points
    columns = []
    for shift in np.eye(12).reshape(12, 4, 3) * step:
        moved = []
        for sign in (1, -1):
            change = sign * shift
            mid = replace(point, force=point.force + change[0], moment=point.moment + change[1])
            tip = {
                "tip_force": loads.tip_force + change[2],
                "tip_moment": loads.tip_moment + change[3],
            }
            moved.append(places(replace(loads, points=(mid,), **tip)))
        columns.append((moved[0] - moved[1]).ravel() / (2 * step))
    return np.stack(columns, axis=1)


def left_over(slopes, apart):
    """Largest component of what no rounding of wrenches explains [m]."""
    unit = 1e4  # in 0.1 mm and 1e-4 N
    ones = np.ones((len(apart), 1))
    found = linprog(
        [*np.zeros(12), 1.0],
        A_ub=np.block([[-slopes, -ones], [slopes, -ones]]),
        b_ub=unit * np.concatenate([-apart, apart]),
        bounds=[(-WRENCH_ROUNDING * unit, WRENCH_ROUNDING * unit)] * 12 + [(0, None)],
    )
    return found.x[-1] / unit


@pytest.mark.parametrize("row", [50, 150, 250, 300, 450])
def test_what_is_left_of_the_differences_is_the_rounding_of_places(row):
    """With the wrenches within their rounding, and strains linear on each half as in the file."""
    case = sorosim.cases()[row]
    shape = posture_shapes(solver(case.loads), REST, linear_strains.centers(STEEL))
    curvature = shape.moment[0] / [STEEL.bending(0), STEEL.bending(0), STEEL.torsion(0)]
    linear = linear_strains.places(STEEL, case.loads, curvature, STATIONS)
    apart, slopes = (of_file(case) - linear).ravel(), by_wrenches(case.loads)
    assert left_over(slopes, apart) < 1.25 * PLACE_ROUNDING
    assert np.abs(apart).max() > 1.25 * PLACE_ROUNDING


# `tol` is kept over the whole activation box, for light and heavy loads, cylinders and cones


def of_load_number(taper_deg, load, gravity, **loads):
    """The trunk of a load number, to a tolerance of 1e-6."""
    trunk = designs.minimal_trunk(taper=math.radians(taper_deg))
    return LoadedRod(weighed(trunk, load, gravity, **loads), 1e-6)


def errors(found, gamma):
    """Tip errors where the arm is not about to lose its stability, and the share of these."""
    exact = Solver(found.tables, 4 * found.steps, 1e-10)
    of_rule = found.equilibria(gamma)
    settled = has_tip(of_rule.status) & (np.abs(of_rule.margin) > 0.02)
    apart = of_rule.tips[settled] - exact.near(gamma[settled], of_rule.of(settled)).tips
    return np.linalg.norm(apart, axis=1), settled.mean()


def samples(box, inside=100):
    random = np.random.default_rng(0).random((inside, box.dimension))
    return np.concatenate([box.corners(), box.from_cube(random)])


CASES = [(0, 12), (2, 2.5), (3, 0.1), (3, 12)]
LARGE_CASES = [pytest.param(*case, marks=pytest.mark.large) for case in [(0, 0.1), (2, 12), (3, 8)]]


@pytest.mark.parametrize(("taper_deg", "load"), [*CASES, *LARGE_CASES])
@pytest.mark.parametrize("gravity", [UP, SIDE, DOWN], ids=["up", "side", "down"])
def test_the_tolerance_is_kept_over_the_box(gravity, taper_deg, load):
    found = of_load_number(taper_deg, load, gravity)
    error, settled = errors(found, samples(found.box))
    assert settled > 0.98
    assert error.max() <= 1e-6


@pytest.mark.parametrize("taper_deg", [0.0, 3.0])
def test_the_tolerance_is_kept_under_loads_in_several_directions(taper_deg):
    found = of_load_number(taper_deg, 2.5, SIDE, tip_force=(0.0, 1.0, 0.5))
    error, settled = errors(found, samples(found.box, inside=60))
    assert settled == 1.0
    assert error.max() <= 1e-6
