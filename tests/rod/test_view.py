"""A view of a tip map has the numbers of the map, and finds each equilibrium once."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.loads import Loads
from softreach.rod.free import FreeRod
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.solver import Solver
from softreach.rod.rods import refined
from softreach.rod.tip_map import TipStatus
from softreach.rod.view import View, free_bundles, measured_bundles, stable_tips
from tests.bodies import rubber
from tests.laws import in_box

TRUNK = designs.minimal_trunk().with_bounds(((-5 / 3, 0), (-0.5, -0.5), (-5 / 3, 0)))
YOUNG = 1000 * 9.81 / (12.0 * TRUNK.profile.outer_radius**2)
HEAVY = rubber(TRUNK, Loads(gravity=(0.0, 0.0, -9.81)), young=YOUNG)


@pytest.fixture(scope="module")
def heavy() -> LoadedRod:
    rod = LoadedRod(HEAVY)
    rod.prepare()
    return rod


@pytest.mark.parametrize(
    "ask",
    [
        lambda rod, x: rod.tips(x),
        lambda rod, x: rod.tips_and_slopes(x),
        lambda rod, x: rod.tip_twists(x),
        lambda rod, x: rod.tip_motions(x),
        lambda rod, x: rod.frames(x, [0.5, 1.0]),
        lambda rod, x: rod.strains(x, [0.5]),
    ],
    ids=["tips", "slopes", "twists", "motions", "frames", "strains"],
)
def test_each_equilibrium_of_stable_tips_is_found_once(heavy, ask, monkeypatch):
    direct, found = Solver.direct, []
    x = in_box(HEAVY, 20)
    ask(stable_tips(heavy), x)  # what all samples need is there now

    def counted(solver, gamma, equilibria):
        found.append(len(gamma))
        direct(solver, gamma, equilibria)

    monkeypatch.setattr(Solver, "direct", counted)
    ask(stable_tips(heavy), x)
    assert sum(found) == len(x)


def test_stable_tips_are_those_of_the_map_where_it_is_stable(heavy):
    x = in_box(HEAVY, 200)
    tips, status = heavy.tips_and_status(x)
    stable = status == TipStatus.STABLE
    view = stable_tips(heavy)
    np.testing.assert_array_equal(view.tips(x), np.where(stable[:, None], tips, np.nan))
    assert set(view.status(x).tolist()) <= {TipStatus.STABLE, TipStatus.NO_EQUILIBRIUM}
    for values in (*view.tip_motions(x), *view.frames(x, [0.5]), *view.strains(x, [0.5])):
        np.testing.assert_array_equal(np.isnan(values.reshape(len(x), -1)).all(axis=1), ~stable)


def test_views_of_views_are_views_of_the_map_itself(heavy):
    view = free_bundles(stable_tips(free_bundles(heavy)))
    assert isinstance(view, View)
    assert view.base is heavy
    assert view == stable_tips(free_bundles(heavy)) == free_bundles(stable_tips(heavy))
    assert stable_tips(view) is view
    assert free_bundles(view) is view
    assert measured_bundles(view) is view
    fine = refined(view, 1e-7)
    assert (fine.tol, fine.box) == (1e-7, view.box)


def test_what_all_samples_need_is_computed_once_for_all_threads(monkeypatch):
    rod, begun = FreeRod(TRUNK, 3.3e-7), []
    prepare = FreeRod._prepare

    def counted(rod):
        begun.append(rod)
        prepare(rod)

    monkeypatch.setattr(FreeRod, "_prepare", counted)
    threads = [threading.Thread(target=rod.prepare) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(begun) == 1
