"""Cells are made smaller, and changes in them bounded, without losing one that reaches a target."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize

from softreach.kernels.box.change_bounds import contract

STARTS = np.concatenate([np.zeros((1, 3)), 0.1 * np.eye(3)])


def random_cells(n: int, m: int, *, error: float, seed: int) -> dict[str, np.ndarray]:
    """Cells of quadratic maps with places in them and the targets that these reach but for e."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.01, 1.0, (n, m)) * rng.choice([1e-3, 0.1, 1.0], (n, 1))
    slopes, seconds = rng.normal(size=(n, 3, m)), rng.normal(size=(n, 3, m, m))
    slopes[:, 2] *= 0.05  # nearly singular, as tips are along most arms
    seconds = seconds + seconds.transpose(0, 1, 3, 2)
    change = half * rng.uniform(-1.0, 1.0, (n, m))
    size = np.linalg.norm(slopes, axis=(1, 2)) * half.max(axis=1) + 1e-9
    away = rng.normal(size=(n, 3))
    away *= error * size[:, None] / np.linalg.norm(away, axis=1)[:, None]
    center, tips = rng.normal(size=(n, m)), rng.normal(size=(n, 3))
    return {
        "center": center,
        "half": half,
        "multiplier": np.zeros((n, 3)),
        "tips": tips,
        "slopes": slopes,
        "seconds": seconds,
        "error": error * size + 1e-15,
        "wanted": tips + reached(slopes, seconds, change) + away,
        "near": center + half * rng.normal(size=(n, m)) * rng.choice([0.1, 2.0, 30.0], (n, 1)),
        "place": center + change,
    }


def reached(slopes: np.ndarray, seconds: np.ndarray, change: np.ndarray) -> np.ndarray:
    """A d + ½ H[d, d]."""
    linear = np.einsum("nij,nj->ni", slopes, change)
    return linear + 0.5 * np.einsum("nijk,nj,nk->ni", seconds, change, change)


def contracted(cells: dict[str, np.ndarray], goal: np.ndarray) -> dict[str, np.ndarray]:
    """What the kernel leaves of them, with bounds."""
    out = {name: values.copy() for name, values in cells.items() if name != "place"}
    bound, axis = np.empty(len(goal)), np.empty(len(goal), np.int64)
    contract(*out.values(), goal, bound, axis)
    return out | {"bound": bound, "axis": axis}


def dual(y, change, slopes, seconds, half, error, wanted) -> float:
    """L(y) of one cell; the minimum of each parabola is at its top or at a bound."""
    slope, bend = change + y @ slopes, 1.0 + np.einsum("i,ijj->j", y, seconds)
    with np.errstate(divide="ignore", invalid="ignore"):
        middle = np.where(bend > 0, np.clip(-slope / bend, -half, half), half)
    places = np.stack([-half, middle, half])
    least = (slope * places + 0.5 * bend * places**2).min(axis=0)
    products = np.triu(np.abs(np.einsum("i,ijk->jk", y, seconds)) * np.outer(half, half), 1)
    value = 0.5 * change @ change + least.sum() - products.sum()
    return float(value - error * np.linalg.norm(y) - y @ wanted)


@pytest.mark.parametrize("bundles", [3, 4, 5, 6])
@pytest.mark.parametrize("error", [0.0, 1e-6, 0.1])
def test_no_place_that_reaches_the_target_by_less_than_the_goal_is_lost(bundles, error):
    cells = random_cells(3000, bundles, error=error, seed=bundles)
    change = np.linalg.norm(cells["place"] - cells["near"], axis=1)
    left = contracted(cells, change * (1 + 1e-9))
    outside = np.abs(cells["place"] - left["center"]) - left["half"]
    assert (left["bound"] <= change * (1 + 1e-9)).all()
    assert (outside <= 1e-9 * cells["half"]).all()
    assert (left["half"] <= cells["half"] * (1 + 1e-12)).all()
    assert np.median((left["half"] / cells["half"]).prod(axis=1)) < 0.9


@pytest.mark.parametrize("bundles", [4, 6])
def test_bounds_are_the_largest_of_their_dual_or_larger_for_what_is_left(bundles):
    cells, options = random_cells(20, bundles, error=1.0, seed=7), {"xatol": 1e-6, "fatol": 1e-9}
    compared = 0
    for n in range(20):
        one = {name: values[n : n + 1] for name, values in cells.items()}
        change, wanted = one["center"][0] - one["near"][0], one["wanted"][0] - one["tips"][0]
        parts = (one[name][0] for name in ("slopes", "seconds", "half", "error"))
        of_cell = change, *parts, wanted

        def less(y, of_cell=of_cell):
            return -dual(y, *of_cell)

        best = -min(minimize(less, y, method="Nelder-Mead", options=options).fun for y in STARTS)
        if best > 1e-6:
            bound = contracted(one, 1.01 * np.sqrt([2 * best]))["bound"][0]
            assert bound**2 > 0.98 * 2 * best
            compared += 1
    assert compared > 10


@pytest.mark.parametrize("bundles", [4, 6])
def test_cells_that_cannot_reach_the_target_are_done(bundles):
    cells = random_cells(500, bundles, error=0.01, seed=3)
    cells["wanted"] = (
        cells["wanted"] + 10 * np.linalg.norm(cells["slopes"], axis=(1, 2))[:, None] + 50
    )
    goal = np.full(500, 1e3)
    assert np.array_equal(contracted(cells, goal)["bound"], goal)
