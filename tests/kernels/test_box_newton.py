"""Newton steps in a box against SciPy's bounded least squares."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from softreach.kernels.box.box_newton import box_steps

SEEDS = st.integers(0, 2**32 - 1)
SIZES = st.integers(1, 6)


def stepped(x, gradient, hessian, low, high):
    trial, damping = np.empty((1, len(x))), np.zeros(1)
    box_steps(x[None], gradient[None], hessian[None], damping, low, high, trial)
    return trial[0], damping[0]


def least_squares(rng, m):
    """A of full rank, b, bounds, and the x of least |Ax - b| within them."""
    a, b = rng.normal(size=(m + 2, m)), rng.normal(size=m + 2)
    low = -rng.uniform(0.05, 0.5, m)
    high = low + rng.uniform(0.1, 0.5, m)
    found = lsq_linear(a, b, (low, high), method="bvls", tol=1e-15)
    x = np.where(found.active_mask < 0, low, np.where(found.active_mask > 0, high, found.x))
    return a, b, low, high, x


@given(seed=SEEDS, m=SIZES)
def test_a_minimum_inside_the_box_is_reached_in_one_step(seed, m):
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(m + 2, m)), rng.normal(size=m + 2)
    exact = np.linalg.lstsq(a, b)[0]
    low, high = exact - rng.uniform(0.1, 1, m), exact + rng.uniform(0.1, 1, m)
    start = rng.uniform(low, high)
    trial, damping = stepped(start, a.T @ (a @ start - b), a.T @ a, low, high)
    assert damping == 0.0
    assert trial == pytest.approx(exact, abs=1e-8)


@given(seed=SEEDS, m=SIZES)
def test_the_minimum_within_bounds_is_where_steps_end(seed, m):
    a, b, low, high, x = least_squares(np.random.default_rng(seed), m)
    trial, _ = stepped(x, a.T @ (a @ x - b), a.T @ a, low, high)
    assert trial == pytest.approx(x, abs=1e-9)
    # and nowhere else: from the middle of the box a step leads on, unless that is the minimum
    middle = 0.5 * (low + high)
    trial, _ = stepped(middle, a.T @ (a @ middle - b), a.T @ a, low, high)
    assert np.abs(trial - middle).max() > 0


@given(seed=SEEDS, m=SIZES)
def test_a_short_step_goes_downhill_whatever_the_hessian(seed, m):
    rng = np.random.default_rng(seed)
    hessian = rng.normal(size=(m, m))
    hessian, gradient = hessian + hessian.T, 1e-9 * rng.normal(size=m)
    low, high = -rng.uniform(0.1, 1, m), rng.uniform(0.1, 1, m)
    at = rng.integers(0, 3, m)  # on a bound or inside
    x = np.choose(at, [low, np.zeros(m), high])
    trial, damping = stepped(x, gradient, hessian, low, high)
    assert ((low <= trial) & (trial <= high)).all()
    blocked = ((at == 0) & (gradient > 0)) | ((at == 2) & (gradient < 0))
    assert (trial[blocked] == x[blocked]).all()
    free = ~blocked
    indefinite = free.any() and np.linalg.eigvalsh(hessian[np.ix_(free, free)])[0] < -1e-9
    assert not indefinite or damping > 0
