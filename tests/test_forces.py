"""Laws of the blocked force: what balances it, what ends it, and that none is larger."""

from functools import cache
from itertools import product

import numpy as np
import pytest
from scipy.optimize import OptimizeResult, minimize

import softreach as sr
from softreach import plot
from softreach.arm.loads import Loads
from softreach.cli.app import run
from softreach.forces import Stop, blocked_force
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.solver import Solver
from softreach.rod.loaded.tables import LoadTables
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipStatus
from softreach.stiffness import tip_compliance
from softreach.support.errors import InvalidDesign, InvalidInput
from softreach.workspace.payload import payload_curve
from tests.bodies import rubber

FREE = sr.designs.lce_arm()
LOADED = FREE.replace(loads=Loads(gravity=(0, 0, 9.81), payload=0.002))
MANY = rubber(sr.designs.redundant_trunk(), Loads(gravity=(9.81, 0.0, 0.0)))
START = np.array([[-1.0, -2.5, -0.5], [-0.5, -0.5, -3.0]])
MANY_START = np.array([[-0.9, -0.2, -0.6, -0.5]])
UP, SIDE = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)


def under(arm, force, tol=1e-8):
    loads = arm.loads or Loads(gravity=(0.0, 0.0, 0.0))
    return as_tip_map(arm.replace(loads=loads.replace(tip_force=tuple(force))), tol)


@cache
def blocked(arm, direction, first):
    return blocked_force(arm, None, direction, start=START[first:])


@pytest.mark.parametrize(
    ("arm", "direction", "first"),
    [  # the growth from the first start ends where the shape is singular, and takes longest
        pytest.param(arm, direction, first, marks=() if first else pytest.mark.large)
        for arm, direction, first in product((FREE, LOADED), (UP, SIDE), (1, 0))
    ],
)
def test_the_force_balances_the_tip_at_its_place(arm, direction, first):
    found = blocked(arm, direction, first)
    places = sr.tip_positions(arm, START[first:])
    np.testing.assert_allclose(found.position, places, atol=1e-15)
    assert found.settles.values.any()
    for k in np.flatnonzero(found.settles.values):
        rod, gamma = under(arm, found.tip_force.values[k]), found.activation.values[k : k + 1]
        apart = np.linalg.norm(rod.tips(gamma)[0] - places[k])
        if direction == SIDE:  # an arm that is hung under a force upward leans first
            assert apart <= 2e-6 * arm.length
            assert rod.status(gamma)[0] == TipStatus.STABLE
        assert (rod.box.excess(gamma) <= 0).all()
    assert (found.force.values > 0).all()


def test_where_no_linear_program_is_solved_the_search_is_unfinished(monkeypatch):
    def unsolved(*args, **options):
        return OptimizeResult(x=None, lower=OptimizeResult(marginals=None))

    monkeypatch.setattr("scipy.optimize.linprog", unsolved)
    found = blocked_force(LOADED, None, SIDE, start=START[:1])
    assert found.status.values.tolist() == [Stop.UNFINISHED]
    assert found.force.values.tolist() == [0.0]
    assert np.isnan(found.force_error.values).all()
    assert not found.limit.values.any()


@pytest.mark.parametrize("first", [1, pytest.param(0, marks=pytest.mark.large)])
def test_the_bundles_named_are_at_their_bounds(first):
    found = blocked(LOADED, SIDE, first)
    bound = found.status.values == Stop.BOUND
    assert bound.any()
    gamma, low, high = found.activation.values, *LOADED.bounds.T
    at = np.minimum(np.abs(gamma - low), np.abs(gamma - high)) < 1e-8 * (high - low)
    limit = found.limit.values
    assert (limit <= at).all()
    np.testing.assert_array_equal(limit.any(axis=1), bound)


def test_the_force_begins_to_grow_by_the_compliance():
    """dγ/dF = J⁻¹C d: two narrow boxes around the start let the force grow in proportion."""
    gamma = START[:1]
    slope = as_tip_map(LOADED).tips_and_slopes(gamma)[1][0]
    rate = np.linalg.solve(slope, tip_compliance(LOADED, gamma)[0] @ SIDE)
    width = 1e-3
    narrow = LOADED.with_bounds(np.stack([gamma[0] - width, gamma[0] + width], axis=1))
    found = blocked_force(narrow, None, SIDE, start=gamma)
    assert float(found.force[0]) == pytest.approx(width / np.abs(rate).max(), rel=1e-2)
    assert found.limit.values[0].argmax() == np.abs(rate).argmax()


def largest_by_optimizer(arm, place, direction, gamma, force):
    """The largest force by a general optimizer on tips, from a given start at nine tenths."""
    d, width, rod = np.array(direction), np.ptp(arm.bounds, axis=1), as_tip_map(arm)

    def gap(x):
        acting = tuple(np.array(arm.loads.tip_force) - x[-1] * force * d)
        tables = LoadTables(arm=arm.replace(loads=arm.loads.replace(tip_force=acting)))
        gamma = arm.bounds[:, 0] + x[:-1] * width
        found = Postures(Solver(tables, 2 * rod.steps, rod.tol)).find(gamma[None])
        return (found.tips[0] - place) / arm.length

    start = np.append((gamma - arm.bounds[:, 0]) / width, 0.9)
    found = minimize(
        lambda x: -x[-1],
        start,
        method="SLSQP",
        bounds=[(0.0, 1.0)] * arm.bundles + [(0.0, 1.5)],
        constraints={"type": "eq", "fun": gap},
        options={"ftol": 1e-8, "maxiter": 12},
    )
    return found.x[-1] * force if np.linalg.norm(gap(found.x)) < 1e-6 else 0.0


@pytest.mark.parametrize(("arm", "start"), [(LOADED, START[1:]), (MANY, MANY_START)])
def test_no_optimizer_finds_a_larger_force(arm, start):
    found = blocked_force(arm, None, SIDE, start=start)
    assert found.settles.values[0]
    force = float(found.force[0])
    place, end = found.position.values[0], found.activation.values[0]
    other = largest_by_optimizer(arm, place, SIDE, end, force)
    assert other == pytest.approx(force, rel=1e-3)
    assert other <= force * (1 + 1e-4)


def test_it_is_the_largest_over_all_activations_that_reach_the_place():
    place = sr.tip_positions(LOADED, START[1:])
    solution = sr.solve_inverse(LOADED, place)[0]
    places = np.repeat(place, len(solution), 0)
    every = blocked_force(LOADED, places, UP, start=solution.activations)
    best = blocked_force(LOADED, place, UP)
    assert float(best.force[0]) == pytest.approx(float(every.force.max()), rel=1e-6)


def test_what_cannot_be_asked_is_refused_in_one_line():
    two = LOADED.with_bounds([(-5.0, 0.0), (-5.0, 0.0), (-1.0, -1.0)])
    with pytest.raises(InvalidInput, match="free bundles = 2: must be 3 or more"):
        blocked_force(two, None, UP, start=[-1.0, -1.0, -1.0])
    with pytest.raises(InvalidInput, match="places = None: must be given, or `start`"):
        blocked_force(LOADED, None, UP)
    with pytest.raises(InvalidInput, match="direction"):
        blocked_force(LOADED, None, (0, 0, 0), start=START)
    with pytest.raises(InvalidInput, match="start"):
        blocked_force(LOADED, [[0.0, 0.0, 0.08]], UP, start=[[0.0, 0.0]])
    with pytest.raises(InvalidDesign, match="young_modulus"):
        blocked_force(sr.designs.minimal_trunk(), None, UP, start=[-1.0, -1.0, -1.0])


def test_a_place_out_of_reach_has_no_force():
    found = blocked_force(LOADED, [[0.0, 0.0, 1.0]], UP)
    assert found.status.values[0] == Stop.NO_START
    assert np.isnan(found.force.values[0])


# Laws of the volume against the payload


HANGING = sr.designs.lce_arm().replace(loads=Loads(gravity=(0, 0, 9.81)))


@pytest.fixture(scope="module")
def curve():
    return payload_curve(HANGING, [0.002, 0.001], accuracy=0.02)


def test_a_curve_has_the_exact_volumes_and_begins_without_payload(curve):
    np.testing.assert_array_equal(curve.payloads, [0.0, 0.001, 0.002])
    for mass, volume in zip(curve.payloads, curve.volumes, strict=True):
        carrying = HANGING.replace(loads=HANGING.loads.replace(payload=float(mass)))
        assert volume == sr.reachable_set(carrying, accuracy=0.02).volume
    assert curve.shares[0] == 1.0
    assert (np.diff(curve.shares) < 0).all()


def test_the_payload_of_the_design_itself_does_not_count(curve):
    laden = HANGING.replace(loads=HANGING.loads.replace(payload=0.001))
    other = payload_curve(laden, [0.002], accuracy=0.02)
    np.testing.assert_array_equal(other.volumes, curve.volumes[[0, 2]])


def test_the_largest_payload_keeps_just_the_share(curve):
    found = curve.largest_payload(0.85)
    assert found.payload_error <= 0.02 * found.payload
    for sign in (-1, 1):
        mass = found.payload + sign * (found.payload_error + 1e-5)
        carrying = HANGING.replace(loads=HANGING.loads.replace(payload=mass))
        share = sr.reachable_set(carrying, accuracy=0.02).volume / curve.volumes[0]
        assert (share < 0.85) == (sign > 0)


def test_a_share_below_those_of_the_curve_is_looked_for_under_heavier_payloads():
    short = payload_curve(HANGING, [0.0005], accuracy=0.02)
    assert short.largest_payload(0.85).payload == pytest.approx(0.0015, abs=2e-4)


def test_numbers_of_a_curve_are_stored_with_their_errors_and_units(curve):
    stored = curve.to_dataset()
    assert stored.payload.attrs["units"] == "kg"
    np.testing.assert_array_equal(stored["share"], curve.shares)
    assert (stored["share_error"][1:] > 0).all()
    assert "without payload" in repr(curve)


def test_what_has_no_such_curve_is_refused_in_one_line(curve):
    with pytest.raises(InvalidInput, match="loads = None: must be Loads with gravity"):
        payload_curve(sr.designs.lce_arm())
    with pytest.raises(InvalidInput, match="payloads"):
        payload_curve(HANGING, [-1.0])
    with pytest.raises(InvalidInput, match="free bundles = 2"):
        payload_curve(HANGING.with_bounds([(-5, 0), (-5, 0), (-1, -1)]))
    with pytest.raises(InvalidInput, match="share = 1"):
        curve.largest_payload(1.0)
    with pytest.raises(InvalidDesign, match="young_modulus"):
        payload_curve(sr.designs.minimal_trunk().replace(loads=Loads()))


def test_the_figure_has_the_shares_and_the_largest_payload(curve):
    pytest.importorskip("matplotlib")
    largest = curve.largest_payload(0.85)
    ax = plot.plot_payload_curve(curve, largest=[largest])
    line = ax.lines[0].get_xydata()
    assert [largest.payload, 0.85] in line.tolist()
    for point in zip(curve.payloads, curve.shares, strict=True):
        assert list(point) in line.tolist()


def test_the_command_says_the_largest_payload(capsys, printed):
    command = "payload lce_arm --gravity up --payloads 1g,2g --share 0.85 --accuracy 0.02"
    found = printed(*command.split())
    assert found["largest_payload_kg"] == pytest.approx(0.0015, abs=2e-4)
    assert found["payload_kg"] == [0.0, 0.001, 0.002]
    assert found["share"][0] == 1.0
    assert 0 < found["share_error"][1] < 0.05
    own = "payload lce_arm --payload 3g --gravity up --payloads 1g --accuracy 0.1"
    assert run(own.split()) == 0
    assert "take the place of the design's own payload, 0.003 kg" in capsys.readouterr().out
    assert run(["payload", "lce_arm"]) == 2
    assert "this design has no loads; add --gravity down" in capsys.readouterr().err
