"""The least activation that reaches a target is found, and proved where that is said."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from benchmarks.adversarial_inverse import activations, random_design
from scipy.optimize import minimize

from softreach.arm import Drive, designs
from softreach.arm.manipulator import Manipulator
from softreach.inverse import Status, prepared_map, solve_inverse
from softreach.rod import TipMap, tip_map, tip_positions
from softreach.support.errors import InvalidInput
from tests.inverse.test_many_bundles import changes, six_bundles
from tests.kinds import fibers_and_a_tendon

OVERLOOKED = np.array([-0.6582, -0.8974, -1.036, -1.4149])
LOCAL_MINIMA = [  # edges whose tips were solved with a larger activation: bundles, design, row
    (5, 12, 471),
    (6, 13, 609),
]


def least_from_many_starts(
    rod: TipMap, target: np.ndarray, near: np.ndarray, starts: np.ndarray
) -> float:
    """The least |γ - near| that SciPy finds among activations that reach the target."""
    best = np.inf
    for start in starts:
        found = minimize(
            lambda x: 0.5 * ((x - near) ** 2).sum(),
            start,
            jac=lambda x: x - near,
            bounds=list(rod.box.bounds),
            constraints={
                "type": "eq",
                "fun": lambda x: rod.tips(x[None])[0] - target,
                "jac": lambda x: rod.tips_and_slopes(x[None])[1][0],
            },
            method="SLSQP",
            options={"ftol": 1e-14, "maxiter": 200},
        )
        inside = rod.box.clip(found.x)
        if np.linalg.norm(rod.tips(inside[None])[0] - target) < 1e-9:
            best = min(best, float(np.linalg.norm(inside - near)))
    return best


@pytest.mark.parametrize("design", [designs.redundant_trunk, six_bundles])
@pytest.mark.parametrize("place", ["interior", "edges"])
def test_no_search_from_many_starts_finds_less(design, place):
    arm = design()
    rod, rng = tip_map(arm), np.random.default_rng(0)
    gamma = activations(arm, 2, place, seed=5)
    if design is designs.redundant_trunk and place == "interior":
        gamma[0] = OVERLOOKED
    targets = rod.tips(gamma)
    for near in (np.zeros(arm.bundles), rng.uniform(*arm.bounds.T)):
        found = changes(solve_inverse(arm, targets, near=near), near)
        for target, least, known in zip(targets, found, gamma, strict=True):
            starts = np.concatenate([known[None], rng.uniform(*arm.bounds.T, (3, arm.bundles))])
            assert least <= least_from_many_starts(rod, target, near, starts) + 1e-6


@pytest.mark.parametrize(("bundles", "seed", "row"), LOCAL_MINIMA)
def test_a_local_minimum_larger_than_the_activation_drawn_is_left(bundles, seed, row):
    arm = random_design(bundles, seed)
    gamma = activations(arm, 1000, "edges")[row : row + 1]
    found = solve_inverse(arm, tip_positions(arm, gamma))
    assert changes(found)[0] <= np.linalg.norm(gamma) * (1 + 1e-9)


@pytest.mark.parametrize(
    "place",
    [
        "interior",
        "edges",
        *(pytest.param(p, marks=pytest.mark.large) for p in ("faces", "corners")),
    ],
)
def test_four_bundles_are_proved_to_change_least(place):
    arm = designs.redundant_trunk()
    targets = tip_positions(arm, activations(arm, 12, place, seed=2))
    found = solve_inverse(arm, targets, prove_least=True)
    assert found.least_proved.mean() > 0.9
    assert (found.change_bounds <= changes(found)).all()
    short = changes(found) - found.change_bounds
    assert np.array_equal(found.least_proved, short <= 1e-6)


@pytest.mark.parametrize("design", [designs.redundant_trunk, six_bundles])
def test_no_activation_that_reaches_a_target_changes_less_than_the_bound(design):
    # Every activation drawn reaches its own tip, so that it may not lie below the bound.
    arm = design()
    gamma = activations(arm, 8, "faces", seed=7)
    near = gamma + np.random.default_rng(1).normal(0.0, 0.05, gamma.shape)
    found = solve_inverse(arm, tip_positions(arm, gamma), near=near, prove_least=True)
    assert (found.change_bounds <= np.linalg.norm(gamma - near, axis=1)).all()
    assert (found.change_bounds >= 0).all()
    assert found.least_proved.any()


def test_a_larger_activation_is_never_proved_to_be_least(monkeypatch):
    from softreach.inverse import least_proofs as least_bound

    arm = designs.redundant_trunk()
    prepared = prepared_map(arm)
    gamma = activations(arm, 6, "interior", seed=3)
    targets, near = tip_positions(arm, gamma), np.zeros_like(gamma)
    least = changes(solve_inverse(prepared, targets))
    monkeypatch.setattr(least_bound, "_MOST_CELLS", 10_000)
    bounds = least_bound.change_bounds(
        prepared.rod, prepared.coarse_cells, targets, near, least + 0.01
    )
    assert (bounds <= least + 1e-9).all()


def test_nothing_is_proved_unless_asked_for_nor_where_nothing_is_reached():
    arm = designs.redundant_trunk()
    targets = [tip_positions(arm, [[-0.5, -0.2, -0.8, -0.4]])[0], [3.0, 0.0, 0.0]]
    plain = solve_inverse(arm, targets)
    assert not plain.least_proved.any()
    assert not plain.change_bounds.any()
    asked = solve_inverse(arm, targets, prove_least=True)
    assert asked.statuses.tolist() == [Status.REACHED, Status.UNREACHABLE]
    assert asked.least_proved.tolist() == [True, False]
    assert asked[0].least_proved
    assert asked[0].change_bound == pytest.approx(changes(asked[:1])[0], abs=1e-6)
    assert asked[1].change_bound == 0.0
    assert np.array_equal(asked.activations, plain.activations)


def test_held_bundles_take_no_part_in_the_proof():
    arm = random_design(5, 2)
    bounds = arm.bounds.copy()
    bounds[1] = -0.1
    held: Manipulator = arm.with_bounds(bounds)
    gamma = activations(held, 3, "interior", seed=4)
    found = solve_inverse(held, tip_positions(held, gamma), near=gamma + 0.02, prove_least=True)
    change = found.activations - gamma - 0.02
    change[:, 1] = 0.0
    assert np.allclose(np.linalg.norm(change, axis=1), found.change_bounds, atol=2e-6)


def test_the_least_compromise_with_a_direction_is_not_proved():
    with pytest.raises(InvalidInput, match="prove_least"):
        solve_inverse(
            designs.redundant_trunk(), [[0, 0, 0.5]], direction=(0, 0, 1), prove_least=True
        )


@pytest.mark.parametrize(
    "design",
    [
        designs.minimal_trunk,
        designs.redundant_trunk,
        six_bundles,
        fibers_and_a_tendon,
        designs.three_chamber_arm,
    ],
)
def test_the_remainder_of_the_linearization_is_within_the_bounds_of_its_cell_and_of_all(design):
    arm = design()
    rod, rng = tip_map(arm), np.random.default_rng(0)
    for cells in (1.5, 4, 30):
        half = rod.box.widths / 2 / cells
        center = rng.uniform(rod.box.low + half, rod.box.high - half, (4000, arm.bundles))
        change = half * rng.choice([-1.0, 1.0], center.shape)
        tips, slopes = rod.tips_and_slopes(center)
        rest = rod.tips(center + change) - tips - np.einsum("nij,nj->ni", slopes, change)
        errors = rod.linearization_errors(center, half)
        missed = np.linalg.norm(rest, axis=1)
        assert (missed <= errors).all()
        assert missed.max() <= rod.linearization_error(half)
        assert errors.max() <= rod.linearization_error(half) * (1 + 1e-12)


def pulled_in_pairs() -> Manipulator:
    """An arm whose inputs each pull some bundles and release others."""
    arm = random_design(5, 2)
    first, second, third, *_ = arm.bundle_names
    drive = Drive(name="a", bounds=(-0.2, 0.3), gains={first: 1.0, second: -0.8, third: 0.3})
    return arm.replace(drives=(drive,))


@pytest.mark.parametrize(
    "design",
    [
        designs.redundant_trunk,
        six_bundles,
        fibers_and_a_tendon,
        designs.three_chamber_arm,
        pulled_in_pairs,
    ],
)
def test_what_is_beyond_the_quadratic_part_is_within_the_bound_of_any_box_of_a_cell(design):
    rod, rng = prepared_map(design()).rod, np.random.default_rng(0)
    n, m = 500, rod.box.dimension
    for cells, size in product((1.5, 4, 30), (1.0, 0.3)):
        half = rod.box.widths / 2 / cells
        cell = rng.uniform(rod.box.low + half, rod.box.high - half, (n, m))
        inside = half * rng.uniform(size / 3, size, (n, m))
        center = cell + (half - inside) * rng.uniform(-1.0, 1.0, (n, m))
        change = inside * rng.choice([-1.0, 1.0], (n, m))
        (tips, slopes), seconds = rod.tips_and_slopes(center), np.empty((n, 3, m, m))
        for j, step in enumerate(1e-4 * np.diag(rod.box.widths)):
            ahead, behind = (rod.tips_and_slopes(center + s * step)[1] for s in (1, -1))
            seconds[..., j] = (ahead - behind) / (2 * step[j])
        quadratic = tips + np.einsum("nij,nj->ni", slopes, change)
        quadratic += 0.5 * np.einsum("nijk,nj,nk->ni", seconds, change, change)
        missed = np.linalg.norm(rod.tips(center + change) - quadratic, axis=1)
        errors = rod.cubic_remainder(cell, half).errors(np.arange(n), inside)
        assert (missed <= errors + 1e-12 * rod.length).all()
