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
from softreach.rod.loaded import phase as load_phase
from softreach.rod.tip_map import TipStatus
from softreach.support.errors import SoftreachWarning

PAYLOADS = [0.005, 0.1, 0.5]  # stable, in part, nowhere [kg]
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
    store = tmp_path_factory.mktemp("atlas") / "atlas.zarr"
    metrics = ["extent", "convex", "concave", "curvature", "stability", COUNT]

    def build():
        return build_atlas(space, store, N, alpha_over_length=0.3, metrics=metrics)

    # The heaviest is beyond what is followed; here it is one that is followed and lost.
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(load_phase, "_MOST_GROWTH", np.inf)
        with pytest.warns(SoftreachWarning, match="1 design without metrics, first number 2: none"):
            return build(), store, build


def test_lost_samples_count_for_nothing_but_their_share(built):
    atlas, _, _ = built
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


def test_a_design_that_is_nowhere_stable_is_told_and_not_tried_again(built):
    atlas, store, build = built
    status = atlas_status(store)
    assert (status.done, status.unstable, status.failed, status.todo) == (2, 1, 0, 0)
    assert status.messages == {2: f"none of {N} activations tried has a stable equilibrium"}
    at = atlas.isel({"loads.payload": 2})
    assert at.lost_share.item() == 1.0
    assert np.isnan([at.volume.item(), at.z_max.item(), at.stable_samples.item()]).all()
    assert best_designs(atlas, "lost_share").number.item() == 2
    assert best_designs(atlas, "volume", smallest=True).number.item() == 1
    before = sorted((path, path.stat().st_mtime_ns) for path in store.rglob("*"))
    with pytest.warns(SoftreachWarning, match="without metrics"):
        build()
    assert sorted((path, path.stat().st_mtime_ns) for path in store.rglob("*")) == before


def test_clouds_of_loaded_designs_have_their_status(built):
    atlas, _, _ = built
    for payload in PAYLOADS:
        cloud = atlas_cloud(atlas, **{"loads.payload": payload})
        lost = (cloud.status.values != TipStatus.STABLE).mean()
        assert lost == atlas.lost_share.sel({"loads.payload": payload}).item()
        gone = cloud.status.values == TipStatus.NO_EQUILIBRIUM
        assert (np.isnan(cloud.tip.values).all(axis=1) == gone).all()
