"""An atlas that is read: its clouds, designs, best designs, and its figures."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

import softreach as sr
from softreach.atlas import DesignSpace, atlas_cloud, best_designs, build_atlas, open_atlas
from softreach.errors import InvalidInput
from softreach.plot.atlas import atlas_box, plot_metric_map
from softreach.plot.projection import OBLIQUE, view_axes
from softreach.plot.sheet import panel_extent
from tests.atlas.families import SMALL, small_space


def test_stored_clouds_are_those_of_the_cloud_alone_to_half_a_step(paper):
    at = {"revolution": 0.0, "taper": np.radians(3)}
    stored = atlas_cloud(paper, **at)
    alone = sr.compute_cloud(sr.design_of(stored), n=20_000, seed=1)
    assert stored.activation.equals(alone.activation)
    assert np.abs(stored.tip.values - alone.tip.values).max() <= 0.5e-5 * (1 + 1e-9)
    assert stored.attrs == alone.attrs


def test_clouds_that_were_not_kept_are_computed_again(tmp_path):
    atlas = build_atlas(small_space(), tmp_path / "a.zarr", keep_clouds=False, **SMALL)
    assert "tip" not in atlas
    again = atlas_cloud(atlas, revolution=0.5, taper=0.0)
    alone = sr.compute_cloud(sr.design_of(again), n=2_000)
    assert again.tip.equals(alone.tip)


def test_any_reader_of_zarr_and_cf_understands_the_store(tmp_path):
    build_atlas(small_space(length=[1.0, 1.5]), tmp_path / "a.zarr", **SMALL)
    raw = xr.open_zarr(tmp_path / "a.zarr", consolidated=False, zarr_format=3, chunks=None)
    tips = raw.tip.isel(revolution=1, taper=1, length=1).T.values
    alone = sr.compute_cloud(sr.designs.minimal_trunk(1.5).replace(length=1.5), n=2_000)
    np.testing.assert_allclose(tips, alone.tip, atol=0.6e-5)
    assert raw.taper.attrs["units"] == "rad"
    assert raw.status.attrs["flag_meanings"].split()[1] == "done"


def test_designs_with_more_bundles_share_the_activations_of_the_others(tmp_path):
    space = DesignSpace.listed(sr.designs.minimal_trunk(), bundles_left=[1, 2])
    atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    few, more = atlas_cloud(atlas, design=0), atlas_cloud(atlas, design=1)
    assert (few.activation.shape[1], more.activation.shape[1]) == (3, 4)
    np.testing.assert_array_equal(few.activation, more.activation[:, :3])


def test_best_designs_are_the_best_that_meet_the_constraints(paper):
    found = best_designs(paper, "volume", where={"taper": (None, 0.01)}, count=3)
    truth = np.sort(paper.volume.sel(taper=0.0).values)[::-1]
    np.testing.assert_array_equal(found.volume, truth[:3])
    least = best_designs(paper, "unreachability", smallest=True)
    np.testing.assert_allclose(least.unreachability, [paper.unreachability.min()])
    assert best_designs(paper, "volume", where={"volume": (9.0, None)}).sizes["rank"] == 0
    with pytest.raises(InvalidInput, match="metric = volumes: must be one of"):
        best_designs(paper, "volumes")


def test_what_is_not_there_is_not_opened(tmp_path):
    with pytest.raises(InvalidInput, match="an atlas written by build_atlas"):
        open_atlas(tmp_path / "nothing.zarr")
    assert not (tmp_path / "nothing.zarr").exists()


def test_no_tip_lies_outside_its_panel_of_the_sheet(paper):
    pytest.importorskip("matplotlib")
    extent = panel_extent(atlas_box(paper), OBLIQUE)
    seen = np.moveaxis(paper.tip.values, 2, -1).reshape(-1, 3) @ view_axes(OBLIQUE)[:2].T
    assert extent.left < seen[:, 0].min() < seen[:, 0].max() < extent.right
    assert extent.bottom < seen[:, 1].min() < seen[:, 1].max() < extent.top


def test_maps_need_two_parameters(paper):
    pytest.importorskip("matplotlib")
    with pytest.raises(InvalidInput, match="a grid of two parameters"):
        plot_metric_map(paper.isel(taper=0), "volume")
    with pytest.raises(InvalidInput, match="metric = volumes"):
        plot_metric_map(paper, "volumes")
