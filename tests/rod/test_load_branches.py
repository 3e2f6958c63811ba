"""Branches of equilibria are followed to the whole load, or to the fold at which they turn back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softreach.arm import LinearTaper, Manipulator, Material, Ring, Section, Tendon, designs
from softreach.arm.loads import Loads
from softreach.rod.free import FreeRod
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.shooting import PATIENT, Rung
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import ArmBody, LoadTables
from softreach.rod.tip_map import TipStatus
from tests.oracles import load_branch

HANGING = (0.0, 0.0, 9.81)
_YOUNG, _DISTANCE, _TENSION = 93_480.0, 0.01183, 6.0
SMOOTH = np.array(
    [
        [0.191324, 0.081553, 0.855227],
        [0.274048, 0.007092, 0.645721],
        [0.005825, 0.262495, 0.421189],
        [0.073190, 0.257803, 0.763129],
        [0.033892, 0.186794, 0.674689],
    ]
)
"""Shares of the largest tension."""


@pytest.fixture(scope="module")
def heavy():
    """The laboratory's arm with 20 g, whose branches nearly fork."""
    return LoadedRod(designs.lce_arm().replace(loads=Loads(gravity=HANGING, payload=0.02)), 1e-6)


def soft_tendons(share):
    """Three soft tendons that hang, of load number 25 with all of the load."""
    tendons = [
        Tendon(
            name=f"t{k}",
            distance=_DISTANCE,
            offset=2 * math.pi * k / 3,
            activation_bounds=(0.0, _TENSION),
        )
        for k in range(3)
    ]
    rubber = Material(young_modulus=_YOUNG, density=1000.0)
    return Manipulator(
        profile=LinearTaper(length=0.3, outer_radius=0.01833, taper=0.02369),
        section=Section(rings=(Ring(inner_ratio=0.0, material=rubber),)),
        actuators=tuple(tendons),
        loads=Loads(gravity=(0.0, 0.0, share * 9.81), payload=0.61417),
    )


@pytest.mark.parametrize(
    "gamma",
    [
        (-0.72288394, -0.72127314, -4.22473062),
        (-1.32346248, -1.3317357, -4.96542393),
        (-0.10355638, -3.46948571, -4.71224324),
        (-0.55906654, -2.07405052, -4.12101375),
    ],
)
def test_a_branch_that_nearly_forks_is_followed_to_the_side_to_which_it_leans(heavy, gamma):
    """Or to its fold; the equilibrium in the middle, and on the other side, are not on it."""
    gamma = np.array(gamma)
    branch = load_branch.follow(heavy, gamma, 0.06, steps=24)
    found = heavy.equilibria(gamma[None])
    if branch.fold is not None:
        assert found.status[0] == TipStatus.NO_EQUILIBRIUM
        return
    assert branch.determinants.min() > 0
    assert found.status[0] == TipStatus.STABLE
    turn = FreeRod(heavy.arm, 1e-9).frames(gamma[None], [heavy.length]).directors[0, 0]
    share = (1.0 - branch.loads[-2]) / (branch.loads[-1] - branch.loads[-2])
    there = branch.directions[-2] + share * (branch.directions[-1] - branch.directions[-2])
    assert np.linalg.norm(turn @ found.frame[0] - there) < 0.01


def test_a_smooth_branch_is_not_lost_under_a_little_more_load():
    """det D grows to 1e10, so that the base turns far where the tip hardly does."""
    shares = (0.9, 0.92, 0.94, 0.96, 0.98, 1.0)
    gamma, found = _TENSION * SMOOTH, []
    for share in shares:
        arm = soft_tendons(share)
        found.append(Solver(LoadTables(arm, arm.loads, ArmBody(arm)), 16, 1e-6).find(gamma))
    assert (np.array([one.status for one in found]) == TipStatus.STABLE).all()
    ways = np.diff([one.tips for one in found], axis=0)
    assert np.linalg.norm(ways, axis=2).max() < 0.01 * arm.length
    np.testing.assert_allclose(ways[1:], ways[:-1], atol=0.1 * np.linalg.norm(ways, axis=2).max())


def test_a_search_that_is_cut_short_is_undecided(heavy, monkeypatch):
    """Nothing is said of what was not followed to its end."""
    gamma = np.array([[-0.72288394, -0.72127314, -4.22473062]])
    solver, short = heavy.solver, PATIENT._replace(walks=3)
    monkeypatch.setattr("softreach.rod.loaded.solver.LATER_RUNGS", {Rung.PATIENT: short})
    found = solver.empty(1)
    solver.again(gamma, np.array([0]), Rung.PATIENT, found)
    assert found.status[0] == TipStatus.UNDECIDED
    assert found.rung[0] == Rung.NONE
    assert np.isnan(found.tips).all()
