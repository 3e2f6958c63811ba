"""Laws of all equilibria: none is missing, and stable ones are minima of the energy."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import softreach as sr
from softreach.arm.loads import PointLoad
from softreach.rod import TipStatus, free_bundles, tip_map
from softreach.rod.loaded import all_equilibria as equilibria_by_degree
from softreach.rod.view import stable_tips
from tests.bodies import oracle_rod, rubber
from tests.oracles import column
from tests.oracles.chain import Chain

TRUNK = sr.designs.minimal_trunk()
UP, SIDE, DOWN = (0.0, 0.0, -9.81), (9.81, 0.0, 0.0), (0.0, 0.0, 9.81)
STABLE = TipStatus.STABLE
BENT = np.array([-0.3, -0.5, -1.0])


def trunk(load, gravity=UP, arm=TRUNK, **loads):
    """The paper's trunk at a load number ρgL³/(E R2²)."""
    young = 1000 * 9.81 / (load * TRUNK.profile.outer_radius**2)
    return rubber(arm, sr.Loads(gravity=gravity, **loads), young=young)


@pytest.mark.parametrize("gravity", [UP, SIDE, DOWN], ids=["up", "side", "down"])
@pytest.mark.parametrize(("load", "most"), [(0.5, 1), (12.0, 5)])
def test_their_number_is_odd_and_one_is_the_branch_of_the_unloaded_arm(gravity, load, most):
    arm = trunk(load, gravity)
    for gamma in np.random.default_rng(0).uniform(-5 / 3, 0, (3, 3)):
        every, branch = sr.equilibria(arm, gamma), tip_map(arm).equilibria(gamma[None])
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
    ("load", "starts"), [(12.0, 30), pytest.param(25.0, 60, marks=pytest.mark.large)]
)
def test_no_random_start_of_a_chain_of_links_comes_to_another(load, starts):
    """Newton's method on the energy of a chain, from shapes with random bending."""
    arm = trunk(load)
    every = sr.equilibria(arm, BENT)
    chain = Chain(*oracle_rod(arm, every.rod.body, BENT, arm.loads), 20)
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


@pytest.mark.parametrize(
    ("load", "gravity"), [(12.0, UP), pytest.param(25.0, UP, marks=pytest.mark.large), (25.0, SIDE)]
)
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
    chain = Chain(*oracle_rod(rod.arm, rod.body, every.activation, rod.arm.loads), links)
    many = np.repeat(every.activation[None], len(every), axis=0)
    shapes = every.solver.shapes_facing(many, every.directions, chain.joints)[0]
    frames, moments = shapes.frames.directors, shapes.moment
    for frame, moment in zip(frames, moments, strict=True):
        fixed = np.einsum("sij,si->sj", frame, moment)
        q = chain.near(SimpleNamespace(frame=frame, moment=fixed))
        yield chain.softest(chain.solve(q))[:6]


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


def test_turning_gravity_and_the_arm_changes_nothing_but_the_directions():
    tilt = np.radians(20)
    there = trunk(25.0, (9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt)))
    back = trunk(25.0, (-9.81 * np.sin(tilt), 0.0, -9.81 * np.cos(tilt)))
    one, other = (sr.equilibria(arm, np.zeros(3)) for arm in (there, back))
    np.testing.assert_allclose(one.tips * [-1, 1, 1], other.tips, atol=1e-6)
    np.testing.assert_array_equal(one.status, other.status)


@pytest.mark.parametrize("restrict", [free_bundles, stable_tips])
def test_those_of_a_view_are_those_of_the_arm(restrict):
    arm = trunk(12.0, arm=TRUNK.with_bounds([(-5 / 3, 0), (-0.5, -0.5), (-5 / 3, 0)]))
    whole, gamma = tip_map(arm), np.array([-0.03, -0.5, -0.1])
    expected = sr.equilibria(whole, gamma)
    assert len(expected) == 3
    rod = restrict(whole)
    every = sr.equilibria(rod, gamma[whole.box.free] if rod.box.bundles == 2 else gamma)
    np.testing.assert_array_equal(every.tips, expected.tips)
    np.testing.assert_array_equal(every.activation, gamma)
    assert every.to_dataset().bundle.values.tolist() == list(arm.bundle_names)


def test_an_arm_without_loads_has_one():
    every = sr.equilibria(TRUNK, BENT[None])
    np.testing.assert_array_equal(every.tips, sr.tip_positions(TRUNK, BENT[None]))
    assert (every.degree, every.followed, every.complete) == (1, 0, True)
    assert every.status.tolist() == [STABLE]
    assert every.configuration(5).sizes["sample"] == 1


def test_loads_that_weigh_nothing_leave_one():
    every = sr.equilibria(trunk(5.0, (0.0, 0.0, 0.0)), BENT)
    np.testing.assert_allclose(every.tips, sr.tip_positions(TRUNK, BENT[None]), atol=1e-6)


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


def test_one_activation_is_asked_at_a_time():
    with pytest.raises(sr.InvalidInput, match="one activation at a time"):
        sr.equilibria(trunk(2.5), np.zeros((2, 3)))


def test_what_may_be_missing_is_said(monkeypatch):
    monkeypatch.setattr(equilibria_by_degree, "sphere_roots", _without_the_last)
    with pytest.warns(sr.errors.SoftreachWarning, match="degree of those found is 2"):
        every = sr.equilibria(trunk(25.0), BENT)
    assert not every.complete
    assert every.degree != 1
    assert "may be missing" in repr(every)


def _without_the_last(*args, **options):
    from softreach.geometry import sphere_maps as sphere_roots

    roots, cut = sphere_roots.sphere_roots(*args, **options)
    kept = np.sort(np.argsort(roots.determinants)[1:])
    return sphere_roots.Roots(roots.points[kept], roots.determinants[kept]), cut


def test_all_numbers_are_in_a_dataset():
    every = sr.equilibria(trunk(12.0), BENT)
    data = every.to_dataset()
    np.testing.assert_array_equal(data.tip, every.tips)
    assert data.attrs["degree"] == 1
    assert int(data.is_followed.values.argmax()) == every.followed
    assert f"{len(every)}, of which 1 stable" in repr(every)
