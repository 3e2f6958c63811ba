"""Searches for the least change side by side, against one at a time in NumPy."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import designs
from softreach.inverse.request import Request
from softreach.inverse.sqp import sqp
from softreach.kernels.box.box_projection import project
from softreach.rod import tip_map
from tests.inverse.test_many_bundles import six_bundles

RESTORING = 1e6


def reference(rod, target, near, gamma, most):
    """The end of one search after so many steps."""
    low, high = rod.box.low, rod.box.high
    sigma, penalty, reach = 0.3, 0.0, 0.5
    miss, slope = at(rod, target, gamma)
    for count in range(1, most + 1):
        softness = (1e-15 if norm(miss) < 1e-3 else 1e-6) * (slope**2).sum() + 1e-30
        bounds = [
            np.maximum(low, gamma - reach * rod.box.scales),
            np.minimum(high, gamma + reach * rod.box.scales),
        ]
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
    rod, rng = tip_map(design()), np.random.default_rng(3)
    gamma, near, start = rng.uniform(rod.box.low, rod.box.high, (3, n, rod.box.bundles))
    targets = rod.tips(gamma)
    targets[::7] *= 1.2
    return rod, Request(targets=targets, residual=1e-10, allowance=1e-6, near=near), start


@pytest.mark.parametrize("design", [designs.redundant_trunk, six_bundles])
@pytest.mark.parametrize("most", [1, 2, 4, 12])
def test_searches_end_where_those_of_the_reference_do(design, most):
    rod, request, start = searches(design, 24)
    ends = sqp(rod, request, np.arange(24), start, most=most)
    wanted = [
        reference(rod, *given, most)
        for given in zip(request.targets, request.near, start, strict=True)
    ]
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
    stationary = []
    for row in reached:
        gamma = ends.gamma[row]
        free = (gamma > low + 1e-9) & (gamma < high - 1e-9)
        change, slope = (request.near[row] - gamma)[free], slopes[row][:, free]
        left = change - slope.T @ np.linalg.lstsq(slope.T, change, rcond=None)[0]
        stationary.append(norm(left) < 1e-5)
    assert all(stationary)
