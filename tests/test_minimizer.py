"""Minima inside bounds, and the gradients that lead there."""

from functools import partial

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from softreach.arm import designs
from softreach.arm.stations import Marker
from softreach.inverse.direction import minimize, pose_model
from softreach.inverse.request import Request
from softreach.rod import ActivationBox, as_tip_map, configuration
from softreach.workspace.search import CLOSELY, nearest_tips
from tests.laws import differences, in_box


def unit_box(m: int) -> ActivationBox:
    return ActivationBox.between([[0.0, 1.0]] * m, [str(j) for j in range(m)])


@pytest.mark.parametrize("m", [1, 2, 4])
def test_a_quadratic_has_the_minimum_in_the_box_that_scipy_finds(m):
    rng = np.random.default_rng(m)
    factor, center = rng.normal(size=(30, m + 1, m)), rng.normal(0.5, 1.0, (30, m))

    def evaluate(which, gamma):
        residual = np.einsum("nij,nj->ni", factor[which], gamma - center[which])
        transposed = factor[which].transpose(0, 2, 1)
        gradient = np.einsum("nji,ni->nj", transposed, residual)
        return 0.5 * (residual**2).sum(axis=1), gradient, transposed @ factor[which]

    gamma, value = minimize(evaluate, rng.random((30, m)), unit_box(m))
    for i in range(30):
        best = lsq_linear(factor[i], factor[i] @ center[i], (0, 1), tol=1e-14, method="bvls")
        assert np.allclose(gamma[i], best.x, atol=1e-7)
        assert value[i] == pytest.approx(best.cost, abs=1e-12)


def test_searches_do_not_depend_on_each_other():
    def evaluate(which, gamma):
        x = 4 * gamma - which[:, None] / 10
        hessian = (16 * (12 * x**2 - 2))[:, :, None] * np.eye(2)
        return (x**4 - x**2).sum(axis=1), 4 * (4 * x**3 - 2 * x), hessian

    start = np.random.default_rng(0).random((12, 2))
    together, _ = minimize(evaluate, start, unit_box(2))
    for i in (0, 5, 11):
        of_one = partial(lambda i, which, gamma: evaluate(which + i, gamma), i)
        alone, _ = minimize(of_one, start[[i]], unit_box(2))
        assert np.array_equal(alone[0], together[i])


@pytest.mark.parametrize("design", [designs.minimal_trunk, designs.redundant_trunk])
def test_no_bundle_brings_the_nearest_tip_nearer_to_a_target_out_of_reach(design):
    rod, rng = as_tip_map(design()), np.random.default_rng(4)
    targets = 1.5 * rng.normal(size=(40, 3)) / np.sqrt(3) * rod.length
    found = nearest_tips(rod, in_box(rod.arm, 40), targets, 1e-10, CLOSELY)
    far = found.distance > 1e-3
    assert far.sum() > 30
    toward = (targets - found.tips)[far] / found.distance[far, None]
    slopes = rod.tips_and_slopes(found.gamma[far])[1]
    gain = np.einsum("ni,nij->nj", toward, slopes)
    ahead = found.gamma[far] + 1e-9 * np.sign(gain)
    gain[(ahead < rod.box.low) | (ahead > rod.box.high)] = 0.0
    assert np.abs(gain).max() < 1e-5


@pytest.mark.parametrize("weight", [0.7, 3.0])
@pytest.mark.parametrize("cone", [0.0, 0.4])
@pytest.mark.parametrize(("pull", "within"), [(0.0, 0.0), (1e-2, 0.0), (0.0, 1.6)])
@pytest.mark.parametrize("markers", [(), (Marker(name="elbow", station_over_length=0.4),)])
def test_the_gradient_of_a_pose_is_its_derivative(weight, cone, pull, within, markers):
    # Directions and Jacobians have steps of their own; the finer they are, the nearer they agree.
    arm, rng = designs.redundant_trunk().replace(markers=markers), np.random.default_rng(2)
    rod = as_tip_map(arm, tol=1e-10)
    gamma = in_box(rod.arm, 9)
    direction = rng.normal(size=(9, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    request = Request(
        targets=rng.normal(size=(9, 3)), residual=1e-10, reach_tol=1e-6, direction_weight=weight,
        near=in_box(rod.arm, 9, seed=5), direction=direction, cone=cone,
        within=within, markers={x.name: rng.normal(size=(9, 3)) for x in markers},
        marker_within={"elbow": within},
    )  # fmt: skip
    which = np.array([3, 3, 0, 8, 1, 2, 7, 5, 4])
    expected = differences(lambda x: pose_model(rod, request, pull, which, x)[0], gamma)
    gradient = pose_model(rod, request, pull, which, gamma)[1]
    assert np.allclose(gradient, expected, rtol=1e-7, atol=1e-7 * np.abs(expected).max())


def test_tip_motions_are_tips_slopes_tangents_and_the_turn_of_tangents():
    arm = designs.redundant_trunk()
    rod, gamma = as_tip_map(arm), in_box(arm, 30)
    *motions, directions, rotations = rod.tip_motions(gamma)
    tips, slopes = rod.tips_and_slopes(gamma)
    rounding = {"rtol": 0.0, "atol": 1e-14}  # two kernels: one with turns, one without
    assert np.allclose(motions[0], tips, **rounding)
    assert np.allclose(motions[1], slopes, **rounding)
    d3 = configuration(arm, gamma, [arm.length]).directors.values[:, 0, 2]
    assert np.allclose(directions, d3, atol=1e-6)
    turn = np.cross(rotations, directions[:, :, None], axis=1)
    assert np.allclose(turn, differences(rod.tip_directions, gamma), atol=1e-6)
