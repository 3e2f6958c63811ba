"""The 500 equilibria of a steel rod that SoRoSim published: `tests/data/README.md`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import linprog

from softreach.arm import designs
from softreach.arm.loads import Loads, PointLoad
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.tip_map import TipStatus
from tests.bodies import uniform
from tests.oracles import linear_strains, sorosim

STEEL = sorosim.steel_rod()
ARM = designs.minimal_trunk(taper=0.0, length=sorosim.LENGTH)
BODY = uniform(STEEL.bending(0), STEEL.axial(0), STEEL.torsion(0), STEEL.mass(0))
BASE = np.array(STEEL.base)
STATIONS = np.unique(sorosim.STATIONS)
REST = np.zeros((1, 3))
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
    return Solver(LoadTables(ARM, turned, BODY), steps, 1e-8)


def places(loads):
    return solver(loads).shapes(REST, STATIONS).frames.position[0] @ BASE


def of_file(case):
    """Places at the stations; the middle is there twice."""
    return np.delete(case.place, 7, axis=0)


@pytest.mark.parametrize("step", [5, pytest.param(1, marks=pytest.mark.large)])
def test_all_of_sorosim_s_equilibria_are_those_of_the_branch_and_stable(step):
    """As far as rounded wrenches and the file's strains are right: a thousandth of the length."""
    assert len(sorosim.cases()) == 500
    cases = sorosim.cases()[::step]
    found = [solver(case.loads).find(REST) for case in cases]
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
    shape = solver(case.loads).shapes(REST, linear_strains.centers(STEEL))
    curvature = shape.moment[0] / [STEEL.bending(0), STEEL.bending(0), STEEL.torsion(0)]
    linear = linear_strains.places(STEEL, case.loads, curvature, STATIONS)
    apart, slopes = (of_file(case) - linear).ravel(), by_wrenches(case.loads)
    assert left_over(slopes, apart) < 1.25 * PLACE_ROUNDING
    assert np.abs(apart).max() > 1.25 * PLACE_ROUNDING
