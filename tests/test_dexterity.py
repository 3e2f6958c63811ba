"""Dexterity of clouds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softreach.arm import designs
from softreach.arm.actuators import Chamber
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.dexterity import dexterity, solution_measure
from softreach.inverse import solve_inverse
from softreach.rod.kinematics import tip_jacobian, tip_positions
from softreach.support.errors import InvalidInput
from softreach.workspace import reachable_set


def differences(arm, gamma, step=1e-6):
    """Central differences of the tips, shape (n, 3, m)."""
    columns = []
    for j in range(arm.bundles):
        shift = step * np.eye(arm.bundles)[j]
        ahead, behind = tip_positions(arm, gamma + shift), tip_positions(arm, gamma - shift)
        columns.append((ahead - behind) / (2 * step))
    return np.stack(columns, axis=-1)


@pytest.mark.parametrize("design", [designs.minimal_trunk, designs.redundant_trunk])
def test_manipulability_is_the_root_of_det_of_j_times_its_transpose(design):
    arm = design(np.radians(36), np.radians(3))
    cloud = compute_cloud(arm, n=300)
    found, slope = dexterity(cloud), differences(arm, cloud.activation.values)
    gram = slope @ slope.transpose(0, 2, 1)
    expected = np.sqrt(np.maximum(np.linalg.det(gram), 0))
    assert np.allclose(found.manipulability, expected, rtol=1e-4, atol=1e-7)
    well = found.condition.values < 1e3
    assert np.allclose(found.condition[well], np.linalg.cond(slope[well]), rtol=1e-3)


def test_both_orientations_occur_where_the_map_folds():
    arm = designs.minimal_trunk(np.radians(36), np.radians(3))
    cloud = compute_cloud(arm, n=2000)
    found = dexterity(cloud)
    signs = np.sign(np.linalg.det(differences(arm, cloud.activation.values)))
    sure = found.manipulability.values > 1e-5
    assert np.array_equal(found.orientation.values[sure], signs[sure])
    assert {-1, 1} == set(found.orientation.values)


def test_three_bundles_sweep_the_volume_that_manipulability_says(trunk):
    found = dexterity(compute_cloud(trunk, n=20_000))
    swept = float(found.manipulability.mean()) * (5 / 3) ** 3
    assert swept == pytest.approx(0.69, abs=0.02)  # the doubly covered part is negligible


def test_fewer_bundles_have_an_area_or_a_length_and_no_orientation(trunk):
    for kept in (1, 2):
        arm = trunk.replace(actuators=trunk.actuators[:kept])
        cloud = compute_cloud(arm, n=50)
        found, slope = dexterity(cloud), differences(arm, cloud.activation.values)
        gram = slope.transpose(0, 2, 1) @ slope
        assert np.allclose(found.manipulability, np.sqrt(np.linalg.det(gram)), rtol=1e-5)
        assert "orientation" not in found


def test_manipulability_and_families_have_the_units_of_their_inputs(trunk):
    def units(arm):
        cloud = compute_cloud(arm, n=8, sampler="sobol")
        found = [dexterity(cloud).manipulability.attrs["units"]]
        if arm.bundles > 2:
            found.append(solution_measure(cloud, cell=arm.length).solution_measure.attrs["units"])
        return found

    robot = designs.three_tendon_robot()
    tendons = robot.actuators[0]
    mixed = robot.replace(
        actuators=(tendons, Chamber(distance=0.001, radius=1e-3, activation_bounds=(0, 1e3)))
    )
    assert units(trunk) == ["m3", "1"]
    assert units(robot) == ["m3/N3", "1"]
    assert units(robot.replace(actuators=(replace(tendons, bundles=2),))) == ["m2/N2"]
    assert units(robot.replace(actuators=(replace(tendons, bundles=5),))) == ["m3/N3", "N2"]
    assert units(mixed) == ["m3/mixed", "mixed"]
    fewer = robot.replace(actuators=(replace(tendons, bundles=1), mixed.actuators[1]))
    assert units(fewer) == ["m2/(N Pa)"]


def test_only_a_cloud_has_dexterity(trunk):
    with pytest.raises(InvalidInput, match="cloud"):
        dexterity(compute_cloud(trunk, n=10).drop_vars("tip"))


def position_slope(arm, gamma):
    """Tip and ∂r/∂γ of one activation."""
    tip, twist = tip_positions(arm, [gamma])[0], tip_jacobian(arm, [gamma])[0]
    return tip, twist[:3] + np.cross(twist[3:], tip[:, None], axis=0)


def solution_curve(arm, target, start, step=0.04):
    """Points every `step` along the curve of activations of one tip through `start`."""
    curve = [start]
    for sense in (1, -1):
        gamma, way = start, sense * np.linalg.svd(position_slope(arm, start)[1])[2][3]
        while True:
            ahead = gamma + step * way
            for _ in range(2):
                tip, slope = position_slope(arm, ahead)
                ahead = ahead + np.linalg.pinv(slope) @ (target - tip)
            if not ((arm.bounds[:, 0] <= ahead) & (ahead <= arm.bounds[:, 1])).all():
                break
            new = np.linalg.svd(slope)[2][3]
            gamma, way = ahead, new * np.sign(new @ way)
            curve.append(gamma)
    return np.array(curve)


@pytest.mark.large
def test_with_four_bundles_the_measure_is_the_length_of_the_curve_of_solutions():
    arm, step = designs.redundant_trunk(), 0.1
    cloud = compute_cloud(arm, n=1 << 19, sampler="sobol")
    measure = solution_measure(cloud, cell=0.2).solution_measure
    for place in ([0.1, -0.3, 0.5], [-0.1, 0.3, 0.7]):  # cells that lie inside
        found = float(measure.sel(dict(zip("xyz", place, strict=True)), method="nearest"))
        targets = place + np.random.default_rng(0).uniform(-0.1, 0.1, (80, 3))
        total = 0.0
        for solution in solve_inverse(arm, targets, family=6):
            known = np.full((1, 4), np.inf)
            for start in solution.activations:
                if np.linalg.norm(known - start, axis=1).min() > step:
                    curve = solution_curve(arm, solution.target, start, step)
                    total += step * len(curve)  # half a step is lost at each end
                    known = np.vstack([known, curve])
        # Both are means over the cell, of standard errors about 0.02 and 0.03.
        assert found == pytest.approx(total / len(targets), rel=0.1)


def test_with_three_bundles_the_measure_is_the_number_of_activations(trunk):
    cloud = compute_cloud(trunk, n=1 << 17, sampler="sobol")
    measure = solution_measure(cloud, cell=0.1).solution_measure
    reached = reachable_set(trunk)
    centers = np.stack(np.meshgrid(measure.x, measure.y, measure.z, indexing="ij"), -1)
    depth = reached.distance(centers.reshape(-1, 3)).reshape(measure.shape)
    inner = measure.values[depth < -0.1]
    assert len(inner) > 100
    assert inner.mean() == pytest.approx(1.0, abs=5e-3)
    assert inner.std() < 0.12  # some 190 samples in each cell
    total = float(measure.sum()) * 0.1**3
    assert total == pytest.approx(reached.volume, rel=2e-3)


def test_measures_of_many_clouds_scatter_by_their_standard_error(trunk):
    clouds = [compute_cloud(trunk, n=4096, seed=seed, tol=1e-4) for seed in range(60)]
    inner = {"x": 0.1, "y": 0.3, "z": 0.5}
    found = [
        solution_measure(cloud, cell=0.2).sel(inner, method="nearest").to_array()
        for cloud in clouds
    ]
    values, errors = np.array(found).T
    assert errors.mean() == pytest.approx(values.std(), rel=0.25)


def test_the_measure_asks_for_an_even_cloud_of_three_bundles_or_more(trunk):
    for sampler, n in (("boundary", 100), ("grid", 125)):
        with pytest.raises(InvalidInput, match=f"sampler = {sampler}: must be one of uniform"):
            solution_measure(compute_cloud(trunk, n=n, sampler=sampler))
    flat = trunk.replace(actuators=trunk.actuators[:2])
    with pytest.raises(InvalidInput, match="bundles = 2: must be 3 or more"):
        solution_measure(compute_cloud(flat, n=100))
    fixed = trunk.with_bounds(((-1, 0), (-1, 0), (-1, -1)))
    with pytest.raises(InvalidInput, match="must be lower < upper for every bundle"):
        solution_measure(compute_cloud(fixed, n=100))
    with pytest.raises(InvalidInput, match="cell = 0: must be"):
        solution_measure(compute_cloud(trunk, n=100), cell=0)
