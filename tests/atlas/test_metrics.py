"""Metrics of an atlas: what they say of the paper's designs, and how they scale."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import (
    METRIC_GROUPS,
    DesignSpace,
    atlas_design,
    best_designs,
    build_atlas,
    over_length,
)
from softreach.atlas.metrics import chosen_metrics
from softreach.support.errors import SoftreachWarning
from tests.atlas.families import SMALL, similar_designs, small_space
from tests.laws import of_length


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


# Laws of scale


def test_metrics_of_similar_designs_scale_as_their_units_say(tmp_path):
    lengths = [1.0, 2.0, 0.5]
    atlas = build_atlas(
        similar_designs(*lengths), tmp_path / "a.zarr", 2_000, alpha_over_length=0.3, accuracy=0.1
    )
    power = {"m": 1, "m2": 2, "m3": 3, "1": 0, "1/m": -1}
    for metric in chosen_metrics(tuple(METRIC_GROUPS)):
        found = atlas[metric.name].values
        for length, value in zip(lengths, found, strict=True):
            np.testing.assert_allclose(
                value, found[0] * length ** power[metric.unit], 1e-9, err_msg=metric.name
            )
        relative = over_length(atlas, metric.name)
        np.testing.assert_allclose(relative, np.broadcast_to(found[:1], found.shape), 1e-9)
        assert relative.dims == atlas[metric.name].dims


def test_metrics_over_length_are_those_of_the_design_at_one_meter(tmp_path):
    """In a grid, beside another parameter, and by the design's own length and not the base's."""
    base = sr.designs.minimal_trunk()
    space = DesignSpace.grid(base, taper=[0.0, 0.02], length=[1.0, 2.0])
    atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    for metric, power in (("volume", 3), ("spacing", 1), ("unreachability", 0)):
        relative = over_length(atlas, metric)
        assert relative.dims == ("taper", "length")
        np.testing.assert_allclose(
            relative.isel(length=1), atlas[metric].isel(length=1) / 2.0**power
        )


def test_the_alpha_radius_follows_each_design(tmp_path):
    space = DesignSpace.grid(sr.designs.minimal_trunk(), length=[0.5, 1.5])
    atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    for length in (0.5, 1.5):
        tip = sr.compute_cloud(of_length(space.base, length), n=2_000).tip
        found = atlas.volume.sel(length=length)
        np.testing.assert_allclose(found, sr.concave_hull(tip, 0.5 * length).volume, rtol=1e-12)


def test_sparse_clouds_are_counted_by_the_length_of_each_design(tmp_path):
    """Beside a long design a radius of 0.05 m would be too small for it alone."""
    for k, lengths in enumerate([(1.0, 2.0), (1.0,)]):
        with pytest.warns(SoftreachWarning, match=rf"of {len(lengths)} designs? and") as told:
            build_atlas(
                similar_designs(*lengths),
                tmp_path / f"{k}.zarr",
                **SMALL | {"alpha_over_length": 0.05},
            )
        assert "alpha = 0.05 L" in str(told[0].message)
