"""Laws of curvature statistics: what streaming must not change, and what taper does."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given

import softreach as sr
from softreach.arm.tables import tables
from softreach.cloud.curvature import (
    QUANTITIES,
    curvature_statistics,
    distal_stations,
    strain_ranges,
    stream_statistics,
)
from softreach.rod.rods import as_tip_map, refined
from softreach.support.errors import InvalidInput
from tests.kinds import any_arms, fibers_and_a_tendon
from tests.laws import arms, in_box


@pytest.fixture(scope="module")
def cloud():
    return sr.compute_cloud(sr.designs.minimal_trunk(), n=10_000, seed=3)


@pytest.fixture(scope="module")
def shapes(cloud):
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


def test_every_sample_is_counted_once_and_quantiles_are_good_to_a_bin(cloud, shapes):
    shares = (0.05, 0.5, 0.95)
    found = curvature_statistics(cloud, quantiles=shares, bins=256)
    u = shapes.curvature.values
    truth = np.quantile(np.hypot(u[..., 0], u[..., 1]), shares, axis=0).T
    width = np.diff(found.bending_edge.values[:, :2], axis=1)
    assert (np.abs(found.bending_quantile.values - truth) <= width).all()
    for name in ("bending", "torsion", "extension"):
        assert (found[f"{name}_count"].sum("bin") == cloud.sizes["sample"]).all()


def test_blocks_do_not_matter(cloud):
    arm, gamma = sr.cloud.design_of(cloud), cloud.activation.values
    whole, cut = stream_statistics(arm, [gamma]), stream_statistics(arm, np.array_split(gamma, 7))
    assert whole.bending_count.equals(cut.bending_count)
    np.testing.assert_allclose(whole.bending_mean, cut.bending_mean, rtol=1e-12)


def test_a_single_bundle_that_cannot_move_has_one_value():
    arm = sr.designs.minimal_trunk().with_bounds((-0.5, -0.5))
    found = stream_statistics(arm, [np.full((10, 3), -0.5)])
    np.testing.assert_allclose(found.extension_std, 0.0, atol=1e-12)
    assert (found.extension_quantile.std("quantile") < 1e-12).all()


def test_taper_widens_and_raises_the_curvature_toward_the_tip():
    arms = (sr.designs.minimal_trunk(taper=np.radians(phi)) for phi in (0, 3))
    clouds = (sr.compute_cloud(arm, n=20_000) for arm in arms)
    found = (curvature_statistics(c, quantiles=(0.05, 0.5, 0.95)).bending_quantile for c in clouds)
    plain, tapered = (quantiles.values.T for quantiles in found)
    assert (np.diff(tapered[1]) > 0).all()  # the median grows from station to station
    assert np.ptp(plain[1]) < 0.2 * np.ptp(tapered[1])
    assert (tapered[2] - tapered[0] > 1.4 * (plain[2] - plain[0])).all()
    assert (np.diff(tapered[2] - tapered[0]) > 0).all()


def test_nothing_to_count_is_refused(cloud):
    with pytest.raises(InvalidInput, match="at least one sample"):
        stream_statistics(sr.cloud.design_of(cloud), [])
    for wrong, said in (({"bins": 0}, "bins = 0"), ({"quantiles": [1.5]}, "quantiles")):
        with pytest.raises(InvalidInput, match=said):
            curvature_statistics(cloud, **wrong)


def test_stations_may_come_in_any_order(cloud):
    up, down = (curvature_statistics(cloud, z) for z in ([0.4, 0.9], [0.9, 0.4]))
    xr.testing.assert_equal(up, down.isel(station=[1, 0]))


# Strains along rods: linear in the activations, within the range that is stated


def stations(arm):
    return arm.length * np.array([0.0, 0.3, 0.9, 1.0])


def test_a_force_leaves_curvature_per_length_at_rest_and_fibers_take_it_along():
    """dᵢ' = η Uγ × dᵢ = ζ u × dᵢ with η of the fibers alone."""
    arm = fibers_and_a_tendon()
    z, gamma = stations(arm), in_box(arm, 20)
    table, (curvature, extension) = tables(arm, z), as_tip_map(arm).strains(gamma, z)
    np.testing.assert_allclose(extension, 1 + gamma @ table.extension.T, rtol=1e-12)
    eta = 1 + gamma[:, :2] @ table.extension[:, :2].T
    rate = eta[..., None] * np.einsum("scb,nb->nsc", table.curvature, gamma)
    np.testing.assert_allclose(curvature * extension[..., None], rate, rtol=1e-12, atol=1e-12)


@given(arm=arms())
def test_corners_of_the_box_reach_the_ends_of_its_range(arm):
    z, rod = stations(arm), as_tip_map(arm)
    corners = quantities(rod.strains(rod.box.corners(), z))
    for name, ends in zip(QUANTITIES, strain_ranges(rod, z), strict=True):
        slack, extremes = 1e-12 * max(1.0, np.abs(ends).max()), corners[name]
        np.testing.assert_allclose(extremes.max(axis=0), ends[:, 1], rtol=2e-5, atol=slack)
        if name != "bending":  # which is convex: its smallest value lies inside the box
            np.testing.assert_allclose(extremes.min(axis=0), ends[:, 0], rtol=1e-9, atol=slack)


@given(arm=any_arms())
def test_the_range_of_the_box_holds_all_strains_of_fibers_and_forces(arm):
    z, rod = stations(arm), as_tip_map(arm, 1e-4)
    found = quantities(rod.strains(np.concatenate([in_box(arm, 50), rod.box.corners()]), z))
    for name, ends in zip(QUANTITIES, strain_ranges(rod, z), strict=True):
        slack, values = 1e-12 * max(1.0, np.abs(ends).max()), found[name]
        assert (values >= ends[:, 0] - slack).all()
        assert (values <= ends[:, 1] + slack).all()


def quantities(strains):
    u = strains.curvature
    bending = np.hypot(u[..., 0], u[..., 1])
    return {"bending": bending, "torsion": u[..., 2], "extension": strains.extension}


def test_a_refined_map_is_as_near_as_asked_and_a_coarser_one_is_not_made(trunk):
    rod = as_tip_map(trunk, 1e-4)
    assert refined(rod, 1e-3) is rod
    fine = refined(rod, 1e-9)
    assert (fine.arm, fine.tol) == (trunk, 1e-9)
    gamma = in_box(trunk, 100)
    assert np.linalg.norm(fine.tips(gamma) - rod.tips(gamma), axis=1).max() < 1e-4
    assert refined(fine, 1e-6).tol == pytest.approx(1e-9)
