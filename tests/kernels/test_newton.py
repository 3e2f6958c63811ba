"""Laws of the root finder: singular values, steps, and which solutions are one."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from softreach.kernels.branches.newton import (
    CONVERGED,
    RUNNING,
    STAGNATED,
    Search,
    conditions,
    merge_equal,
    newton_step,
)
from tests.kernels.maps import Quadratic, random_fold

SEEDS = st.integers(0, 2**32 - 1)
LOW, HIGH = np.full(3, -1.0), np.full(3, 1.0)


def solved(f: Quadratic, targets: np.ndarray, start: np.ndarray, rounds: int) -> Search:
    n = len(start)
    slope, residual, step = np.zeros((n, 3, 3)), np.full(n, 1e300), np.zeros((n, 3))
    damping, state = np.ones(n), np.full(n, RUNNING)
    search = Search(targets, start.copy(), slope, residual, step, damping, start.copy(), state)
    for _ in range(rounds):
        active = np.flatnonzero(search.state == RUNNING)
        trial = search.trial[active]
        newton_step(search, active, f.values(trial), f.slopes(trial), LOW, HIGH, 1e-12)
    return search


@given(seed=SEEDS, exponent=st.floats(-5, 0))
def test_singular_values_are_those_of_lapack_and_condition_numbers_may_be_infinite(seed, exponent):
    rng = np.random.default_rng(seed)
    u, v = np.linalg.qr(rng.normal(size=(2, 200, 3, 3)))[0]
    sigma = np.sort(10.0 ** rng.uniform(exponent, 0, (200, 3)))[:, ::-1]
    matrices = np.ascontiguousarray(u @ (sigma[..., None] * v))
    smallest, condition = np.empty(200), np.empty(200)
    conditions(matrices, smallest, condition)
    exact = np.linalg.svd(matrices, compute_uv=False)
    assert np.allclose(smallest, exact[:, 2], rtol=0, atol=1e-13)
    assert np.allclose(condition, exact[:, 0] / exact[:, 2], rtol=1e-13 * 10 ** (-2 * exponent))
    singular = np.array([np.zeros((3, 3)), np.ones((3, 3)), np.diag([1.0, 2.0, 0.0])])
    conditions(singular, smallest[:3], condition[:3])
    assert (smallest[:3] == 0).all()
    assert np.isinf(condition[:3]).all()


@given(seed=SEEDS)
def test_an_affine_map_is_solved_by_one_step(seed):
    rng = np.random.default_rng(seed)
    b = np.linalg.qr(rng.normal(size=(3, 3)))[0] @ np.diag(rng.uniform(0.1, 1, 3))
    f = Quadratic(rng.normal(size=3), b, np.zeros((3, 3, 3)))
    exact = rng.uniform(-1, 1, (50, 3))
    start = np.clip(exact + rng.uniform(-0.4, 0.4, (50, 3)), LOW, HIGH)
    search = solved(f, f.values(exact), start, rounds=2)
    assert (search.state == CONVERGED).all()
    assert search.gamma == pytest.approx(exact, abs=1e-11)


def test_a_trial_without_a_tip_is_shortened_and_a_start_without_one_is_given_up():
    search = Search(
        target=np.zeros((2, 3)),
        gamma=np.full((2, 3), 0.1),
        slope=np.zeros((2, 3, 3)),
        residual=np.array([0.2, 1e300]),
        step=np.array([[-0.1, 0.0, 0.0], [0.0, 0.0, 0.0]]),
        damping=np.ones(2),
        trial=np.array([[0.0, 0.1, 0.1], [0.1, 0.1, 0.1]]),
        state=np.full(2, RUNNING),
    )
    lost = np.full((2, 3), np.nan), np.full((2, 3, 3), np.nan)
    newton_step(search, np.arange(2), *lost, LOW, HIGH, 1e-12)
    assert search.state.tolist() == [RUNNING, STAGNATED]
    assert search.residual[0] == 0.2
    assert search.damping[0] == 0.25
    np.testing.assert_allclose(search.trial, [[0.075, 0.1, 0.1], [0.1, 0.1, 0.1]])
    newton_step(search, np.arange(1), lost[0][:1], lost[1][:1], LOW, HIGH, 1e-12)
    newton_step(search, np.arange(1), lost[0][:1], lost[1][:1], LOW, HIGH, 1e-12)
    assert search.state[0] == STAGNATED
    np.testing.assert_array_equal(search.trial[0], search.gamma[0])


@given(seed=SEEDS)
def test_beyond_a_fold_a_search_stagnates_and_on_it_a_double_root_is_found(seed):
    rng = np.random.default_rng(seed)
    fold = random_fold(rng)
    f, start = fold.quadratic(), rng.uniform(-0.5, 0.5, (20, 3))
    y = start @ fold.r.T
    beyond = f.values(start) - fold.q[:, 0] * (0.5 * fold.kappa * y[:, :1] ** 2 + 0.1)
    assert (solved(f, beyond, start, rounds=60).state == STAGNATED).all()
    crease = (y * [0.0, 1.0, 1.0]) @ fold.r
    found = solved(f, f.values(crease), start, rounds=60)
    assert (found.state == CONVERGED).all()
    assert found.gamma == pytest.approx(crease, abs=1e-5)


@given(seed=SEEDS, distinct=st.integers(1, 5), copies=st.integers(1, 4))
def test_of_equal_solutions_the_best_is_kept_whatever_their_order(seed, distinct, copies):
    rng = np.random.default_rng(seed)
    points = rng.permutation(np.eye(5, 3) + np.arange(5)[:, None])[:distinct]
    which = rng.permutation(np.repeat(np.arange(distinct), copies))
    residual = rng.uniform(0.1, 1.0, len(which)) * 1e-12
    gamma = points[which] + 1e-12 * rng.uniform(-1, 1, (len(which), 3))
    # the same solutions for a second target are none of the first one's
    offsets = np.array([0, len(which), 2 * len(which)])
    kept = np.ones(2 * len(which), bool)
    smallest = np.full(2 * len(which), 0.5)
    merge_equal(offsets, np.tile(gamma, (2, 1)), np.tile(residual, 2), smallest, 1e-11, kept)
    best = [np.flatnonzero(which == i)[residual[which == i].argmin()] for i in range(distinct)]
    assert np.flatnonzero(kept[: len(which)]).tolist() == sorted(best)
    assert (kept[: len(which)] == kept[len(which) :]).all()
