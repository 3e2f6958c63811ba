"""Linear complementarity problems by their own conditions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.kernels.box.complementarity import complementary


def solved(matrix, wanted):
    """x, which of its elements are free, and success."""
    x, free = np.empty_like(wanted), np.empty(wanted.shape, np.int8)
    success = np.empty(len(wanted), np.int8)
    complementary(matrix, wanted, x, free, success)
    return x, free, success


@given(
    seed=st.integers(0, 2**32 - 1),
    m=st.integers(1, 12),
    rank=st.integers(1, 12),
    alike=st.booleans(),
)
def test_conditions_hold_also_where_the_matrix_is_singular(seed, m, rank, alike):
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(rank, m))
    factor[0] = -rng.uniform(0.5, 1, m)  # so that A x = 0 has no x >= 0 but 0
    matrix = factor.T @ factor
    wanted = rng.normal(size=(20, m)) * 10.0 ** rng.integers(-8, 8, (20, 1))
    if alike:
        wanted[:, m // 2 :] = wanted[:, :1]
    x, free, success = solved(matrix[None], wanted)
    slack = x @ matrix - wanted
    scale = np.abs(wanted).max(axis=1, keepdims=True) + np.abs(x) @ np.abs(matrix)
    assert success.all()
    assert (x >= 0).all()
    assert (x[free == 0] == 0).all()
    assert (slack >= -1e-11 * scale).all()
    assert (np.abs(slack) <= 1e-11 * scale)[free == 1].all()


def test_samples_may_have_matrices_of_their_own():
    rng = np.random.default_rng(3)
    factor = rng.normal(size=(5, 4, 3))
    matrices, wanted = factor.transpose(0, 2, 1) @ factor, rng.normal(size=(5, 3))
    together = solved(matrices, wanted)[0]
    alone = [solved(matrices[k : k + 1], wanted[k : k + 1])[0][0] for k in range(5)]
    np.testing.assert_array_equal(together, alone)


@pytest.mark.parametrize("pull", [1.0, 1e-9])
def test_a_function_without_a_minimum_is_told(pull):
    """Variables of opposite effect could both grow for ever."""
    matrix = np.array([[[1.0, -1.0], [-1.0, 1.0]]])
    assert solved(matrix, np.array([[pull, pull]]))[2][0] == 0
    assert solved(matrix, np.array([[pull, -pull]]))[2][0] == 1
