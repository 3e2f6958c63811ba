"""Dexterity of clouds."""

from __future__ import annotations

import numpy as np
import pytest

from softreach import designs
from softreach.cloud import compute_cloud
from softreach.dexterity import dexterity
from softreach.errors import InvalidInput
from softreach.kinematics import tip_positions


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
        arm = trunk.replace(fibers=trunk.fibers[:kept])
        cloud = compute_cloud(arm, n=50)
        found, slope = dexterity(cloud), differences(arm, cloud.activation.values)
        gram = slope.transpose(0, 2, 1) @ slope
        assert np.allclose(found.manipulability, np.sqrt(np.linalg.det(gram)), rtol=1e-5)
        assert "orientation" not in found


def test_only_a_cloud_has_dexterity(trunk):
    with pytest.raises(InvalidInput, match="cloud"):
        dexterity(compute_cloud(trunk, n=10).drop_vars("tip"))
