"""Laws of the activation box: to the unit cube and back, bounds, margins, corners."""

from __future__ import annotations

import dataclasses
import itertools

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from softreach.rod.inputs import ActivationBox
from softreach.support.errors import InvalidInput

# Differences of these do not overflow; subnormal numbers and zeros of both signs are among them.
ends = st.floats(-1e150, 1e150)

shares = st.floats(0, 1)


@st.composite
def boxes(draw: st.DrawFn, ends: st.SearchStrategy[float] = ends) -> ActivationBox:
    """Any box, some of its bundles held."""
    bounds = draw(st.lists(st.tuples(ends, ends).map(sorted), min_size=1, max_size=4))
    return ActivationBox.between(bounds, [f"bundle {k}" for k in range(len(bounds))])


def points(box: ActivationBox, elements: st.SearchStrategy[float] = shares):
    return hnp.arrays(float, st.tuples(st.integers(0, 4), st.just(box.bundles)), elements=elements)


@given(st.data(), boxes())
def test_the_image_of_the_cube_is_never_outside_the_bounds(data, box):
    cube = data.draw(points(box))
    gamma = box.from_cube(cube)
    assert (gamma >= box.low).all()
    assert (gamma <= box.high).all()
    np.testing.assert_array_equal(box.from_cube(cube, out=cube), gamma)
    assert gamma is not cube


@given(st.data(), boxes())
def test_the_way_to_the_cube_undoes_the_way_from_it(data, box):
    assume((box.widths[box.free] > 1e-290).all())
    cube = data.draw(points(box))
    size = np.maximum(np.abs(box.low), np.abs(box.high))
    back = box.to_cube(box.from_cube(cube))
    rounding = 4 * np.finfo(float).eps * (1 + size / box.scales)
    assert (np.abs(back - np.where(box.is_free, cube, 0.0)) <= rounding).all()
    gamma = box.clip(data.draw(points(box, ends)))
    again = box.from_cube(box.to_cube(gamma))
    np.testing.assert_allclose(again, gamma, rtol=0, atol=(8 * np.finfo(float).eps * size).max())


@given(st.data(), boxes())
def test_held_bundles_stay_where_they_are(data, box):
    held = ~box.is_free
    gamma = box.from_cube(data.draw(points(box)))
    np.testing.assert_array_equal(
        gamma[:, held], np.broadcast_to(box.low[held], gamma[:, held].shape)
    )
    few = data.draw(hnp.arrays(float, (3, box.dimension), elements=st.floats(0, 1)))
    whole = np.zeros((3, box.bundles))
    whole[:, box.free] = few
    np.testing.assert_array_equal(box.from_free_cube(few), box.from_cube(whole))


@given(st.data(), boxes())
def test_clipping_moves_only_what_is_outside_to_the_nearest_bound(data, box):
    gamma = data.draw(points(box, ends))
    clipped = box.clip(gamma)
    assert (clipped >= box.low).all()
    assert (clipped <= box.high).all()
    inside = (gamma >= box.low) & (gamma <= box.high)
    np.testing.assert_array_equal(clipped[inside], gamma[inside])
    np.testing.assert_array_equal(box.clip(clipped), clipped)
    nearest = np.where(gamma < box.low, box.low, box.high)
    np.testing.assert_array_equal(clipped[~inside], nearest[~inside])


@given(st.data(), boxes(st.floats(-10, 10)))
def test_the_excess_is_the_distance_to_the_box_where_outside_and_not_positive_inside(data, box):
    assume((box.widths[box.free] > 1e-290).all())
    gamma = data.draw(points(box, st.floats(-20, 20)))
    excess = box.excess(gamma)
    away = np.abs(gamma - box.clip(gamma)) / box.scales
    np.testing.assert_allclose(np.maximum(excess, 0.0), away, rtol=1e-12)
    inside = (gamma >= box.low) & (gamma <= box.high)
    assert ((excess <= 0) == inside).all()


@given(st.data(), boxes(st.floats(-10, 10)))
def test_the_margin_is_the_least_distance_to_a_face_in_the_cube(data, box):
    assume((box.widths[box.free] > 1e-3).all())
    gamma = box.from_cube(data.draw(points(box)))
    margin = box.margin(gamma)
    if not box.dimension:
        np.testing.assert_array_equal(margin, 0.0)
        return
    cube = box.to_cube(gamma)[:, box.free]
    expected = np.minimum(cube, 1 - cube).min(axis=1)
    np.testing.assert_allclose(margin, expected, atol=1e-11)
    assert (margin >= 0).all()
    assert (margin <= 0.5 + 1e-11).all()


@given(boxes())
def test_corners_are_all_choices_of_bounds_the_last_bundle_fastest(box):
    np.testing.assert_array_equal(box.corners(), list(itertools.product(*box.bounds)))


def test_points_on_the_boundary_have_no_margin():
    box = ActivationBox.between([[-1, 0], [-2, 2], [3, 3]], "abc")
    assert box.free.tolist() == [0, 1]
    np.testing.assert_array_equal(box.margin(box.corners()), 0.0)
    np.testing.assert_array_equal(box.margin(np.array([[-0.5, 0.0, 3.0]])), 0.5)
    np.testing.assert_array_equal(box.margin(np.array([[0.5, 0.0, 3.0]])), -0.5)


def test_a_box_is_a_frozen_value():
    box = ActivationBox.between(np.array([[-1, 0]]), ["a"])
    assert box == ActivationBox(((-1.0, 0.0),), ("a",))
    assert hash(box) == hash(ActivationBox(((-1.0, 0.0),), ("a",)))
    for array in (box.low, box.high, box.widths, box.scales):
        assert array.dtype == float
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 3.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        box.names = ("b",)


@pytest.mark.parametrize(
    ("bounds", "names", "message"),
    [
        ([[0, -1]], "a", r"bounds = .*lower <= upper"),
        ([[np.nan, 0]], "a", "finite numbers"),
        ([[0, np.inf]], "a", "finite numbers"),
        ([[0, 1]], "ab", r"names = \('a', 'b'\): must be 1: one for each bundle"),
    ],
)
def test_an_impossible_box_is_refused(bounds, names, message):
    with pytest.raises(InvalidInput, match=message):
        ActivationBox.between(bounds, names)


def test_activations_outside_the_bounds_are_taken_as_they_are():
    box = ActivationBox.between([[-1, 0], [-1, 0]], "ab")
    np.testing.assert_array_equal(box.check([[-5, 5]]), [[-5.0, 5.0]])
    assert box.check(np.empty((0, 2))).shape == (0, 2)
