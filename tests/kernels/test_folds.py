"""The second preimage near a fold, in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.kernels.branches import folds
from tests.kernels.maps import mesh_of, random_fold

FAR = np.full(3, 100.0)
OVERSHOOT = 2.8


def second_preimages(mesh, f, gamma, reach, low=-FAR, high=FAR):
    slope = f.slopes(gamma)
    smallest = np.linalg.svd(slope, compute_uv=False)[:, 2]
    start, near = np.full_like(gamma, np.nan), np.zeros(len(gamma), bool)
    cell = np.zeros(len(gamma), np.int64)
    bounds = low, high
    folds.second_preimages(
        mesh, cell, gamma, slope, smallest, reach, OVERSHOOT, *bounds, start, near
    )
    return start, near


@given(seed=st.integers(0, 2**32 - 1), kappa=st.floats(0.1, 2.0), side=st.sampled_from([-1, 1]))
def test_on_a_fold_the_start_lies_beyond_the_mirror_image_by_the_overshoot(seed, kappa, side):
    rng = np.random.default_rng(seed)
    fold = random_fold(rng, side * kappa)
    f, y = fold.quadratic(), rng.uniform(-0.3, 0.3, (40, 3))
    y[:, 0] = rng.choice([-1, 1], 40) * rng.uniform(1e-4, 5e-3, 40) / kappa  # σ = κ |y0|
    gamma = y @ fold.r
    start, near = second_preimages(mesh_of(f, 1), f, gamma, reach=10.0)
    assert near.all()
    share = 0.5 * OVERSHOOT
    assert start == pytest.approx(gamma + share * (fold.mirrored(gamma) - gamma), abs=1e-9)


def test_a_second_preimage_out_of_reach_or_far_out_of_bounds_is_left_out(rng):
    fold = random_fold(rng)._replace(r=np.eye(3))
    f = fold.quadratic()
    mesh = mesh_of(f, 1)  # one cell of width 2
    gamma = np.array([[0.1, 0.0, 0.0], [0.5, 0.0, 0.0]])
    assert second_preimages(mesh, f, gamma, reach=0.3)[1].tolist() == [True, False]
    low = np.array([0.4, -1.0, -1.0])
    start, near = second_preimages(mesh, f, gamma, reach=10.0, low=low)
    assert near.all()
    assert (start >= low).all()
    low[0] = 3.0
    assert not second_preimages(mesh, f, gamma, reach=10.0, low=low)[1].any()
