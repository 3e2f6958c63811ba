"""Atlases over loads: what is stable counts, and what is not is told."""

from __future__ import annotations

import numpy as np
import pytest

from softreach.arm import Loads, designs
from softreach.atlas import (
    DesignSpace,
    Metric,
    Need,
    atlas_cloud,
    atlas_status,
    best_designs,
    build_atlas,
)
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.volume import concave_hull
from softreach.rod.tip_map import TipStatus
from softreach.support.errors import SoftreachWarning
from tests.bodies import rubber

PAYLOADS = [0.005, 0.1]  # everywhere stable, and in part [kg]
SQUEEZING = [100.0, 4000.0]  # stable, and more than the stubby arm can carry [kg]
N = 300


def count(tips, activations):
    assert np.isfinite(tips).all()
    assert len(tips) == len(activations)
    return len(tips)


COUNT = Metric(
    name="stable_samples",
    unit="1",
    meaning="number of stable samples",
    needs=(Need.TIPS, Need.ACTIVATIONS),
    compute=count,
)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    arm = designs.lce_arm().replace(loads=Loads(gravity=(0.0, 0.0, 9.81)))
    space = DesignSpace.grid(arm, **{"loads.payload": PAYLOADS})
    return build(space, tmp_path_factory.mktemp("atlas") / "atlas.zarr")


@pytest.fixture(scope="module")
def squeezed(tmp_path_factory):
    """An atlas whose second design is squeezed to nothing, its space and its store."""
    arm = designs.minimal_trunk(taper=0.0, length=0.2)
    arm = arm.replace(profile=arm.profile.replace(outer_radius=0.1))
    space = DesignSpace.grid(rubber(arm, Loads()), **{"loads.payload": SQUEEZING})
    store = tmp_path_factory.mktemp("atlas") / "squeezed.zarr"
    with pytest.warns(SoftreachWarning, match="1 design without metrics, first number 1: none"):
        return build(space, store), space, store


def build(space, store):
    metrics = ["extent", "convex", "concave", "curvature", "stability", COUNT]
    return build_atlas(space, store, N, alpha_over_length=0.3, metrics=metrics)


def test_lost_samples_count_for_nothing_but_their_share(built):
    atlas = built
    arm = designs.lce_arm().replace(loads=Loads(gravity=(0.0, 0.0, 9.81), payload=PAYLOADS[1]))
    cloud = compute_cloud(arm, N)
    stable = cloud.status.values == TipStatus.STABLE
    at = atlas.isel({"loads.payload": 1})
    assert 0 < at.lost_share.item() == pytest.approx(1.0 - stable.mean())
    assert at.stable_samples.item() == stable.sum()
    tips = cloud.tip.values[stable]
    assert at.z_min.item() == pytest.approx(tips[:, 2].min())
    hull = concave_hull(tips, 0.3 * arm.length)
    assert at.volume.item() == pytest.approx(hull.volume)
    assert atlas.lost_share.values[0] == 0.0
    assert np.isfinite(at.bending_quantile.values).all()


def test_a_design_that_is_nowhere_stable_is_told_and_not_tried_again(squeezed):
    atlas, space, store = squeezed
    status = atlas_status(store)
    assert (status.done, status.unstable, status.failed, status.todo) == (1, 1, 0, 0)
    assert status.messages == {1: f"none of {N} activations tried has a stable equilibrium"}
    at = atlas.isel({"loads.payload": 1})
    assert at.lost_share.item() == 1.0
    assert np.isnan([at.volume.item(), at.z_max.item(), at.stable_samples.item()]).all()
    assert best_designs(atlas, "lost_share").number.item() == 1
    assert best_designs(atlas, "volume", smallest=True).number.item() == 0
    before = sorted((path, path.stat().st_mtime_ns) for path in store.rglob("*"))
    with pytest.warns(SoftreachWarning, match="without metrics"):
        build(space, store)
    assert sorted((path, path.stat().st_mtime_ns) for path in store.rglob("*")) == before


def test_clouds_of_loaded_designs_have_their_status(built, squeezed):
    cases = [(built, payload) for payload in PAYLOADS]
    for atlas, payload in cases + [(squeezed[0], payload) for payload in SQUEEZING]:
        cloud = atlas_cloud(atlas, **{"loads.payload": payload})
        lost = (cloud.status.values != TipStatus.STABLE).mean()
        assert lost == atlas.lost_share.sel({"loads.payload": payload}).item()
        gone = cloud.status.values == TipStatus.NO_EQUILIBRIUM
        assert (np.isnan(cloud.tip.values).all(axis=1) == gone).all()
