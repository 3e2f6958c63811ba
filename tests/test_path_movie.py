"""An animation of a path that an arm follows."""

from __future__ import annotations

import io

import numpy as np
import pytest

import softreach as sr
from softreach.plot.path_movie import path_movie
from softreach.support.errors import InvalidInput

images = pytest.importorskip("PIL.Image")


def track(arm, length):
    """Straight to the right from an activation."""
    start = (-0.5, -0.3, -0.4)
    tip = sr.tip_positions(arm, [start])[0]
    return sr.track_path(arm, tip + np.linspace(0, 1, 5)[:, None] * [length, 0, 0], start)


def test_a_movie_has_a_frame_for_every_point_that_is_followed(trunk):
    done: list[float] = []
    followed = track(trunk, 0.04)
    movie = path_movie(followed, followed.position, progress=done.append)
    with images.open(io.BytesIO(movie)) as made:
        assert made.n_frames == 5
    assert done == [0.0, 0.2, 0.4, 0.6, 0.8]


def test_a_path_out_of_reach_has_no_movie(trunk):
    with pytest.raises(InvalidInput, match="path"):
        path_movie(sr.track_path(trunk, [[2.0, 0, 0], [2.1, 0, 0]]))
