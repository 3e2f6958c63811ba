"""The least activation that reaches a target is found; bounds of what a linear map leaves."""

import numpy as np
import pytest
from benchmarks.adversarial_inverse import activations, random_design
from scipy.optimize import minimize

from softreach.arm import Drive, designs
from softreach.arm.manipulator import Manipulator
from softreach.inverse import prepared_map, solve_inverse
from softreach.rod import TipMap, as_tip_map, tip_positions
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
    rod, rng = as_tip_map(arm), np.random.default_rng(0)
    gamma = activations(arm, 2, place, seed=5)
    if design is designs.redundant_trunk and place == "interior":
        gamma[0] = OVERLOOKED
    targets = rod.tips(gamma)
    for near in (np.zeros(arm.bundles), rng.uniform(*arm.bounds.T)):
        found = changes(solve_inverse(arm, targets, near=near), near)
        for target, least, known in zip(targets, found, gamma, strict=True):
            starts = np.concatenate([known[None], rng.uniform(*arm.bounds.T, (3, arm.bundles))])
            assert least <= least_from_many_starts(rod, target, near, starts) + 1e-7


@pytest.mark.parametrize(("bundles", "seed", "row"), LOCAL_MINIMA)
def test_a_local_minimum_larger_than_the_activation_drawn_is_left(bundles, seed, row):
    arm = random_design(bundles, seed)
    gamma = activations(arm, 1000, "edges")[row : row + 1]
    found = solve_inverse(arm, tip_positions(arm, gamma))
    assert changes(found)[0] <= np.linalg.norm(gamma) * (1 + 1e-9)


def pulled_in_pairs() -> Manipulator:
    """An arm whose inputs each pull some bundles and release others."""
    arm = random_design(5, 2)
    first, second, third, *_ = arm.bundle_names
    drive = Drive(name="a", bounds=(-0.2, 0.3), gains={first: 1.0, second: -0.8, third: 0.3})
    return arm.replace(drives=(drive,))


@pytest.mark.parametrize(
    "design",
    [
        designs.minimal_trunk,
        designs.redundant_trunk,
        six_bundles,
        fibers_and_a_tendon,
        designs.three_chamber_arm,
        pulled_in_pairs,
    ],
)
def test_the_remainder_of_the_linearization_is_within_the_bounds_of_its_cell_and_of_all(design):
    rod, rng = prepared_map(design()).tip_map, np.random.default_rng(0)
    for cells in (1.5, 4, 30):
        half = rod.box.widths / 2 / cells
        center = rng.uniform(rod.box.low + half, rod.box.high - half, (4000, len(half)))
        change = half * rng.choice([-1.0, 1.0], center.shape)
        tips, slopes = rod.tips_and_slopes(center)
        rest = rod.tips(center + change) - tips - np.einsum("nij,nj->ni", slopes, change)
        errors = rod.linearization_errors(center, half)
        missed = np.linalg.norm(rest, axis=1)
        assert (missed <= errors).all()
        assert missed.max() <= rod.linearization_error(half)
        assert errors.max() <= rod.linearization_error(half) * (1 + 1e-12)
