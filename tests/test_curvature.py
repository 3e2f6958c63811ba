"""Laws of curvature statistics: what streaming must not change, and what taper does."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import softreach as sr
from softreach.cloud.curvature import curvature_statistics, distal_stations, stream_statistics
from softreach.support.errors import InvalidInput


@pytest.fixture(scope="module")
def cloud():
    return sr.compute_cloud(sr.designs.minimal_trunk(), n=30_000, seed=3)


@pytest.fixture(scope="module")
def shapes(cloud):
    """The same numbers from the whole configurations."""
    arm = sr.cloud.design_of(cloud)
    z = np.concatenate([[0.0], distal_stations(arm)])
    return sr.configuration(arm, cloud.activation.values, z).isel(station=slice(1, None))


def test_moments_and_extremes_are_those_of_the_configurations(cloud, shapes):
    found = curvature_statistics(cloud, quantiles=(0.0, 1.0))
    u = shapes.curvature.values
    values = {
        "bending": np.hypot(u[..., 0], u[..., 1]),
        "torsion": u[..., 2],
        "extension": shapes.extension.values,
    }
    for name, truth in values.items():
        np.testing.assert_allclose(found[f"{name}_mean"], truth.mean(axis=0), rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(found[f"{name}_std"], truth.std(axis=0), rtol=1e-6, atol=1e-9)
        ends = np.stack([truth.min(axis=0), truth.max(axis=0)], axis=1)
        np.testing.assert_allclose(found[f"{name}_quantile"], ends, rtol=1e-12, atol=1e-12)


def test_quantiles_are_good_to_a_bin(cloud, shapes):
    shares = (0.05, 0.5, 0.95)
    found = curvature_statistics(cloud, quantiles=shares, bins=256)
    u = shapes.curvature.values
    truth = np.quantile(np.hypot(u[..., 0], u[..., 1]), shares, axis=0).T
    width = np.diff(found.bending_edge.values[:, :2], axis=1)
    assert (np.abs(found.bending_quantile.values - truth) <= width).all()


def test_every_sample_is_counted_once_inside_the_range_of_the_box(cloud):
    found = curvature_statistics(cloud, bins=64)
    for name in ("bending", "torsion", "extension"):
        assert (found[f"{name}_count"].sum("bin") == cloud.sizes["sample"]).all()


def test_blocks_do_not_matter(cloud):
    arm, gamma = sr.cloud.design_of(cloud), cloud.activation.values
    whole, cut = stream_statistics(arm, [gamma]), stream_statistics(arm, np.array_split(gamma, 7))
    assert whole.bending_count.equals(cut.bending_count)
    np.testing.assert_allclose(whole.bending_mean, cut.bending_mean, rtol=1e-12)


def test_corners_of_the_box_lie_within_the_histogram_and_nearly_fill_it():
    arm = sr.designs.minimal_trunk()
    corners = np.array(np.meshgrid(*arm.bounds)).reshape(3, -1).T
    found = stream_statistics(arm, [corners], quantiles=(1.0,))
    largest, end = found.bending_quantile[:, 0], found.bending_edge[:, -1]
    assert (largest <= end).all()
    assert (largest >= end * (1 - 2e-5)).all()


def test_a_single_bundle_that_cannot_move_has_one_value():
    arm = sr.designs.minimal_trunk().with_bounds((-0.5, -0.5))
    found = stream_statistics(arm, [np.full((10, 3), -0.5)])
    np.testing.assert_allclose(found.extension_std, 0.0, atol=1e-12)
    assert (found.extension_quantile.std("quantile") < 1e-12).all()


def test_taper_widens_and_raises_the_curvature_toward_the_tip():
    plain, tapered = (
        curvature_statistics(
            sr.compute_cloud(sr.designs.minimal_trunk(taper=np.radians(phi)), n=20_000)
        )
        for phi in (0, 3)
    )
    spread = {"plain": plain, "tapered": tapered}
    q = {k: s.bending_quantile.sel(quantile=[0.05, 0.5, 0.95]).values for k, s in spread.items()}
    assert (np.diff(q["tapered"][:, 1]) > 0).all()  # the median grows from station to station
    assert np.ptp(q["plain"][:, 1]) < 0.2 * np.ptp(q["tapered"][:, 1])
    width = {k: v[:, 2] - v[:, 0] for k, v in q.items()}
    assert (width["tapered"] > 1.4 * width["plain"]).all()
    assert (np.diff(width["tapered"]) > 0).all()


@pytest.mark.parametrize("stations", [[-0.1], [1.1], [], [[0.5], [0.6]], [np.nan]])
def test_stations_off_the_arm_are_refused(cloud, stations):
    with pytest.raises(InvalidInput, match=r"stations = .*Z within \[0, 1\] m"):
        curvature_statistics(cloud, stations)


def test_nothing_to_count_is_refused(cloud):
    with pytest.raises(InvalidInput, match="at least one sample"):
        stream_statistics(sr.cloud.design_of(cloud), [])
    with pytest.raises(InvalidInput, match="bins = 0"):
        curvature_statistics(cloud, bins=0)
    with pytest.raises(InvalidInput, match="quantiles"):
        curvature_statistics(cloud, quantiles=[1.5])


def test_stations_may_come_in_any_order(cloud):
    up, down = (curvature_statistics(cloud, z) for z in ([0.4, 0.9], [0.9, 0.4]))
    xr.testing.assert_equal(up, down.isel(station=[1, 0]))
