"""Metrics of an atlas: what they are worth, how they scale, and those of one's own."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import atlas_design, best_designs, build_atlas
from softreach.errors import SoftreachWarning
from tests.atlas.families import SMALL, small_space


def test_volume_grows_with_revolution_for_every_taper(paper):
    assert (paper.volume.diff("revolution") > 0).all()
    assert (paper.exact_volume.diff("revolution") > 0).all()


def test_largest_volume_is_at_full_revolution_and_two_degrees(paper):
    for name in ("volume", "exact_volume"):
        best = best_designs(paper, name)
        np.testing.assert_allclose(np.degrees(best.revolution), 108)
        np.testing.assert_allclose(np.degrees(best.taper), 2)


def test_unreachability_falls_with_revolution_and_taper(paper):
    for dim in ("revolution", "taper"):
        assert (paper.exact_unreachability.diff(dim) < 0).all()
        assert (paper.unreachability.diff(dim) < 0.02).all()  # sampled, with a coarse radius
    np.testing.assert_allclose(
        paper.exact_unreachability.isel(revolution=0, taper=0), 0.69, atol=0.01
    )
    np.testing.assert_allclose(
        paper.exact_unreachability.isel(revolution=3, taper=3), 0.29, atol=0.01
    )


def test_metrics_agree_with_those_of_the_cloud_alone(paper):
    at = {"revolution": np.radians(72), "taper": np.radians(1)}
    alone = sr.compute_cloud(atlas_design(paper, **at), n=20_000, seed=1)
    row = paper.sel(**at, method="nearest")
    np.testing.assert_allclose(row.convex_volume, sr.convex_hull(alone.tip).volume, rtol=1e-9)
    np.testing.assert_allclose(row.volume, sr.concave_hull(alone.tip, 0.1).volume, rtol=1e-12)
    np.testing.assert_allclose(row.reach_height, alone.tip[:, 2].max())
    np.testing.assert_allclose(
        row.reach_radius, np.hypot(alone.tip[:, 0], alone.tip[:, 1]).max(), rtol=1e-12
    )


def test_sparse_clouds_are_warned_of(tmp_path):
    with pytest.warns(SoftreachWarning, match="below three mean spacings of the points of 4"):
        build_atlas(small_space(), tmp_path / "a.zarr", **SMALL | {"alpha_over_length": 0.05})
