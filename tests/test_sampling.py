"""Samplers: points of the unit cube that depend on their four arguments alone."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.sampling import SAMPLERS, cube_blocks, sample_cube
from softreach.support.errors import InvalidInput


@given(sampler=st.sampled_from(sorted(SAMPLERS)), dim=st.integers(1, 5), size=st.integers(1, 300))
def test_blocks_only_cut_the_sequence(sampler, dim, size):
    n = 4**dim if dim < 5 else 1024
    whole = sample_cube(sampler, n, dim, seed=3)
    pieces = np.concatenate(list(cube_blocks(sampler, n, dim, 3, size)))
    np.testing.assert_array_equal(pieces, whole)
    assert whole.shape == (n, dim)
    assert whole.min() >= 0
    assert whole.max() <= 1


@pytest.mark.parametrize("sampler", ["uniform", "boundary", "sobol"])
def test_seeds_make_sequences(sampler):
    first, again, other = (sample_cube(sampler, 256, 3, seed) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("dim", [1, 2, 3, 4])
def test_a_fifth_of_the_boundary_points_lie_on_faces_each_face_alike(dim):
    n = 10 * dim * 40
    points = sample_cube("boundary", n, dim, seed=0)
    on_face = (points == 0) | (points == 1)
    assert (on_face.sum(axis=1) <= 1).all()
    assert on_face.sum() == n / 5
    for axis in range(dim):
        assert (points[:, axis] == 0).sum() == (points[:, axis] == 1).sum() == n / (10 * dim)


def test_uniform_points_are_uniform():
    points = sample_cube("uniform", 100_000, 3, seed=0)
    counts = np.histogramdd(points, bins=4, range=[(0, 1)] * 3)[0]
    expected = 100_000 / 64
    chi_square = ((counts - expected) ** 2 / expected).sum()
    assert chi_square < 63 + 5 * np.sqrt(2 * 63)


def test_every_power_of_two_prefix_of_sobol_is_balanced():
    points = sample_cube("sobol", 1024, 2, seed=5)
    for n in (64, 256, 1024):
        cells = np.histogram2d(*points[:n].T, bins=8, range=[(0, 1)] * 2)[0]
        np.testing.assert_array_equal(cells, n / 64)


def test_the_grid_holds_both_ends_and_every_combination():
    points = sample_cube("grid", 27, 3, seed=0)
    assert {tuple(p) for p in points} == {
        (a, b, c) for a in (0, 0.5, 1) for b in (0, 0.5, 1) for c in (0, 0.5, 1)
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("halton", 10, 3, 0), "sampler = 'halton': must be one of uniform, boundary, sobol, grid"),
        (("sobol", 400_000, 3, 0), "262144 or 524288"),
        (("grid", 400_000, 3, 0), r"73\^3 = 389017 or 74\^3 = 405224"),
        (("uniform", 0, 3, 0), "n = 0: must be a whole number, 1 or more"),
        (("uniform", 10, 3, -1), "seed = -1"),
    ],
)
def test_what_a_sampler_cannot_do_is_refused_with_what_it_can(arguments, message):
    with pytest.raises(InvalidInput, match=message):
        sample_cube(*arguments)
