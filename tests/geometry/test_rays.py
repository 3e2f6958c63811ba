"""Laws of lines of sight."""

import numpy as np
import pytest

from softreach.geometry.rays import along_axis, is_behind, picked_point


def test_a_ray_picks_the_nearest_of_the_points_on_it():
    eye, points = np.zeros(3), np.array([[0, 0, 5.0], [0, 0, 2.0], [1, 0, 1.0], [0, 0, -1.0]])
    assert picked_point(points, eye, (0, 0, 3)) == 1
    assert picked_point(points, eye, (1, 0, 1)) == 2
    assert picked_point(points, eye, (0, 1, 0)) is None


def test_a_ball_hides_what_is_behind_it_and_nothing_that_it_touches():
    eye, balls, radii = np.zeros(3), np.array([[0, 0, 2.0], [0, 0, -2.0]]), np.array([0.1, 0.1])
    places = np.array([[0, 0, 3], [0, 0.09, 3], [0, 0.2, 3], [0, 0, 2.1], [0, 0, 1]])
    hidden = [is_behind(place, eye, balls, radii) for place in places]
    assert hidden == [True, True, False, False, False]


def test_the_place_on_an_axis_is_nearest_to_the_line_of_sight():
    rng = np.random.default_rng(0)
    for _ in range(20):
        origin, eye, seen, axis = rng.normal(size=(4, 3))
        axis /= np.linalg.norm(axis)
        place = origin + along_axis(origin, axis, eye, seen) * axis
        sight = (seen - eye) / np.linalg.norm(seen - eye)
        gap = place - eye - (place - eye) @ sight * sight
        assert gap @ axis == pytest.approx(0.0, abs=1e-9)
    assert along_axis(origin, axis, origin - 3.0 * axis, origin) == 0.0
