"""Starts among seeds with tips near a target, against the same choice in NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.inverse.seeds import Seeds
from softreach.rod import tip_map
from tests.inverse.test_many_bundles import six_bundles


@pytest.fixture(scope="module")
def seeds() -> Seeds:
    rod = tip_map(six_bundles(), tol=1e-3)
    gamma = np.random.default_rng(0).uniform(rod.box.low, rod.box.high, (20_000, rod.box.bundles))
    return Seeds(gamma, rod.tips(gamma), rod)


def reference(seeds, target, near, count, most, least_distance, *, moves):
    """The choice for one target: from the bins around it, least change first, apart."""
    columns, _, (corner, width, shape) = seeds._bins
    m = len(near)
    gamma, tip, slope, half = np.split(columns.astype(float), [m, m + 3, 4 * m + 3], axis=1)
    slope, inverse = slope.reshape(-1, 3, m), half[:, [[0, 1, 3], [1, 2, 4], [3, 4, 5]]]
    target = (target - corner) / width
    place, goal = (np.clip(x // 1, 0, np.array(shape) - 1) for x in (tip, target))
    shell = np.abs(place - goal).max(axis=1)
    looked_at = np.flatnonzero(shell <= max(1, np.sort(shell)[count - 1]))
    stride = 1 + len(looked_at) // 1024  # of more, some are left out
    looked_at = looked_at[stride - 1 :: stride]
    gamma, way, slope = gamma[looked_at], target - tip[looked_at], slope[looked_at]
    low, high = seeds._coarse.box.low, seeds._coarse.box.high
    ends, key = gamma, np.zeros(len(gamma))
    if moves:
        step = np.einsum("nij,nik,nk->nj", slope, inverse[looked_at], way)
        ends = np.clip(gamma + seeds.scales * step, low, high)
        step = (ends - gamma) / seeds.scales
        left = way - np.einsum("nij,nj->ni", slope, step)
        missed = (left**2).sum(axis=1) > 0.1 * (way**2).sum(axis=1)
        key[missed | (np.abs(step).max(axis=1) > 0.4)] = 1e6
    key += ((ends - near) ** 2).sum(axis=1)
    chosen = np.empty((0, len(near)))
    for end in ends[key.argsort()]:
        apart = (np.abs(chosen - end) / seeds.scales).max(axis=1, initial=0.0) > least_distance
        if len(chosen) < most and apart.all():
            chosen = np.concatenate([chosen, end[None]])
    return chosen


def test_starts_are_those_of_the_reference(seeds):
    rng, box = np.random.default_rng(1), seeds._coarse.box
    activations, near = rng.uniform(box.low, box.high, (2, 20, box.bundles))
    targets = seeds._coarse.tips(activations)
    targets[-1] += 2.0  # beyond all bins
    owner, starts = seeds.near(targets, near, 200, 7, 0.15)
    for row, (target, at) in enumerate(zip(targets, near, strict=True)):
        both = [reference(seeds, target, at, 200, 7, 0.15, moves=moves) for moves in (True, False)]
        wanted = np.concatenate(both)
        np.testing.assert_allclose(starts[owner == row], wanted, atol=1e-6)


def test_moved_seeds_come_nearer_to_their_targets(seeds):
    rng, box = np.random.default_rng(2), seeds._coarse.box
    targets = seeds._coarse.tips(rng.uniform(box.low, box.high, (50, box.bundles)))
    near = np.zeros((50, box.bundles))
    owner, starts = seeds.near(targets, near, 200, 3, 0.15)
    gaps = np.linalg.norm(seeds._coarse.tips(starts) - targets[owner], axis=1).reshape(50, 2, 3)
    assert gaps[:, 0].mean() < 0.3 * gaps[:, 1].mean()
