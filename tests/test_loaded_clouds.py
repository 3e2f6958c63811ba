"""Clouds of loaded arms: what asks where the arm can be counts its stable equilibria only."""

from __future__ import annotations

import csv

import numpy as np
import pytest

from softreach.arm import Loads, designs
from softreach.cloud.clouds import compute_cloud, open_cloud, save_cloud
from softreach.cloud.curvature import curvature_statistics
from softreach.cloud.dexterity import dexterity, solution_measure
from softreach.cloud.redundancy import activation_distance, redundancy_summary, tip_density
from softreach.cloud.volume import concave_hull, convex_hull, unreachability
from softreach.export import export_cloud
from softreach.plot.coloring import color_samples
from softreach.rod import configuration, tip_map
from softreach.rod.view import free_bundles

SAMPLES = 3000
LOADS = Loads(gravity=(0.0, 0.0, 9.81), payload=0.020)


@pytest.fixture(scope="module")
def cloud():
    """A cloud whose first samples are unstable, or without an equilibrium."""
    cloud = compute_cloud(designs.lce_arm().replace(loads=LOADS), SAMPLES)
    tip, status = cloud.tip.values.copy(), cloud.status.values.copy()
    status[:40], status[40:60] = 1, 2
    tip[:40], tip[40:60] = 10.0, np.nan  # far away, so that none can be counted unseen
    return cloud.assign(tip=cloud.tip.copy(data=tip)).assign_coords(status=("sample", status))


def kept(cloud):
    return cloud.isel(sample=np.flatnonzero(cloud.status.values == 0))


def test_hulls_are_those_of_the_stable_tips(cloud):
    stable = kept(cloud).tip.values
    assert concave_hull(cloud.tip, 0.02).volume == concave_hull(stable, 0.02).volume
    assert convex_hull(cloud.tip).volume == convex_hull(stable).volume
    assert convex_hull(cloud.tip.transpose("axis", "sample")).volume == convex_hull(stable).volume
    assert unreachability(cloud.tip, 0.02) == unreachability(stable, 0.02)


def test_neighbors_are_stable_tips(cloud):
    radius, stable = 0.01, cloud.status.values == 0
    found = activation_distance(cloud, radius)
    assert np.isnan(found.values[~stable]).all()
    assert (found.neighbors.values[~stable] == 0).all()
    tip, gamma = cloud.tip.values[stable], cloud.activation.values[stable]
    for i in range(0, len(tip), 500):
        near = np.linalg.norm(tip - tip[i], axis=1) <= radius
        near[i] = False
        expected = np.linalg.norm(gamma[near] - gamma[i], axis=1).mean()
        assert found.values[stable][i] == pytest.approx(expected, rel=1e-12)
    some = activation_distance(cloud, radius, queries=[5, 1000])
    assert np.isnan(some.values[0])
    assert some.values[1] == found.values[1000]


def test_summaries_of_redundancy_leave_out_what_is_not_stable(cloud):
    whole = redundancy_summary(cloud, activation_distance(cloud, 0.01))
    part = redundancy_summary(kept(cloud), activation_distance(kept(cloud), 0.01))
    assert whole == part


def test_densities_count_stable_tips(cloud):
    found = tip_density(cloud)
    stable = int((cloud.status == 0).sum())
    assert float(found.density.sum()) * found.attrs["cell"] ** 3 == pytest.approx(stable)


def test_dexterity_is_nan_where_the_arm_cannot_be(cloud):
    arm = designs.lce_arm().replace(loads=LOADS)
    plain = compute_cloud(arm, SAMPLES)
    found = dexterity(plain)
    lost = plain.status.values != 0
    assert lost.any()
    assert np.array_equal(np.isnan(found.manipulability.values), lost)
    assert np.array_equal(found.orientation.values == 0, lost)
    _, slope = tip_map(arm).tips_and_slopes(plain.activation.values[:50])
    expected = np.abs(np.linalg.det(slope))
    good = ~lost[:50]
    assert np.allclose(found.manipulability.values[:50][good], expected[good], rtol=1e-9)
    measure = solution_measure(plain)
    volume = float(np.prod(np.ptp(arm.bounds, axis=1)))
    total = float(measure.solution_measure.sum()) * measure.attrs["cell"] ** 3
    mean = float(np.nansum(found.manipulability.values)) / SAMPLES
    assert total == pytest.approx(volume * mean)


def test_strains_are_those_of_stable_equilibria():
    cloud = compute_cloud(designs.lce_arm().replace(loads=LOADS), SAMPLES)
    lost = int((cloud.status != 0).sum())
    assert lost > 0
    assert curvature_statistics(cloud, [0.09]).samples == SAMPLES - lost


def test_exports_and_stores_keep_the_status(cloud, tmp_path):
    export_cloud(cloud, tmp_path / "cloud.csv")
    export_cloud(cloud, tmp_path / "cloud.npz")
    with (tmp_path / "cloud.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [int(row["status"]) for row in rows] == cloud.status.values.tolist()
    assert np.array_equal(np.load(tmp_path / "cloud.npz")["status"], cloud.status.values)
    export_cloud(cloud, tmp_path / "cloud.ply")
    assert b"property uchar status" in (tmp_path / "cloud.ply").read_bytes()[:20_000]
    save_cloud(cloud, tmp_path / "cloud.zarr")
    opened = open_cloud(tmp_path / "cloud.zarr")
    assert np.array_equal(opened.tip.status.values, cloud.status.values)


@pytest.mark.parametrize("color", ["rgb", 1])
def test_unstable_samples_have_a_color_of_their_own_and_a_key(cloud, color):
    coloring = color_samples(cloud, color)
    unstable = cloud.status.values == 1
    marks = np.unique(coloring.rgb[unstable], axis=0)
    assert len(marks) == 1
    assert not (coloring.rgb[~unstable] == marks[0]).all(axis=1).any()
    assert coloring.key is not None
    assert coloring.key.unstable
    plain = color_samples(kept(cloud), color).key
    assert plain is not None
    assert not plain.unstable


def test_a_cloud_of_free_bundles_is_that_of_the_arm():
    arm = designs.lce_arm()
    low, high = arm.bounds.T
    held = arm.with_bounds([(low[0], high[0]), (low[1], high[1]), (low[2], low[2])])
    part, whole = compute_cloud(free_bundles(tip_map(held)), 50), compute_cloud(held, 50)
    assert np.array_equal(part.activation.values, whole.activation.values)
    assert np.array_equal(part.tip.values, whole.tip.values)


def test_a_configuration_says_whether_it_is_stable():
    arm = designs.lce_arm().replace(loads=LOADS)
    cloud = compute_cloud(arm, SAMPLES)
    shapes = configuration(arm, cloud.activation.values[:200])
    assert np.array_equal(shapes.status.values, cloud.status.values[:200])
