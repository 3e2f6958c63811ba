"""An arm whose tip is dragged follows on its branch, and stays as near as that leads."""

import numpy as np
import pytest
import xarray as xr

import softreach as sr
from softreach.arm import designs
from softreach.arm.parameters import changed
from softreach.inverse.path import Drag, PathStatus, end_text
from softreach.rod.rods import as_tip_map
from softreach.rod.tip_map import TipStatus

TRUNK = designs.minimal_trunk()
START = (-0.7, -0.4, -0.9)


def tip_of(arm, activation):
    return sr.tip_positions(arm, [activation])[0]


def dragged(arm, start, places):
    """What each of the steps leads to, one after the other."""
    drag, activation, found = Drag(arm), start, []
    for place in places:
        found.append(drag.to(activation, np.asarray(place)))
        activation = found[-1].activation
    return found


def way(begin, end, steps=12):
    return begin + np.linspace(0, 1, steps + 1)[1:, None] * (end - begin)


def test_within_reach_the_tip_is_where_it_is_pulled_to_on_the_same_branch():
    begin, end = tip_of(TRUNK, START), tip_of(TRUNK, (-0.5, -0.6, -0.7))
    found = dragged(TRUNK, START, way(begin, end))
    path = sr.track_path(TRUNK, [begin, *way(begin, end)], START)
    assert (path.status == 0).all()
    np.testing.assert_allclose(
        [one.activation for one in found], path.activation.values[1:], atol=1e-6
    )
    assert all(one.gap == 0.0 for one in found)


@pytest.mark.parametrize("target", [(0.9, 0.2, 0.9), (0.0, -0.9, 0.5), (0.1, 0.1, 1.3)])
def test_beyond_the_boundary_no_small_change_brings_the_tip_nearer(target):
    begin = tip_of(TRUNK, START)
    last = dragged(TRUNK, START, way(begin, np.array(target)))[-1]
    assert last.gap == pytest.approx(np.linalg.norm(last.tip - target))
    assert last.gap >= sr.solve_inverse(TRUNK, [target])[0].gap - 1e-9
    rng = np.random.default_rng(0)
    around = np.array(last.activation) + 1e-3 * rng.standard_normal((200, 3))
    around = np.clip(around, *TRUNK.bounds.T)
    gaps = np.linalg.norm(sr.tip_positions(TRUNK, around) - target, axis=1)
    assert gaps.min() >= last.gap - 1e-8


@pytest.mark.parametrize("target", [(0.9, 0.2, 0.9), (0.0, -0.9, 0.5), (0.1, 0.1, 1.3)])
def test_from_beyond_the_boundary_the_arm_comes_back_on_its_branch(target):
    begin = tip_of(TRUNK, START)
    there = way(begin, np.array(target))
    last = dragged(TRUNK, START, [*there, *there[::-1], begin])[-1]
    assert last.gap == 0.0
    np.testing.assert_allclose(last.activation, START, atol=1e-6)


def test_with_more_bundles_than_needed_activations_change_little_at_every_pull():
    arm = designs.redundant_trunk()
    start = tuple(0.3 * arm.bounds[:, 0])
    begin = tip_of(arm, start)
    end = begin + [0.1, 0.05, 0.02]
    found = dragged(arm, start, way(begin, end, 40))
    assert all(one.gap == 0.0 for one in found)
    steps = np.diff([start, *(one.activation for one in found)], axis=0)
    motions = np.full(len(steps), np.linalg.norm(end - begin) / len(steps))
    assert np.linalg.norm(steps, axis=1).max() < 20 * motions.max()
    assert (np.array(found[-1].activation) >= arm.bounds[:, 0]).all()


def test_with_two_free_bundles_the_tip_stays_on_the_surface_that_they_reach():
    arm = changed(TRUNK, {"longitudinal.lower": 0.0, "longitudinal.upper": 0.0})
    start = (-0.5, -0.3, 0.0)
    begin = tip_of(arm, start)
    (found,) = dragged(arm, start, [begin + [0.02, -0.03, 0.04]])
    assert 0 < found.gap < np.linalg.norm([0.02, -0.03, 0.04])
    assert found.activation[2] == 0.0
    (back,) = dragged(arm, found.activation, [begin])
    assert back.gap < 1e-6


def test_a_loaded_arm_is_led_through_stable_equilibria_alone():
    arm = designs.lce_arm().replace(loads=sr.Loads(gravity=(0.0, 0.0, -9.81)))
    start = tuple(0.3 * arm.bounds[:, 0])
    begin = tip_of(arm, start)
    found = dragged(arm, start, way(begin, begin + [0.06, 0.0, 0.05], 6))
    status = as_tip_map(arm, 1e-6).status([one.activation for one in found])
    assert (status == TipStatus.STABLE).all()
    assert found[0].gap == 0.0


@pytest.mark.parametrize("end", [status for status in PathStatus if status > 0])
def test_every_end_of_a_path_is_said_in_words(end):
    status = "point", [PathStatus.FOLLOWED, end]
    known = {"status": status, "end_length": 0.2, "end_length_error": 1e-3}
    about = {"end": end.name.lower(), "end_bundle": "left", "end_bound": "lower"}
    text = end_text(xr.Dataset(known, attrs=about), TRUNK.length_unit)
    assert text.endswith(".")
    assert "{" not in text
