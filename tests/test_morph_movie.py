"""An animation of a design that becomes another."""

from __future__ import annotations

import io

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.parameters import changed, parameters
from softreach.plot import morph_movie as movies
from softreach.plot.morph_movie import blended_design, morph_frames, morph_movie
from softreach.support.errors import InvalidInput

images = pytest.importorskip("PIL.Image")


@pytest.fixture
def other(trunk):
    return changed(trunk, {"taper": 0.05, "left.offset": 1.0, "length": 0.5, "left.lower": -1.2})


@pytest.fixture(autouse=True)
def _coarse(monkeypatch):
    monkeypatch.setattr(movies, "_ACCURACY", 0.1)


def test_each_number_of_a_blended_design_is_at_its_share_of_the_way(trunk, other):
    for share in (0.0, 0.25, 1.0):
        arm = blended_design(trunk, other, share)
        for name in ("taper", "left.offset", "length", "left.lower", "left.upper", "extent"):
            number = parameters(trunk)[name]
            ends = [number.value(design) for design in (trunk, other)]
            assert number.value(arm) == pytest.approx((1 - share) * ends[0] + share * ends[1])
    assert blended_design(trunk, trunk, 0.5) == trunk


def test_designs_of_other_parts_have_no_way_between_them(trunk):
    with pytest.raises(InvalidInput, match="of other parts"):
        morph_movie(trunk, designs.redundant_trunk())
    with pytest.raises(InvalidInput, match="of other parts"):
        morph_movie(trunk, changed(trunk, {"longitudinal.bundles": 4}))


def test_the_way_back_has_the_same_frames_and_the_volume_is_told(trunk, other):
    bent, done = (-1.0, -0.2, -0.5), []
    there = morph_frames(trunk, other, (bent, (0, 0, 0)), frames=2, pixels=90, progress=done.append)
    back = morph_frames(other, trunk, ((0, 0, 0), bent), frames=2, pixels=90)
    np.testing.assert_array_equal(there, back[::-1])
    assert (there[0] != there[1]).any()
    assert done == sorted(done)
    assert all((frame[:9] < 128).any() for frame in there)  # letters


def test_a_movie_is_stopped_by_who_is_told_of_its_progress(trunk, other):
    def stop(share: float) -> None:
        if share > 0.3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        morph_movie(trunk, other, progress=stop)


@pytest.mark.large
def test_a_movie_has_as_many_frames_as_were_asked_for(trunk, other):
    with images.open(io.BytesIO(morph_movie(trunk, other, frames=7))) as made:
        assert made.n_frames == 7
