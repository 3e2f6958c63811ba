"""Files of released versions, in `tests/data/kept`, open as docs/compatibility.md says."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import softreach as sr
from softreach.atlas import atlas_status, open_atlas

KEPT = Path(__file__).parent / "data" / "kept"


@pytest.fixture
def arm():
    return sr.Manipulator.load(KEPT / "trunk-0.1.0.toml")


def test_a_kept_design_is_the_one_that_was_written(arm):
    expected = sr.designs.minimal_trunk(revolution=np.radians(108), taper=np.radians(2))
    np.testing.assert_allclose(
        sr.tip_positions(arm, [-1.0, -0.5, 0.0]),
        sr.tip_positions(expected, [-1.0, -0.5, 0.0]),
        rtol=0,
        atol=1e-12,
    )


def test_a_kept_cloud_has_the_tips_of_its_samples(arm):
    cloud = sr.open_cloud(KEPT / "cloud-0.1.0.zarr")
    assert cloud.attrs["softreach_version"] == "0.1.0"
    tips = sr.tip_positions(arm, cloud.activation.values)
    np.testing.assert_allclose(cloud.tip, tips, rtol=0, atol=1e-6)
    by_xarray = xr.open_zarr(KEPT / "cloud-0.1.0.zarr", consolidated=False)
    np.testing.assert_array_equal(by_xarray.tip, cloud.tip)


def test_a_kept_atlas_has_its_metrics(arm):
    store = KEPT / "atlas-0.1.0.zarr"
    assert atlas_status(store).done == 2
    reached = sr.reachable_set(arm)
    volume = open_atlas(store).exact_volume.sel(taper=np.radians(2), method="nearest")
    assert abs(float(volume) - reached.volume) < 2 * reached.volume_error
