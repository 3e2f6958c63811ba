"""Every sign equals that of rational arithmetic."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from softreach.kernels.points.expansions import scratch
from softreach.kernels.points.predicates import (
    collinear,
    insphere,
    insphere_exact,
    insphere_filter,
    orient,
    orient_exact,
    orient_filter,
)
from tests.geometry.exact import exact_insphere, exact_orient, rational

WORK = scratch()


def general(rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(-1.0, 1.0, (5, 3))


def lattice(rng: np.random.Generator) -> np.ndarray:
    return rng.integers(-3, 4, (5, 3)) / 8.0


def rounded(rng: np.random.Generator) -> np.ndarray:
    return np.round(rng.uniform(-1.0, 1.0, (5, 3)), 1)


def almost_coplanar(rng: np.random.Generator) -> np.ndarray:
    points = rng.uniform(-1.0, 1.0, (5, 3))
    points[3] = (
        points[0] + rng.random() * (points[1] - points[0]) + rng.random() * (points[2] - points[0])
    )
    return points / 4.0


def almost_cospherical(rng: np.random.Generator) -> np.ndarray:
    x = rng.normal(size=(5, 3))
    return x / np.linalg.norm(x, axis=1, keepdims=True) / 2.0


def almost_equal(rng: np.random.Generator) -> np.ndarray:
    points = rng.uniform(-1.0, 1.0, (5, 3))
    points[3:] = points[:2] + 1e-15 * rng.integers(-3, 4, (2, 3))
    return points


def unit_in_the_last_place(rng: np.random.Generator) -> np.ndarray:
    return 0.5 + rng.integers(-4, 5, (5, 3)) * 2.0**-53


def widely_scaled(rng: np.random.Generator) -> np.ndarray:
    return np.round(rng.uniform(-1, 1, (5, 3)) * 2.0 ** rng.integers(-150, 0, (5, 3)), 60)


KINDS = [
    general,
    lattice,
    rounded,
    almost_coplanar,
    almost_cospherical,
    almost_equal,
    unit_in_the_last_place,
    widely_scaled,
]


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.__name__)
def test_signs_equal_those_of_rational_arithmetic(kind, rng):
    for _ in range(150):
        points = kind(rng)
        exact = [rational(p) for p in points]
        side = exact_orient(*exact[:4])
        assert orient(points, 0, 1, 2, 3, WORK) == side
        assert orient_exact(points, 0, 1, 2, 3, WORK) == side
        inside = exact_insphere(*exact)
        assert insphere(points, 0, 1, 2, 3, 4, WORK) == inside
        assert insphere_exact(points, 0, 1, 2, 3, 4, WORK) == inside


grid_points = arrays(np.float64, (5, 3), elements=st.integers(-(2**30), 2**30).map(float))


@given(grid_points)
def test_the_filter_never_contradicts_the_exact_sign(points):
    points = points * 2.0**-30
    exact = [rational(p) for p in points]
    assert orient_filter(points, 0, 1, 2, 3) in (0, exact_orient(*exact[:4]))
    assert insphere_filter(points, 0, 1, 2, 3, 4) in (0, exact_insphere(*exact))


@given(grid_points, st.permutations(range(4)))
def test_exchanging_vertices_changes_the_sign_as_a_permutation_does(points, order):
    points = points * 2.0**-30
    parity = np.linalg.det(np.eye(4)[list(order)])
    assert orient(points, *order, WORK) == parity * orient(points, 0, 1, 2, 3, WORK)
    turned = insphere(points, *order, 4, WORK)
    assert turned == parity * insphere(points, 0, 1, 2, 3, 4, WORK)


def test_three_points_are_collinear_only_exactly(rng):
    a, step = rng.integers(-8, 9, (2, 3)) / 16.0
    step[0] += 1 / 16
    line = np.stack([a, a + step, a + 3 * step])
    assert collinear(line, 0, 1, 2, WORK)
    line[2, 1] = np.nextafter(line[2, 1], 2.0)
    assert not collinear(line, 0, 1, 2, WORK)
