"""A view of a tip map has the numbers of the map, and finds each equilibrium once."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import softreach as sr
from softreach.arm import (
    FiberArchitecture,
    LinearTaper,
    Manipulator,
    Material,
    Ring,
    Section,
    designs,
)
from softreach.rod.free import FreeRod
from softreach.rod.loaded.postures import Postures
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.rods import as_tip_map, free_bundles, measured_bundles, refined, with_unstable
from softreach.rod.tip_map import TipStatus
from tests.bodies import weighed
from tests.laws import in_box

TRUNK = designs.minimal_trunk().with_bounds(((-5 / 3, 0), (-0.5, -0.5), (-5 / 3, 0)))
HEAVY = weighed(TRUNK, 12.0)


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
    direct, found = Postures.direct, []
    x = in_box(HEAVY, 20)
    ask(as_tip_map(heavy), x)  # what all samples need is there now

    def counted(postures, gamma, rows, equilibria):
        found.append(len(gamma[rows]))
        direct(postures, gamma, rows, equilibria)

    monkeypatch.setattr(Postures, "direct", counted)
    ask(as_tip_map(heavy), x)
    assert sum(found) == len(x)


def test_stable_tips_are_those_of_the_map_where_it_is_stable(heavy):
    x = in_box(HEAVY, 200)
    tips, status = heavy.tips_and_status(x)
    stable = status == TipStatus.STABLE
    view = as_tip_map(heavy)
    np.testing.assert_array_equal(view.tips(x), np.where(stable[:, None], tips, np.nan))
    np.testing.assert_array_equal(view.status(x), status)
    np.testing.assert_array_equal(with_unstable(view).tips(x), tips)
    for values in (*view.tip_motions(x), *view.frames(x, [0.5]), *view.strains(x, [0.5])):
        np.testing.assert_array_equal(np.isnan(values.reshape(len(x), -1)).all(axis=1), ~stable)


def test_views_of_views_are_views_of_the_map_itself(heavy):
    view = free_bundles(free_bundles(heavy))
    assert view.rod is heavy
    assert view == free_bundles(heavy) != with_unstable(view)
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


# Laws of segments: straight where nothing acts, and end to end as arms of their own


SECTION = Section(
    rings=(Ring(inner_ratio=0.8, material=Material(young_modulus=1e6, poisson_ratio=0.45)),),
    core=Material(young_modulus=2e5),
)


@given(start=st.floats(0.0, 0.5), width=st.floats(0.2, 0.5), revolution=st.floats(-2, 2))
def test_outside_its_stretch_a_segment_is_straight(start, width, revolution):
    fiber = FiberArchitecture(
        revolution=revolution,
        extent=0.8,
        start_over_length=start,
        end_over_length=start + width,
        activation_bounds=(-0.8, 0),
    )
    profile = LinearTaper(length=1.0, outer_radius=0.06, taper=0.01)
    arm = Manipulator(profile=profile, section=SECTION, actuators=(fiber,))
    end = start + width
    z = np.array([0.0, 0.5 * start, start, end, 0.5 * (end + 1.0), 1.0])
    shape = sr.configuration(arm, [-0.7], z, tol=1e-9)
    frames, places = shape.directors.values, shape.position.values
    np.testing.assert_allclose(frames[:3], np.broadcast_to(np.eye(3), (3, 3, 3)), atol=1e-13)
    np.testing.assert_allclose(places[:3], z[:3, None] * [0, 0, 1], atol=1e-13)
    np.testing.assert_allclose(frames[3:], np.broadcast_to(frames[3], (3, 3, 3)), atol=1e-13)
    beyond = places[3] + (z[3:, None] - end) * frames[3, 2]
    np.testing.assert_allclose(places[3:], beyond, atol=1e-13)


@pytest.mark.parametrize("cut", [0.25, 0.6])
def test_two_segments_in_series_are_two_arms_end_to_end(cut):
    profile = LinearTaper(length=1.0, outer_radius=0.06, taper=0.02)
    lower = FiberArchitecture(
        name="lower", helical_angle=0.3, extent=0.8, end_over_length=cut, bundles=2
    )
    upper = FiberArchitecture(
        name="upper", helical_angle=-0.5, extent=0.6, offset=1.0, start_over_length=cut
    )
    gamma = np.array([-0.5, -0.2, -0.6])
    whole = Manipulator(profile=profile, section=SECTION, actuators=(lower, upper))
    below = Manipulator(
        profile=profile.replace(length=cut),
        section=SECTION,
        actuators=(lower.replace(end_over_length=1.0),),
    )
    above = Manipulator(
        profile=profile.replace(length=1 - cut, outer_radius=float(profile.radius(cut))),
        section=SECTION,
        actuators=(upper.replace(start_over_length=0.0),),
    )
    base = sr.configuration(below, gamma[:2], [below.length], tol=1e-11)
    end = sr.configuration(above, gamma[2:], [above.length], tol=1e-11)
    expected = base.position.values[0] + end.position.values[0] @ base.directors.values[0]
    np.testing.assert_allclose(sr.tip_positions(whole, [gamma], tol=1e-11)[0], expected, atol=1e-10)
