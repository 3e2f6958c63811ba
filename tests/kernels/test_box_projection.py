"""Nearest points of boxes where equations hold, and seeds that lie apart: optimality conditions."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.inverse.seeds import Seeds
from softreach.kernels.box.box_projection import project


@pytest.mark.parametrize("bundles", [4, 12])
def test_the_projection_meets_its_optimality_conditions_from_wherever_it_begins(bundles):
    rng, n = np.random.default_rng(bundles), 400
    low, high = np.full((n, bundles), -1.0), rng.uniform(-0.5, 0.2, (n, bundles))
    center = rng.uniform(-3.0, 3.0, (n, bundles))  # outside the box in many directions
    slope, softness = rng.normal(size=(n, 3, bundles)), np.full(n, 1e-9)
    wanted = np.einsum("nij,nj->ni", slope, rng.uniform(low, high))
    for begin in (np.zeros((n, 3)), rng.normal(size=(n, 3))):
        point, multiplier = np.empty((n, bundles)), begin.copy()
        project(center, slope, wanted, softness, low, high, point, multiplier)
        pulled = center - np.einsum("nij,ni->nj", slope, multiplier)
        assert np.abs(point - np.clip(pulled, low, high)).max() < 1e-12
        left = np.einsum("nij,nj->ni", slope, point) - wanted
        met = np.abs(left - softness[:, None] * multiplier).max(axis=1) < 1e-9
        assert met.mean() > 0.9  # the rest: hardly a variable between its bounds


def test_seeds_near_a_target_are_the_nearest_that_lie_apart():
    rng = np.random.default_rng(0)
    gamma, tips, scales = rng.random((600, 5)), rng.random((600, 3)), np.full(5, 2.0)
    targets, near = rng.uniform(-0.5, 1.5, (20, 3)), rng.random((20, 5))
    owner, start = Seeds(gamma, tips, scales).near(targets, near, len(tips), 7, 0.2)
    for t in range(20):  # all seeds are looked at
        chosen: list[np.ndarray] = []
        for row in ((gamma - near[t]) ** 2).sum(axis=1).argsort():
            apart = all((np.abs(gamma[row] - other) / scales).max() > 0.2 for other in chosen)
            if apart and len(chosen) < 7:
                chosen.append(gamma[row])
        assert np.array_equal(start[owner == t], chosen)
