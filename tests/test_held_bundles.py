"""Bundles held at one activation are no variables: the others are solved for as if alone."""

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.manipulator import Manipulator
from softreach.inverse import Status, prepared_map, solve_inverse
from softreach.inverse.path import track_path
from softreach.rod import as_tip_map, configuration, free_bundles, tip_positions
from softreach.support.errors import InvalidInput
from tests.laws import in_box, large, miss_of_original

FINE = 1e-9  # arms with and without a bundle have steps of their own, each within this


def holding(arm: Manipulator, held: dict[int, float]) -> Manipulator:
    bounds = np.array(arm.bounds)
    for bundle, value in held.items():
        bounds[bundle] = value
    return arm.with_bounds(bounds)


def without(arm: Manipulator, bundle: int) -> Manipulator:
    return arm.replace(actuators=(*arm.actuators[:bundle], *arm.actuators[bundle + 1 :]))


def test_results_name_the_bundles_that_their_tip_map_has():
    arm = holding(designs.redundant_trunk(), {1: -0.5})
    rod, gamma = free_bundles(as_tip_map(arm)), [-0.4, -0.8, -0.3]
    names = [name for k, name in enumerate(arm.bundle_names) if k != 1]
    shape = configuration(rod, gamma, 5)
    assert shape.bundle.values.tolist() == names
    target = rod.tips([gamma])
    solved = solve_inverse(rod, target).to_dataset()
    assert solved.bundle.values.tolist() == names
    np.testing.assert_allclose(solved.activation.sel(bundle=names[0])[0], -0.4, atol=1e-6)
    path = track_path(rod, rod.tips([gamma, np.add(gamma, 0.01)]), gamma)
    assert path.bundle.values.tolist() == names


def _with_five_bundles() -> Manipulator:
    four = designs.redundant_trunk()
    left, right, first, second = four.actuators
    half = first.extent / 2
    beside = (
        first.replace(name=f"{first.name} {k}", offset=first.offset + side * half)
        for k, side in ((1, -1), (2, 1))
    )
    return four.replace(actuators=(left, right, *beside, second))


FIVE = _with_five_bundles()


@pytest.mark.parametrize("bundle", range(4))
def test_the_tip_map_of_the_free_bundles_is_that_of_all_on_a_face_of_the_box(bundle):
    arm = holding(designs.redundant_trunk(), {bundle: -0.3})
    whole, part = as_tip_map(arm), free_bundles(as_tip_map(arm))
    gamma = in_box(arm, 40)
    free = np.delete(gamma, bundle, axis=1)
    assert part.box.names == tuple(np.delete(arm.bundle_names, bundle))
    assert np.array_equal(whole.box.with_fixed(free), gamma)
    assert np.array_equal(part.tips(free), whole.tips(gamma))
    for of_part, of_all in zip(part.tip_motions(free), whole.tip_motions(gamma), strict=True):
        expected = of_all if of_all.ndim == 2 else np.delete(of_all, bundle, axis=2)
        assert np.array_equal(of_part, expected)
    assert np.array_equal(
        part.tips_and_slopes(free)[1], np.delete(whole.tips_and_slopes(gamma)[1], bundle, axis=2)
    )
    stations = [0.3, arm.length]
    assert np.array_equal(part.frames(free, stations)[1], whole.frames(gamma, stations)[1])
    assert np.array_equal(part.strains(free, stations)[0], whole.strains(gamma, stations)[0])
    assert np.array_equal(part.radius(stations), whole.radius(stations))
    assert np.array_equal(part.status(free), whole.status(gamma))
    assert free_bundles(part) is part


@pytest.mark.parametrize("bundle", [0, *large(1, 2, 3)])
def test_one_of_four_bundles_held_at_rest_leaves_every_solution_of_the_arm_without_it(bundle):
    four = designs.redundant_trunk(np.radians(36), np.radians(3))
    held, three = holding(four, {bundle: 0.0}), without(four, bundle)
    anywhere = np.random.default_rng(0).uniform(-1, 1, (4, 3))
    targets = np.concatenate([tip_positions(three, in_box(three, 100), tol=FINE), anywhere])
    found = solve_inverse(held, targets, tol=FINE)
    expected = solve_inverse(three, targets, tol=FINE)
    assert np.array_equal(found.counts, expected.counts)
    assert np.array_equal(found.statuses, expected.statuses)
    assert (found.activations[:, bundle] == 0.0).all()
    # Near a fold an activation moves by the root of what the tip does.
    tolerance = 1e-6 * np.maximum(1.0, expected.conditions[:, None])
    apart = np.abs(np.delete(found.activations, bundle, axis=1) - expected.activations)
    assert (apart < tolerance).all()
    assert np.allclose(found.conditions, expected.conditions, rtol=1e-3)
    assert np.allclose(found.margins, expected.margins, atol=tolerance[:, 0])
    assert np.allclose(found.gaps, expected.gaps, atol=1e-7)


@pytest.mark.parametrize("bundle", [1, *large(0, 2, 3)])
def test_every_activation_is_found_with_one_of_four_bundles_held_anywhere(bundle):
    arm = holding(designs.redundant_trunk(np.radians(36), np.radians(3)), {bundle: -0.45})
    gamma = in_box(arm, 1000)
    targets = tip_positions(arm, gamma)
    found = solve_inverse(arm, targets)
    assert (found.statuses == Status.REACHED).all()
    assert (found.activations[:, bundle] == -0.45).all()
    assert miss_of_original(found, gamma).max() < 1e-6
    finer = solve_inverse(prepared_map(arm, cells=48), targets)
    assert (found.counts != finer.counts).mean() < 2e-3


@pytest.mark.parametrize("pair", [(1, 3), *large((0, 1), (3, 4))])
def test_five_bundles_with_two_held_are_a_problem_of_three(pair):
    arm = holding(FIVE, dict(zip(pair, (-0.2, -0.9), strict=True)))
    gamma = in_box(arm, 200)
    found = solve_inverse(arm, tip_positions(arm, gamma))
    assert (found.statuses == Status.REACHED).all()
    assert miss_of_original(found, gamma).max() < 1e-6
    assert found.residuals.max() < 1e-10
    slopes = np.delete(as_tip_map(arm).tips_and_slopes(found.activations)[1], pair, axis=2)
    assert np.allclose(found.conditions, np.linalg.cond(slopes), rtol=1e-3)


def test_five_bundles_with_one_held_at_rest_change_as_little_as_four():
    held, four = holding(FIVE, {2: 0.0}), without(FIVE, 2)
    targets = tip_positions(four, in_box(four, 5), tol=FINE)
    near = np.array([-0.8, -0.2, -1.0, -0.5])
    found = solve_inverse(held, targets, near=np.insert(near, 2, -7.0), family=2, tol=FINE)
    expected = solve_inverse(four, targets, near=near, family=2, tol=FINE)
    assert (found.statuses == Status.REACHED).all()
    assert found.counts.max() == 2
    assert np.array_equal(found.counts, expected.counts)
    assert (found.activations[:, 2] == 0.0).all()
    assert np.allclose(np.delete(found.activations, 2, axis=1), expected.activations, atol=1e-3)
    changes, least = (
        np.linalg.norm(one.activations[one.offsets[:-1]] - near_one, axis=1)
        for one, near_one in ((found, np.insert(near, 2, 0.0)), (expected, near))
    )
    assert np.allclose(changes, least, atol=1e-7)


def test_an_arm_that_cannot_move_reaches_one_place(trunk):
    arm = holding(trunk, {0: -0.5, 1: -0.1, 2: -0.3})
    tip = tip_positions(arm, [[-0.5, -0.1, -0.3]])
    at, away = solve_inverse(arm, np.concatenate([tip, tip + [0.0, 0.0, 0.2]]))
    assert at.status is Status.REACHED
    assert at.activations.tolist() == [[-0.5, -0.1, -0.3]]
    assert away.status is Status.UNREACHABLE
    assert away.gap == pytest.approx(0.2)
    assert np.array_equal(away.nearest, tip[0])


def test_a_path_is_followed_with_a_bundle_held_at_rest_as_without_it():
    four = designs.redundant_trunk()
    held, three = holding(four, {1: 0.0}), without(four, 1)
    begin = np.array([-0.4, -0.8, -0.3])
    path = tip_positions(three, np.linspace(begin, [-0.9, -0.2, -0.7], 8), tol=FINE)
    path = np.concatenate([path, path[-1:] + [0.0, 0.0, 1.0]])
    start = np.insert(begin, 1, -1.0)  # a held bundle stays where it is held
    found = track_path(held, path, start, tol=FINE)
    expected = track_path(three, path, begin, tol=FINE)
    assert np.array_equal(found.status, expected.status)
    for name in ("end", "end_bundle", "end_bound"):
        assert found.attrs[name] == expected.attrs[name]
    assert found.attrs["end"] == "bound"
    activation = np.delete(found.activation.values, 1, axis=1)
    assert np.allclose(activation, expected.activation, atol=1e-6, equal_nan=True)
    assert (found.activation.values[:8, 1] == 0.0).all()


def test_two_free_bundles_follow_no_path_in_space(trunk):
    with pytest.raises(InvalidInput, match="free bundles = 2"):
        track_path(holding(trunk, {1: -0.5}), [[0.0, 0.0, 0.9]])
