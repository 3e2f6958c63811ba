"""Nearest points of boxes where equations hold: optimality conditions, and SciPy's minimizer."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from softreach.kernels.box.box_projection import project


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


def test_the_projection_is_the_nearest_point_that_scipy_finds():
    given = problems(5, 20)
    for point, c, a, b, low, high in zip(projected(*given)[0], *given[:3], *given[4:], strict=True):
        nearest = minimize(
            lambda x, c=c: 0.5 * (x - c) @ (x - c),
            np.clip(c, low, high),
            jac=lambda x, c=c: x - c,
            bounds=list(zip(low, high, strict=True)),
            constraints={
                "type": "eq",
                "fun": lambda x, a=a, b=b: a @ x - b,
                "jac": lambda _, a=a: a,
            },
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 200},
        )
        assert nearest.success
        np.testing.assert_allclose(point, nearest.x, atol=1e-6)


@pytest.mark.parametrize("bundles", [4, 12])
def test_the_projection_does_not_depend_on_where_it_begins(bundles):
    # From nothing known, and from multipliers that are nearly right.
    given = problems(bundles, 5000, softness=1e-6)
    point, multiplier = projected(*given)
    nearly = multiplier * (1.0 + 1e-7 * np.random.default_rng(0).normal(size=multiplier.shape))
    again = np.empty_like(point)
    project(*given, again, nearly)
    np.testing.assert_allclose(again, point, atol=1e-10 * (1 + np.abs(multiplier).max()))
