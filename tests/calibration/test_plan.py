"""Planned poses tell more than others, and as much as they promise."""

import numpy as np
import pytest

import softreach as sr
from softreach.calibration import plan_poses
from softreach.calibration.free_numbers import free_numbers
from softreach.calibration.model import MarkerModel
from softreach.support.errors import InvalidInput
from tests.calibration.arms import MODULUS, hanging_tentacle, measured, random_inputs

ARM = hanging_tentacle()
FREE = [MODULUS, "t.distance", "pose"]


def log_determinant(inputs):
    """Of JᵀJ in the scales of the numbers."""
    free = free_numbers(ARM, FREE)
    slopes = MarkerModel(free, inputs, ("half", "tool")).predict(free.start, slopes=True).slopes
    rows = slopes.reshape(-1, len(free)) * free.scale
    return np.linalg.slogdet(rows.T @ rows)[1]


def test_planned_poses_tell_more_than_any_of_many_random_choices():
    plan = plan_poses(ARM, FREE, 8, candidates=256)
    others = [log_determinant(random_inputs(ARM, 8, seed)) for seed in range(30)]
    known = np.linalg.slogdet(plan.information * np.outer(plan.free.scale, plan.free.scale))[1]
    assert known == pytest.approx(log_determinant(plan.activations), abs=1e-6)
    assert known > max(others)


def test_the_errors_promised_are_those_of_fits():
    plan = plan_poses(ARM, FREE, 40, candidates=128)
    promised, noise = plan.sigma(3e-4), 3e-4
    values = []
    for seed in range(12):
        data = measured(ARM, noise=noise, seed=seed, inputs=plan.activations)
        result = sr.calibrate(ARM, data, free=FREE, robust=False, rivals=False)
        values.append([result.values[name] for name in plan.names])
    spread = np.std(values, axis=0, ddof=1)
    np.testing.assert_allclose(result.uncertainty.sigma, list(promised.values()), rtol=0.25)
    ratios = spread / np.array(list(promised.values()))
    assert np.sqrt(np.mean(ratios**2)) == pytest.approx(1.0, rel=0.25)


def test_poses_keep_apart_and_inside_of_the_box():
    plan = plan_poses(ARM, FREE, 12, candidates=256)
    low, high = ARM.input_bounds.T
    cube = (plan.activations - low) / (high - low)
    apart = np.linalg.norm(cube[:, None] - cube, axis=2)[np.triu_indices(12, 1)]
    assert apart.min() > 0.5 * 12 ** (-1 / 3)
    assert cube.min() >= 0.0
    assert cube.max() <= 1.0


def test_a_plan_is_a_dataset_of_its_poses_and_of_the_errors_to_expect():
    plan = plan_poses(ARM, FREE, 9, candidates=64)
    found = plan.to_dataset(2e-4)
    assert found.sizes == {"pose": 9, "input": 3, "number": 8, "other": 8}
    np.testing.assert_array_equal(found.activation, plan.activations)
    assert dict(zip(found.number.values, found.sigma.values, strict=True)) == plan.sigma(2e-4)
    assert found.unit.sel(number="pose.rx") == "rad"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (dict(n=1), "from 2 for these 8 numbers"),
        (dict(n=10**6), "n = 1000000"),
        (dict(markers=["disk"]), "of half, tool, each once"),
        (dict(markers=[]), "markers = none"),
        (dict(free=["rings[0].material.density"]), "leave out those that move none"),
        (dict(candidates=1), "candidates = 1"),
    ],
)
def test_plans_that_cannot_be_are_refused(options, said):
    with pytest.raises(InvalidInput, match=said):
        plan_poses(ARM, **{"free": FREE, "n": 9, "candidates": 32, **options})
