"""Branches of equilibria are followed to the whole load, or to the fold at which they turn back."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softreach.arm import LinearTaper, Manipulator, Material, Ring, Section, Tendon, designs
from softreach.arm.loads import Loads, PointLoad
from softreach.rod.free import FreeRod
from softreach.rod.loaded import steps as loaded_steps
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.shooting import PATIENT, Rung
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import ArmBody, LoadTables
from softreach.rod.tip_map import TipStatus, has_tip
from softreach.support.errors import InvalidInput
from tests.bodies import Uniform, rubber, uniform
from tests.oracles import elastica, load_branch

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


# Laws of rods under loads so heavy that tangents swing or grow far along the arm


CYLINDER, TRUNK = designs.minimal_trunk(taper=0.0), designs.minimal_trunk()
REST = np.zeros((1, 3))
NOTHING = (0.0, 0.0, 0.0)


def held(arm):
    """The arm with every activation bound to zero, so that its tip asks for few steps."""
    return arm.with_bounds(np.zeros((arm.bundles, 2)))


def weighed(arm, load, gravity):
    """The arm with E such that its load number is `load`."""
    young = 1000 * 9.81 * arm.length**3 / (load * arm.profile.outer_radius**2)
    return rubber(arm, Loads(gravity=gravity), young)


@pytest.mark.parametrize("arm", [CYLINDER, TRUNK], ids=["cylinder", "trunk"])
def test_no_upright_arm_stands_again_under_more_load(arm):
    """However few steps its tip asks for, and however many conjugate points are within."""
    for load in (4.0, 8.0, 12.0, 15.0, 20.0, 30.0, 45.0, 60.0):
        rod = LoadedRod(held(weighed(arm, load, (0.0, 0.0, -9.81))), 1e-6)
        assert rod.status(REST)[0] == TipStatus.UNSTABLE


def test_an_upright_arm_under_forces_in_several_directions_does_not_stand_again_either():
    """A force that vanishes has the whole frame walked."""
    for load in (4.0, 12.0, 20.0, 45.0):
        arm = held(weighed(CYLINDER, load, (0.0, 0.0, -9.81)))
        loads = arm.loads.replace(follower_force=(0.0, 0.0, 1e-9))
        rod = LoadedRod(arm.replace(loads=loads), 1e-6)
        assert not rod.tables.one_direction
        assert rod.status(REST)[0] == TipStatus.UNSTABLE


def test_the_phase_of_a_tip_force_is_its_closed_form():
    """√(F/K) L for K1 > K3, without axial yield; steps make no more than π/2 of it."""
    loads = Loads(gravity=NOTHING, tip_force=(3.0, 0.0, 4.0))
    body = Uniform((0.0, 1 / 4.0, 1 / 2.0), 0.0)
    phase = LoadTables(held(CYLINDER), loads, body).phase
    assert phase.entire == pytest.approx(np.sqrt(5.0 / 2.0))
    assert phase.steepest == pytest.approx(phase.entire)
    for force in (50.0, 500.0):
        heavy = loads.replace(tip_force=(0.0, 0.0, force))
        phase = LoadTables(held(CYLINDER), heavy, body).phase
        assert phase.entire / phase.fewest_steps <= np.pi / 2
        assert phase.entire / (phase.fewest_steps - 1) > np.pi / 2


@pytest.mark.parametrize("arm", [CYLINDER, TRUNK], ids=["cylinder", "trunk"])
def test_every_load_that_is_added_adds_to_the_phase(arm):
    loads = Loads(gravity=(0.0, 1.0, -2.0))
    point = PointLoad(station=0.5, force=(0.0, 0.0, 1.0), moment=(0.1, 0.0, 0.0))
    phases = [LoadedRod(rubber(arm, loads), 1e-6).tables.phase]
    for more in (
        {"payload": 0.1},
        {"payload_arm": (0.1, 0.0, 0.0)},
        {"tip_force": (0.0, 0.3, 0.0)},
        {"follower_force": (0.0, 0.3, 0.0)},
        {"tip_moment": (0.0, 0.3, 0.0)},
        {"follower_moment": (0.0, 0.3, 0.0)},
        {"force_per_length": (0.0, 0.3, 0.0)},
        {"point_loads": (point,)},
    ):
        loads = loads.replace(**more)
        phases.append(LoadedRod(rubber(arm, loads), 1e-6).tables.phase)
    assert (np.diff(np.array(phases)[:, :2], axis=0) > 0).all()


@pytest.mark.parametrize("load", [60.0, 140.0, 300.0])
def test_a_cantilever_hangs_from_its_base_as_published_however_heavy_its_payload(load):
    """The tip hardly turns any more, and the base must tell when it is found."""
    found = Solver(
        LoadTables(held(CYLINDER), Loads(gravity=NOTHING, tip_force=(load, 0, 0)), uniform(1.0)),
        64,
        1e-9,
    ).find(REST)
    assert found.status[0] == TipStatus.STABLE
    np.testing.assert_allclose(found.tips[0, [0, 2]], elastica.tip_loaded(load), atol=1e-7)


@pytest.mark.parametrize(
    "loads",
    [
        Loads(tip_force=(0.0, 0.0, 1e9)),
        Loads(tip_force=(1e9, 0.0, 0.0)),
        Loads(gravity=(0.0, 0.0, 1e30), payload=1.0),
        Loads(tip_moment=(0.0, 1e30, 0.0)),
        Loads(follower_force=(0.0, 1e9, 0.0)),
    ],
)
def test_loads_that_no_walk_can_follow_are_refused_in_one_line(loads):
    rod = LoadedRod(designs.lce_arm().replace(loads=loads), 1e-6)
    with pytest.raises(InvalidInput, match=r"loads = of load number .* lighter") as refused:
        rod.status(rod.box.corners())
    assert "\n" not in str(refused.value)
    with pytest.raises(InvalidInput, match="loads"):
        rod.strain_range([0.0])


def stubby(share):
    """A thick cylinder pressed by a share of K0."""
    arm = designs.minimal_trunk(taper=0.0, length=0.2)
    arm = arm.replace(profile=arm.profile.replace(outer_radius=0.1))
    rod = LoadedRod(rubber(arm, Loads(gravity=NOTHING)), 1e-6)
    force = share / float(rod.body.compliance(np.zeros(1))[0][0])
    return LoadedRod(rod.arm.replace(loads=Loads(gravity=NOTHING, tip_force=(0, 0, -force))), 1e-6)


def test_an_arm_almost_squeezed_to_nothing_is_as_short_as_its_stiffness_says():
    found = stubby(0.9).equilibria(REST)
    assert found.tips[0, 2] == pytest.approx(0.1 * 0.2, rel=1e-6)


large = pytest.mark.large


@pytest.mark.parametrize("share", [1.01, *(pytest.param(s, marks=large) for s in (1.5, 3.0))])
def test_an_arm_squeezed_to_nothing_has_no_equilibrium(share):
    """Where 1 + n3/K0 is not positive; and what has none chooses no steps."""
    found = stubby(share).equilibria(REST)
    assert found.status[0] == TipStatus.NO_EQUILIBRIUM
    assert found.rung[0] == Rung.NONE
    assert np.isnan(found.tips).all()


@pytest.mark.large
def test_steps_of_an_arm_that_never_rests_are_no_fewer_than_those_of_the_free_one():
    arm = stubby(1.5).arm
    rod = LoadedRod(arm.with_bounds(np.full((3, 2), [-1e-3, 0.0])), 1e-4)
    assert not has_tip(rod.status(rod.box.corners())).any()
    assert rod.steps >= FreeRod(rod.arm, 1e-4).steps
    with pytest.raises(InvalidInput, match="has an equilibrium"):
        rod.strain_range([0.1])


def test_steps_that_are_not_found_are_not_searched_again(monkeypatch):
    searches = []
    find = Solver.find

    def counted(solver, gamma, **asked):
        searches.append(solver.steps)
        return find(solver, gamma, **asked)

    monkeypatch.setattr(Solver, "find", counted)
    monkeypatch.setattr(loaded_steps, "_MOST_STEPS", 4)
    rod = LoadedRod(weighed(TRUNK, 2.5, (9.81, 0.0, 0.0)), 1e-9)
    for _ in range(2):
        with pytest.raises(InvalidInput, match="reachable within 4 steps"):
            _ = rod.steps
    assert searches == [4]


def test_a_few_activations_near_the_loss_of_stability_do_not_choose_the_steps(monkeypatch):
    """Nor do they have a design refused."""
    rod = LoadedRod(weighed(TRUNK, 2.5, (9.81, 0.0, 0.0)), 1e-6)
    expected = rod.steps
    judged = loaded_steps.tip_differences

    def magnified(solver, gamma, known):
        found = judged(solver, gamma, known)
        found[:: max(101, len(found) // 4)] = 1e-2
        return found

    again = LoadedRod(rod.arm, 1e-6)
    monkeypatch.setattr("softreach.rod.loaded.rod.tip_differences", magnified)
    assert again.steps == expected
