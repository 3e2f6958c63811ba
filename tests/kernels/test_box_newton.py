"""Newton steps in a box against SciPy's bounded least squares."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from softreach.arm import designs
from softreach.inverse.least_change import sqp
from softreach.inverse.request import Request
from softreach.kernels.box.bounded_descent import box_steps
from softreach.kernels.box.box_projection import project
from softreach.kernels.box.complementarity import complementary
from softreach.rod import as_tip_map
from tests.inverse.test_many_bundles import six_bundles

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


# Nearest points of boxes where equations hold: optimality conditions, and SciPy's minimizer


def problems(bundles, n, *, to_corners=0.0, softness=1e-9):
    """Random boxes, centers on all sides of them, and equations that hold somewhere inside.

    A part `to_corners` of what solves the equations lies on bounds.
    """
    rng = np.random.default_rng(bundles)
    low, high = np.full((n, bundles), -1.0), rng.uniform(-0.5, 0.2, (n, bundles))
    center, slope = rng.uniform(-3.0, 3.0, (n, bundles)), rng.normal(size=(n, 3, bundles))
    point = rng.uniform(low, high)
    on_bound = rng.random((n, bundles)) < to_corners
    point = np.where(on_bound, np.where(rng.random((n, bundles)) < 0.5, low, high), point)
    wanted = np.einsum("nij,nj->ni", slope, point)
    return center, slope, wanted, softness * (slope**2).sum(axis=(1, 2)), low, high


def projected(center, slope, wanted, softness, low, high):
    point, multiplier = np.empty_like(center), np.zeros_like(wanted)
    project(center, slope, wanted, softness, low, high, point, multiplier)
    return point, multiplier


@pytest.mark.parametrize("to_corners", [0.0, 0.7])
@pytest.mark.parametrize("bundles", [3, 4, 12])
def test_every_projection_meets_its_optimality_conditions(bundles, to_corners):
    # Convex, so that they are sufficient too.
    given = problems(bundles, 600, to_corners=to_corners, softness=1e-14)
    center, slope, wanted, softness, low, high = given
    point, multiplier = projected(*given)
    pulled = np.clip(center - np.einsum("nij,ni->nj", slope, multiplier), low, high)
    assert np.abs(point - pulled).max() < 1e-12 * (1 + np.abs(multiplier).max())
    left = np.einsum("nij,nj->ni", slope, point) - wanted - softness[:, None] * multiplier
    assert np.abs(left).max() < 1e-9


@pytest.mark.parametrize("bundles", [4, 12])
def test_the_projection_does_not_depend_on_where_it_begins(bundles):
    # From nothing known, and from multipliers that are nearly right.
    given = problems(bundles, 5000, softness=1e-6)
    point, multiplier = projected(*given)
    nearly = multiplier * (1.0 + 1e-7 * np.random.default_rng(0).normal(size=multiplier.shape))
    again = np.empty_like(point)
    project(*given, again, nearly)
    np.testing.assert_allclose(again, point, atol=1e-10 * (1 + np.abs(multiplier).max()))


# Searches for the least change side by side, against one at a time in NumPy

RESTORING = 1e6


def reference(rod, target, near, gamma, most):
    """The end of one search after so many steps."""
    low, high = rod.box.low, rod.box.high
    sigma, penalty, reach = 0.3, 0.0, 0.5
    miss, slope = at(rod, target, gamma)
    for count in range(1, most + 1):
        softness = (1e-15 if norm(miss) < 1e-3 else 1e-6) * (slope**2).sum() + 1e-30
        room = reach * rod.box.scales
        bounds = np.maximum(low, gamma - room), np.minimum(high, gamma + room)
        center, wanted = (near + sigma * gamma) / (1 + sigma), slope @ gamma - miss
        trial, force = np.empty((1, len(gamma))), np.zeros((1, 3))
        given = center, slope, wanted, np.array(softness), *bounds
        project(*(part[None] for part in given), trial, force)
        trial, force = trial[0], (1 + sigma) * force[0]
        moved = trial - gamma
        ahead = norm(miss + slope @ moved)
        if ahead <= max(1e-2 * norm(miss), 1e-9) and 1.5 * norm(force) < 1e4:
            weight = penalty = max(penalty, 1.5 * norm(force))
        else:
            weight = RESTORING
        now = 0.5 * norm(gamma - near) ** 2 + weight * norm(miss)
        change = 0.5 * norm(trial - near) ** 2
        gain = now - change - 0.5 * sigma * norm(moved) ** 2 - weight * ahead
        next_miss, next_slope = at(rod, target, trial)
        gained, step = now - change - weight * norm(next_miss), np.abs(moved / rod.box.scales).max()
        ended = step * (1 + sigma) < 1e-6
        if gained < 0.1 * gain - 1e-14:
            if weight < RESTORING:
                sigma = 4 * max(sigma, 0.0) + 0.1
            else:
                reach = 0.3 * step
        else:
            reach = min(0.5, 2 * reach)
            stuck = gained < 0.02 * weight * norm(next_miss) and count > 6
            ended = ended or (weight >= RESTORING and stuck)
            if weight < RESTORING and step < 0.1:
                bend = force @ (next_slope - slope) @ moved / max(norm(moved) ** 2, 1e-300)
                sigma = min(max(bend, -0.7), 4 * max(sigma, 0.0) + 1)
            else:
                sigma = (0.4 if gained >= 0.7 * gain else 1.0) * max(sigma, 0.0)
            gamma, miss, slope = trial, next_miss, next_slope
        if ended or sigma >= 1e7 or reach < 1e-6:
            break
    return gamma


def at(rod, target, gamma):
    tips, slopes = rod.tips_and_slopes(gamma[None])
    return (tips[0] - target) / rod.length, slopes[0] / rod.length


norm = np.linalg.norm


def searches(design, n):
    """A tip map, targets to reach with little change, and starts, some targets beyond reach."""
    rod, rng = as_tip_map(design()), np.random.default_rng(3)
    gamma, near, start = rng.uniform(rod.box.low, rod.box.high, (3, n, rod.box.bundles))
    targets = rod.tips(gamma)
    targets[::7] *= 1.2
    return rod, Request(targets=targets, residual=1e-10, reach_tol=1e-6, near=near), start


@pytest.mark.parametrize("design", [designs.redundant_trunk, six_bundles])
@pytest.mark.parametrize("most", [1, 2, 4, 12])
def test_searches_end_where_those_of_the_reference_do(design, most):
    rod, request, start = searches(design, 24)
    ends = sqp(rod, request, np.arange(24), start, most=most)
    given = zip(request.targets, request.near, start, strict=True)
    wanted = [reference(rod, *one, most) for one in given]
    np.testing.assert_allclose(ends.gamma, wanted, atol=1e-6)
    miss = norm(rod.tips(ends.gamma) - request.targets, axis=1)
    np.testing.assert_allclose(ends.residual, miss, atol=1e-12)


def test_a_search_ends_where_it_ends_alone():
    # More than run side by side, so that some take the room of others.
    rod, request, start = searches(designs.redundant_trunk, 3000)
    together = sqp(rod, request, np.arange(3000), start)
    for row in (0, 1500, 2999):
        alone = sqp(rod, request, np.array([row]), start[row : row + 1])
        np.testing.assert_allclose(together.gamma[row], alone.gamma[0], atol=1e-9)


def test_least_changes_are_stationary():
    """The change along every direction that keeps the tip, between the bounds, is zero."""
    rod, request, start = searches(six_bundles, 200)
    ends = sqp(rod, request, np.arange(200), start, settled=1e-9, most=300)
    reached = np.flatnonzero(ends.residual < 1e-9)
    assert len(reached) > 100
    low, high = rod.box.low, rod.box.high
    slopes = rod.tips_and_slopes(ends.gamma)[1]
    for row in reached:
        gamma = ends.gamma[row]
        free = (gamma > low + 1e-9) & (gamma < high - 1e-9)
        change, slope = (request.near[row] - gamma)[free], slopes[row][:, free]
        left = change - slope.T @ np.linalg.lstsq(slope.T, change, rcond=None)[0]
        assert norm(left) < 1e-5


# Linear complementarity problems by their own conditions


def solved(matrix, wanted):
    """x, which of its elements are free, and success."""
    x, free = np.empty_like(wanted), np.empty(wanted.shape, np.int8)
    success = np.empty(len(wanted), np.int8)
    complementary(matrix, wanted, x, free, success)
    return x, free, success


@pytest.mark.parametrize("alike", [False, True])
@pytest.mark.parametrize("m", [1, 2, 3, 4, 5, 12])
def test_conditions_hold_also_where_the_matrix_is_singular(m, alike):
    """They are sufficient, so no choice of free elements has a smaller minimum."""
    rng = np.random.default_rng(m)
    for rank in range(1, m + 1):
        factor = rng.normal(size=(rank, m))
        factor[0] = -rng.uniform(0.5, 1, m)  # so that A x = 0 has no x >= 0 but 0
        matrix = factor.T @ factor
        wanted = rng.normal(size=(100, m)) * 10.0 ** rng.integers(-8, 8, (100, 1))
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
