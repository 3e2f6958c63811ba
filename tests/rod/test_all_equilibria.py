"""Laws of all equilibria: none is missing, and stable ones are minima of the energy."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Manipulator, Tendon, designs
from softreach.arm.loads import Loads, PointLoad
from softreach.arm.tables import compliance
from softreach.cloud.curvature import strain_ranges
from softreach.geometry import sphere_maps
from softreach.rod import TipStatus, as_tip_map, free_bundles
from softreach.rod.free import FreeRod
from softreach.rod.loaded import flood
from softreach.rod.loaded import rod as loaded_rod
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.rods import with_unstable
from softreach.rod.tip_map import has_tip
from softreach.support.errors import InvalidInput
from tests.bodies import DOWN, SIDE, UP, oracle_rod, rubber, straight, uniform, weighed
from tests.oracles import column
from tests.oracles.chain import Chain

TRUNK = sr.designs.minimal_trunk()
STABLE = TipStatus.STABLE
BENT = np.array([-0.3, -0.5, -1.0])


def trunk(load, gravity=UP, arm=TRUNK, **loads):
    """The paper's trunk at a load number."""
    return weighed(arm, load, gravity, **loads)


@pytest.mark.parametrize("gravity", [UP, SIDE, DOWN], ids=["up", "side", "down"])
@pytest.mark.parametrize(("load", "most"), [(0.5, 1), (12.0, 5)])
def test_their_number_is_odd_and_one_is_the_branch_of_the_unloaded_arm(gravity, load, most):
    arm = trunk(load, gravity)
    for gamma in np.random.default_rng(0).uniform(-5 / 3, 0, (3, 3)):
        every, branch = sr.equilibria(arm, gamma), as_tip_map(arm).rod.equilibria(gamma[None])
        assert every.complete
        assert every.degree == 1
        assert len(every) % 2 == 1
        assert len(every) <= most
        assert not every.is_ring.any()
        np.testing.assert_array_equal(np.sort(every.status), every.status)
        k = every.followed
        np.testing.assert_allclose(every.tips[k], branch.tips[0], atol=1e-6)
        assert every.status[k] == branch.status[0]


@pytest.mark.parametrize(
    ("load", "starts"), [(12.0, 20), pytest.param(25.0, 60, marks=pytest.mark.large)]
)
def test_no_random_start_of_a_chain_of_links_comes_to_another(load, starts):
    """Newton's method on the energy of a chain, from shapes with random bending."""
    arm = trunk(load)
    every = sr.equilibria(arm, BENT)
    chain = Chain(*oracle_rod(arm, BENT, arm.loads), 20)
    tips = [tip for seed in range(starts) if (tip := come_to_rest(chain, seed)) is not None]
    assert len(tips) > 10
    apart = np.linalg.norm(np.array(tips)[:, None] - every.tips, axis=2)
    assert apart.min(axis=1).max() < 0.03
    assert len(set(apart.argmin(axis=1))) > 1


def come_to_rest(chain, seed):
    """The tip of the chain, or None where Newton's method fails or turns links over."""
    sizes = np.random.default_rng(seed).normal(size=(3, 2)) * [[4.0], [3.0], [2.0]]
    waves = np.cos(np.pi * np.outer(chain.joints / chain.rod.length, np.arange(3)))
    curvature = chain.curvature + np.pad(waves @ sizes, ((0, 0), (0, 1)))
    start = np.concatenate([(curvature * chain.span[:, None]).ravel(), chain.stretch])
    try:
        q = chain.solve(start)
    except (ArithmeticError, np.linalg.LinAlgError):
        return None
    turns, stretches = q[: -chain.links], q[-chain.links :]
    regular = np.isfinite(q).all() and stretches.min() > 0.1 and np.abs(turns).max() < 1.5
    return chain.nodes(q)[-1] if regular else None


@pytest.mark.parametrize(("load", "gravity"), [(12.0, UP), (25.0, UP), (25.0, SIDE)])
def test_stable_ones_are_minima_and_signs_count_the_ways_to_fall(load, gravity):
    arm = trunk(load, gravity)
    for gamma in (BENT, 0.1 * BENT):
        every = sr.equilibria(arm, gamma)
        for k, softest in enumerate(softest_of(every)):
            ways = int((softest < 0).sum())
            assert (every.status[k] == STABLE) == (ways == 0)
            assert every.signs[k] == (-1) ** ways


def softest_of(every, links=24):
    """The smallest eigenvalues of the energy of a chain at each equilibrium."""
    rod = every.rod
    chain = Chain(*oracle_rod(rod.arm, every.activation, rod.arm.loads), links)
    many = np.repeat(every.activation[None], len(every), axis=0)
    shapes = every.solver.shapes_facing(many, every.directions, chain.joints)[0]
    for frame, moment, tip in zip(shapes.directors, shapes.moment, every.tips, strict=True):
        fixed = np.einsum("sij,si->sj", frame, moment)
        q = chain.solve(chain.near(SimpleNamespace(frame=frame, moment=fixed)))
        assert np.linalg.norm(chain.nodes(q)[-1] - tip) < 0.03 * rod.length
        yield chain.softest(q)[:6]


def test_shapes_stand_on_the_base_and_end_at_the_tips():
    every = sr.equilibria(trunk(25.0), BENT)
    shapes = every.configuration(41)
    assert len(every) == shapes.sizes["sample"]
    np.testing.assert_allclose(shapes.position[:, -1], every.tips, atol=1e-6)
    np.testing.assert_allclose(shapes.position[:, 0], 0.0, atol=1e-12)
    np.testing.assert_allclose(shapes.directors[:, 0] - np.eye(3), 0.0, atol=1e-12)
    branch = sr.configuration(every.rod, BENT, 41)
    for name in ("position", "directors", "curvature", "extension"):
        np.testing.assert_allclose(shapes[name][every.followed], branch[name], atol=1e-5)


def test_an_upright_column_has_a_ring_once_it_is_higher_than_it_may_be():
    """A ring counts nothing to the degree: its Euler characteristic."""
    straight = np.zeros(3)
    greatest = _greatest()
    below, above = (sr.equilibria(trunk(s * greatest, arm=PRISM), straight) for s in (0.98, 1.02))
    assert len(below) == 1
    assert below.status[0] == STABLE
    assert above.is_ring.tolist() == [True, False]
    assert above.status.tolist() == [STABLE, TipStatus.UNSTABLE]
    assert above.followed == 1
    for every in (below, above):
        assert every.degree == 1
        assert every.complete


PRISM = sr.designs.minimal_trunk(taper=0.0)


def _greatest():
    """The load number of Greenhill's height of the prism: q L³/EI = 4 ρgL³/(E R2²)."""
    return column.greenhill() / 4


@pytest.mark.parametrize("load", [12.0, pytest.param(25.0, marks=pytest.mark.large)])
def test_leaning_rings_turn_about_nothing_and_are_minima_otherwise(load):
    every = sr.equilibria(trunk(load), np.full(3, 0.0))
    assert every.is_ring.any()
    for k, softest in enumerate(softest_of(every)):
        of_ring = np.abs(softest).argmin()
        rest = np.delete(softest, of_ring) if every.is_ring[k] else softest
        if every.is_ring[k]:
            assert abs(softest[of_ring]) < 1e-3 * abs(softest[-1])
        assert (every.status[k] == STABLE) == bool((rest > 0).all())


@pytest.mark.parametrize("gravity", [DOWN, UP], ids=["down", "up"])
def test_a_hanging_arm_driven_along_its_axis_may_have_rings_too(gravity):
    """Three equal bundles around the arm bend it nowhere."""
    fibers = (sr.FiberArchitecture(bundles=3, revolution=0.0, extent=0.5),)
    arm = trunk(25.0, gravity, arm=TRUNK.replace(actuators=fibers))
    every = sr.equilibria(arm, [-0.5, -0.5, -0.5])
    assert every.complete
    assert every.degree == 1
    assert (~every.is_ring).sum() == 1
    assert every.tips[~every.is_ring][0, 2] > 0


@pytest.mark.parametrize("asymmetry", [1e-5, 1e-3, 1e-2, 0.1])
@pytest.mark.parametrize("load", [12.0, pytest.param(25.0, marks=pytest.mark.large)])
def test_a_little_asymmetry_leaves_two_of_every_ring(load, asymmetry):
    rings = sr.equilibria(trunk(load), np.zeros(3))
    every = sr.equilibria(trunk(load), asymmetry * BENT)
    assert every.complete
    assert not every.is_ring.any()
    assert len(every) == 1 + 2 * rings.is_ring.sum()
    height = np.repeat(rings.tips[:, 2], 1 + rings.is_ring)
    np.testing.assert_allclose(np.sort(every.tips[:, 2]), np.sort(height), atol=asymmetry + 1e-6)


def test_an_asymmetry_within_the_tolerance_is_none():
    every = sr.equilibria(trunk(12.0), 1e-9 * BENT)
    assert every.is_ring.tolist() == [True, False]


@pytest.mark.parametrize("restrict", [free_bundles, with_unstable])
def test_those_of_a_view_are_those_of_the_arm(restrict):
    arm = trunk(12.0, arm=TRUNK.with_bounds([(-5 / 3, 0), (-0.5, -0.5), (-5 / 3, 0)]))
    whole, gamma = as_tip_map(arm), np.array([-0.03, -0.5, -0.1])
    expected = sr.equilibria(whole, gamma)
    assert len(expected) == 3
    rod = restrict(whole)
    every = sr.equilibria(rod, gamma[whole.box.free] if rod.box.bundles == 2 else gamma)
    np.testing.assert_array_equal(every.tips, expected.tips)
    np.testing.assert_array_equal(every.activation, gamma)
    assert every.to_dataset().bundle.values.tolist() == list(arm.bundle_names)


@pytest.mark.parametrize("arm", [TRUNK, trunk(5.0, (0.0, 0.0, 0.0))])
def test_an_arm_that_nothing_loads_has_one(arm):
    every = sr.equilibria(arm, BENT[None])
    np.testing.assert_allclose(every.tips, sr.tip_positions(TRUNK, BENT[None]), atol=1e-6)
    assert (every.degree, every.followed, every.complete) == (1, 0, True)
    assert every.status.tolist() == [STABLE]
    assert every.configuration(5).sizes["sample"] == 1


@pytest.mark.parametrize(
    ("loads", "named"),
    [
        ({"tip_force": (0, 1.0, 0)}, "tip_force"),
        ({"tip_moment": (0, 1.0, 0)}, "tip_moment"),
        ({"follower_force": (0, 0, 1.0)}, "follower_force"),
        ({"point_loads": (PointLoad(station=0.5, force=(0, 1, 0)),)}, r"point_loads\[0\]"),
    ],
)
def test_other_loads_than_dead_forces_along_one_direction_are_refused_by_name(loads, named):
    with pytest.raises(sr.InvalidInput, match=f"loads = {named}: must be dead forces along one"):
        sr.equilibria(trunk(2.5, **loads), BENT)
    with pytest.raises(sr.InvalidInput, match="one activation at a time"):
        sr.equilibria(trunk(2.5, **loads), np.zeros((2, 3)))


def test_what_may_be_missing_is_said(monkeypatch):
    search = sphere_maps.sphere_roots

    def without_the_last(*args, **options):
        roots, cut = search(*args, **options)
        kept = np.sort(np.argsort(roots.determinants)[1:])
        return sphere_maps.Roots(roots.points[kept], roots.determinants[kept]), cut

    monkeypatch.setattr(sphere_maps, "sphere_roots", without_the_last)
    with pytest.warns(sr.errors.SoftreachWarning, match="degree of those found is 2"):
        every = sr.equilibria(trunk(25.0), BENT)
    assert not every.complete
    assert every.degree != 1
    assert "may be missing" in repr(every)


def test_all_numbers_are_in_a_dataset():
    every = sr.equilibria(trunk(12.0), BENT)
    data = every.to_dataset()
    np.testing.assert_array_equal(data.tip, every.tips)
    assert data.attrs["degree"] == 1
    assert int(data.is_followed.values.argmax()) == every.followed
    assert repr(every).startswith(f"{len(every)} solutions, of which 1 stable; degree 1\n")


# Branches of equilibria are followed to the whole load, or to the fold at which they turn back


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
    arm = Manipulator.tapered(
        length=0.3,
        outer_radius=0.01833,
        inner_radius=0.0,
        taper=0.02369,
        young_modulus=_YOUNG,
        density=1000.0,
        actuators=[Tendon(distance=_DISTANCE, bundles=3, activation_bounds=(0.0, _TENSION))],
    )
    return arm.replace(loads=Loads(gravity=(0.0, 0.0, share * 9.81), payload=0.61417))


def test_a_smooth_branch_is_not_lost_under_a_little_more_load():
    """det D grows to 1e10, so that the base turns far where the tip hardly does."""
    shares = (0.9, 0.92, 0.94, 0.96, 0.98, 1.0)
    gamma, found = _TENSION * SMOOTH, []
    for share in shares:
        arm = soft_tendons(share)
        found.append(Postures(Solver(LoadTables(arm=arm), 16, 1e-6)).find(gamma))
    assert (np.array([one.status for one in found]) == TipStatus.STABLE).all()
    ways = np.diff([one.tips for one in found], axis=0)
    assert np.linalg.norm(ways, axis=2).max() < 0.01 * arm.length
    np.testing.assert_allclose(ways[1:], ways[:-1], atol=0.1 * np.linalg.norm(ways, axis=2).max())


def test_a_search_that_is_cut_short_is_undecided(heavy, monkeypatch):
    """Nothing is said of what was not followed to its end."""
    gamma = np.array([[-0.72288394, -0.72127314, -4.22473062]])
    monkeypatch.setattr(flood, "_MOST_STEPS", 1)
    found = heavy.solver.empty(1)
    Postures(heavy.solver).by_line(gamma, np.array([0]), found)
    assert found.status[0] == TipStatus.UNDECIDED
    assert np.isnan(found.tips).all()


# Laws of rods under loads so heavy that tangents swing or grow far along the arm


CYLINDER, STIFF_TRUNK = designs.minimal_trunk(taper=0.0), designs.minimal_trunk()
REST = np.zeros((1, 3))
NOTHING = (0.0, 0.0, 0.0)


def held(arm):
    """The arm with every activation bound to zero, so that its tip asks for few steps."""
    return arm.with_bounds(np.zeros((arm.bundles, 2)))


@pytest.mark.parametrize(
    ("arm", "follower", "numbers"),
    [
        (CYLINDER, 0.0, (4.0, 12.0, 20.0, 60.0)),
        (STIFF_TRUNK, 0.0, (4.0, 12.0, 20.0, 60.0)),
        (CYLINDER, 1e-9, (4.0, 12.0, 20.0, 45.0)),
    ],
    ids=["cylinder", "trunk", "in space"],
)
def test_no_upright_arm_stands_again_under_more_load(arm, follower, numbers):
    """However few steps its tip asks for, and however many conjugate points are within.

    A force that vanishes has the whole frame walked.
    """
    for load in numbers:
        rod = LoadedRod(held(weighed(arm, load, follower_force=(0.0, 0.0, follower))), 1e-6)
        assert rod.tables.one_direction == (follower == 0.0)
        assert rod.status(REST)[0] == TipStatus.UNSTABLE


def test_the_phase_of_a_tip_force_is_its_closed_form():
    """√(F/K) L for K1 > K3, without axial yield; steps make no more than π/2 of it."""
    loads = Loads(gravity=NOTHING, tip_force=(3.0, 0.0, 4.0))
    body = uniform(4.0, torsion=2.0)
    phase = straight(body, loads).tables.phase
    assert phase.entire == pytest.approx(np.sqrt(5.0 / 2.0))
    assert phase.steepest == pytest.approx(phase.entire)
    for force in (50.0, 500.0):
        heavy = loads.replace(tip_force=(0.0, 0.0, force))
        phase = straight(body, heavy).tables.phase
        assert phase.entire / phase.fewest_steps <= np.pi / 2
        assert phase.entire / (phase.fewest_steps - 1) > np.pi / 2


@pytest.mark.parametrize("arm", [CYLINDER, STIFF_TRUNK], ids=["cylinder", "trunk"])
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
    assert (np.diff(np.array([phase[:2] for phase in phases]), axis=0) > 0).all()


@pytest.mark.parametrize(
    "loads",
    [
        Loads(tip_force=(0.0, 0.0, 1e9)),
        Loads(tip_force=(1e9, 0.0, 0.0)),
        Loads(gravity=(0.0, 0.0, 1e14), payload=1.0),
        Loads(tip_moment=(0.0, 1e14, 0.0)),
        Loads(follower_force=(0.0, 1e9, 0.0)),
    ],
)
def test_loads_that_no_walk_can_follow_are_refused_in_one_line(loads):
    rod = LoadedRod(designs.lce_arm().replace(loads=loads), 1e-6)
    with pytest.raises(InvalidInput, match=r"loads = of load number .* lighter") as refused:
        rod.status(rod.box.corners())
    assert "\n" not in str(refused.value)
    with pytest.raises(InvalidInput, match="loads"):
        strain_ranges(as_tip_map(rod), np.zeros(1))


def stubby(share):
    """A thick cylinder pressed by a share of K0."""
    arm = designs.minimal_trunk(taper=0.0, length=0.2)
    arm = arm.replace(profile=arm.profile.replace(outer_radius=0.1))
    rod = LoadedRod(rubber(arm, Loads(gravity=NOTHING)), 1e-6)
    force = share / float(compliance(rod.arm, np.zeros(1))[0][0])
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
    assert np.isnan(found.tips).all()


@pytest.mark.large
def test_steps_of_an_arm_that_never_rests_are_no_fewer_than_those_of_the_free_one():
    arm = stubby(1.5).arm
    rod = LoadedRod(arm.with_bounds(np.full((3, 2), [-1e-3, 0.0])), 1e-4)
    assert not has_tip(rod.status(rod.box.corners())).any()
    assert rod.steps >= FreeRod(rod.arm, 1e-4).steps
    with pytest.raises(InvalidInput, match="has an equilibrium"):
        strain_ranges(as_tip_map(rod), np.array([0.1]))


def test_steps_that_are_not_found_are_not_searched_again(monkeypatch):
    searches = []
    find = Postures.find

    def counted(postures, gamma):
        searches.append(postures.solver.steps)
        return find(postures, gamma)

    monkeypatch.setattr(Postures, "find", counted)
    monkeypatch.setattr(loaded_rod, "_MOST_STEPS", 4)
    rod = LoadedRod(weighed(STIFF_TRUNK, 2.5, (9.81, 0.0, 0.0)), 1e-9)
    for _ in range(2):
        with pytest.raises(InvalidInput, match="reachable within 4 steps"):
            _ = rod.steps
    assert searches == [4]


def test_a_few_activations_near_the_loss_of_stability_do_not_choose_the_steps(monkeypatch):
    """Nor do they have a design refused."""
    rod = LoadedRod(weighed(STIFF_TRUNK, 2.5, (9.81, 0.0, 0.0)), 1e-6)
    expected = rod.steps
    judged = loaded_rod.tip_differences

    def magnified(solver, gamma, known):
        found = judged(solver, gamma, known)
        found[:: max(101, len(found) // 4)] = 1e-2
        return found

    again = LoadedRod(rod.arm, 1e-6)
    monkeypatch.setattr("softreach.rod.loaded.rod.tip_differences", magnified)
    assert again.steps == expected
