"""D̄ of real and of made-up clouds, and what is said of it."""

import numpy as np
import pytest
import xarray as xr

from softreach.arm import designs
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.redundancy import (
    activation_distance,
    redundancy_summary,
    tip_density,
)
from softreach.schema import cloud_dataset
from softreach.support.errors import InvalidInput
from tests.geometry.test_neighbors import by_all_pairs


def made_up(tip, activation=None) -> xr.Dataset:
    """A cloud with tips of one's own; the design only gives the length of 1 m."""
    tip = np.asarray(tip, float)
    activation = np.zeros((len(tip), 3)) if activation is None else np.asarray(activation, float)
    arm = designs.minimal_trunk()
    return cloud_dataset(arm, activation, tip, seed=0, sampler="uniform", tol=1e-6)


@pytest.fixture(scope="module")
def strewn() -> xr.Dataset:
    """Points strewn evenly over a box of eight cells of 0.1 m, with activations x, y, z / m."""
    tip = np.random.default_rng(3).random((4000, 3)) * 0.2
    return made_up(tip, tip)


@pytest.mark.parametrize("design", [designs.minimal_trunk, designs.redundant_trunk])
@pytest.mark.parametrize("radius", [0.0, 1 / 60, 5.0])
def test_equals_a_loop_over_all_pairs(design, radius):
    cloud = compute_cloud(design(), n=2000)
    found = activation_distance(cloud, radius)
    mean, count = by_all_pairs(cloud.tip.values, cloud.activation.values, radius)
    np.testing.assert_allclose(found, mean, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(found.neighbors, count)


def test_the_result_says_what_it_is(strewn):
    found = activation_distance(strewn, 0.01)
    said = found.name, found.attrs["units"], found.attrs["radius"]
    assert said == ("activation_distance", "1", 0.01)
    np.testing.assert_array_equal(found.sample, np.arange(4000))
    np.testing.assert_array_equal(np.isnan(found), found.neighbors == 0)


def test_what_is_evaluated_does_not_change_what_comes_out(strewn):
    everywhere = activation_distance(strewn, 0.02)
    for queries, size in ((100, 100), (np.array([5, 5, 3999, 0]), 4), (0, 0), ([], 0)):
        some = activation_distance(strewn, 0.02, queries=queries)
        assert some.sizes == {"sample": size}
        np.testing.assert_array_equal(some, everywhere[some.sample.values])


@pytest.mark.parametrize("queries", [7, 50, 3999, 4000])
def test_a_number_of_queries_that_does_not_divide_the_cloud_takes_no_sample_twice(strewn, queries):
    sample = activation_distance(strewn, 0.02, queries=queries).sample.values
    assert len(np.unique(sample)) == queries
    ends = np.arange(queries + 1) * 4000 // queries
    assert ((ends[:-1] <= sample) & (sample < ends[1:])).all()


@pytest.mark.parametrize(
    ("queries", "said"),
    [
        (4001, "queries = 4001.*from 0 to the cloud's 4000 samples"),
        ([4000], "indices from 4,000 to 4,000.*from 0 to 3,999"),
        ([0.5], "whole numbers"),
        (np.ones(4000, bool), "whole numbers"),
    ],
)
def test_other_queries_are_refused(strewn, queries, said):
    with pytest.raises(InvalidInput, match=said):
        activation_distance(strewn, 0.02, queries=queries)


def test_cells_without_a_size_and_tips_that_are_not_finite_are_refused(strewn):
    for cell in (0.0, -1.0, np.nan, np.inf, 1e-9):
        with pytest.raises(InvalidInput, match="cell = "):
            tip_density(strewn, cell=cell)
    tip = np.zeros((5, 3))
    tip[3, 1] = np.nan
    for function in (lambda cloud: activation_distance(cloud, 0.1), tip_density):
        with pytest.raises(InvalidInput, match=r"points\[3\] = .*nan"):
            function(made_up(tip))


def test_minimal_and_redundant_trunk_differ_as_in_the_paper():
    found = {}
    for design in (designs.minimal_trunk, designs.redundant_trunk):
        cloud = compute_cloud(design(), n=1_000_000, tol=1e-4)
        distance = activation_distance(cloud, 1 / 60, queries=10_000)
        found[design] = redundancy_summary(cloud, distance)
    minimal, redundant = found.values()
    assert minimal.median == pytest.approx(0.05, abs=0.01)
    assert redundant.median == pytest.approx(0.5, abs=0.05)
    assert redundant.quantiles[0.95] == pytest.approx(0.95, abs=0.03)  # "on the order of 1.0"
    assert minimal.redundant_volume < 0.02 < 0.3 < redundant.redundant_volume


def test_the_summary_counts_points_and_cells():
    # two cells of 0.1 m: near ones far apart in activation, three alike, and a lonely third cell
    tip = [[0.01] * 3, [0.02] * 3, [0.11] * 3, [0.12] * 3, [0.13] * 3, [0.95] * 3]
    gamma = np.zeros((6, 3))
    gamma[0, 0] = 1.0
    cloud = made_up(tip, gamma)
    found = redundancy_summary(cloud, activation_distance(cloud, 0.05), threshold=0.5, cell=0.1)
    assert found.evaluated == 6
    assert found.isolated == pytest.approx(1 / 6)
    assert found.redundant_points == pytest.approx(2 / 5)
    assert found.redundant_volume == pytest.approx(1 / 2)
    assert found.measured_volume == pytest.approx(2e-3)
    assert found.occupied_volume == pytest.approx(3e-3)
    assert found.median == 0.0
    assert found.quantiles[0.95] == pytest.approx(1.0)


def test_medians_and_shares_of_many_draws_scatter_by_their_errors(strewn):
    drawn, sample = np.random.default_rng(2).exponential(size=(300, 400)), np.arange(400)
    made = (xr.DataArray(values, {"sample": sample}, ("sample",)) for values in drawn)
    summaries = [redundancy_summary(strewn, distance, threshold=1.5) for distance in made]
    for name in ("median", "redundant_points"):
        scatter = np.std([getattr(one, name) for one in summaries])
        stated = np.mean([getattr(one, f"{name}_error") for one in summaries])
        assert stated == pytest.approx(scatter, rel=0.15)


def test_the_summary_prints_shares_with_their_errors_and_keeps_all_in_a_dataset(strewn):
    found = redundancy_summary(strewn, activation_distance(strewn, 0.02), threshold=0.015)
    first, second, third = repr(found).splitlines()
    assert first.startswith("RedundancySummary: median D̄ 0.01")
    assert "± " in second
    assert "4,000 points evaluated" in third
    dataset = found.to_dataset()
    assert float(dataset["median"]) == found.median
    assert float(dataset.quantiles.sel(quantile=0.25)) == found.quantiles[0.25]
    assert dataset.measured_volume.attrs["units"] == "m3"


def test_where_all_points_are_isolated_there_is_nothing_to_summarize():
    cloud = made_up(np.eye(3))
    found = redundancy_summary(cloud, activation_distance(cloud, 0.0))
    assert (found.isolated, found.measured_volume) == (1.0, 0.0)
    assert np.isnan([found.median, found.redundant_points, found.redundant_volume]).all()


def test_distances_of_another_cloud_are_refused(strewn):
    distance = activation_distance(strewn, 0.02)
    small = strewn.isel(sample=slice(10))
    with pytest.raises(InvalidInput, match=r"distance.sample = indices from 0 to 3,999"):
        redundancy_summary(small, distance)
    with pytest.raises(InvalidInput, match="made by activation_distance"):
        redundancy_summary(strewn, distance.drop_vars("sample"))


def test_density_adds_up_to_the_number_of_tips(trunk):
    cloud = compute_cloud(trunk, n=5000)
    grid = tip_density(cloud, cell=0.07)
    assert float(grid.density.sum()) * 0.07**3 == pytest.approx(5000)
    assert grid.density.attrs["units"] == "m-3"
    counts = grid.density * 0.07**3
    np.testing.assert_allclose(grid.density_error * 0.07**3, np.sqrt(counts))


def test_points_strewn_evenly_vary_by_chance_alone(strewn):
    grid = tip_density(strewn, cell=0.1)
    assert grid.density.shape == (2, 2, 2)
    np.testing.assert_allclose(grid.density, 4000 / 0.2**3, rtol=0.2)
    assert grid.chance == pytest.approx(500**-0.5)
    assert grid.coefficient_of_variation == pytest.approx(grid.chance, rel=0.6)


def test_a_dense_half_is_heterogeneous():
    tip = np.random.default_rng(5).random((40_000, 3)) * 0.2
    tip = tip[(tip[:, 0] < 0.1) | (np.arange(len(tip)) % 3 == 0)]
    grid = tip_density(made_up(tip), cell=0.05)
    assert grid.heterogeneity == pytest.approx(0.5, abs=0.03)  # (3 - 1) / (3 + 1)


def test_answers_about_a_cloud_say_which_cloud_it_was(trunk):
    cloud = compute_cloud(trunk, n=300, seed=4)
    distance = activation_distance(cloud, 0.1)
    for answer in (distance, tip_density(cloud)):
        assert cloud.attrs.items() <= answer.attrs.items()
