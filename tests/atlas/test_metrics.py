"""Metrics of an atlas: what they say of the paper's designs, and how they scale."""

from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Loads, designs
from softreach.atlas import (
    METRIC_GROUPS,
    DesignSpace,
    Metric,
    MetricFailed,
    Need,
    atlas_cloud,
    atlas_design,
    atlas_status,
    best_designs,
    build_atlas,
    over_length,
)
from softreach.atlas.metrics import chosen_metrics
from softreach.atlas.store import AtlasStore
from softreach.cloud.clouds import compute_cloud
from softreach.cloud.volume import concave_hull
from softreach.rod.tip_map import TipMap, TipStatus, has_tip
from softreach.support.errors import InvalidInput, SoftreachWarning
from tests.atlas.families import SMALL, assert_same, command, similar_designs, small_space
from tests.bodies import rubber
from tests.cable import Cable


def test_volume_grows_with_revolution_and_is_largest_at_full_revolution_and_two_degrees(paper):
    for name in ("volume", "exact_volume"):
        assert (paper[name].diff("revolution") > 0).all()
        best = best_designs(paper, name)
        np.testing.assert_allclose(np.degrees(best.revolution), 108)
        np.testing.assert_allclose(np.degrees(best.taper), 2)


def test_unreachability_falls_with_revolution_and_taper(paper):
    for dim in ("revolution", "taper"):
        assert (paper.exact_unreachability.diff(dim) < 0).all()
        assert (paper.unreachability.diff(dim) < 0.02).all()  # sampled, with a coarse radius
    for place, expected in ((0, 0.69), (3, 0.29)):
        corner = paper.exact_unreachability.isel(revolution=place, taper=place)
        np.testing.assert_allclose(corner, expected, atol=0.01)


def test_metrics_agree_with_those_of_the_cloud_alone(paper):
    at = {"revolution": np.radians(72), "taper": np.radians(1)}
    alone = sr.compute_cloud(atlas_design(paper, **at), n=20_000, seed=1)
    row = paper.sel(**at, method="nearest")
    np.testing.assert_allclose(row.convex_volume, sr.convex_hull(alone.tip).volume, rtol=1e-9)
    np.testing.assert_allclose(row.volume, sr.concave_hull(alone.tip, 0.1).volume, rtol=1e-12)
    np.testing.assert_allclose(row.reach_height, alone.tip[:, 2].max())
    radius = np.hypot(alone.tip[:, 0], alone.tip[:, 1]).max()
    np.testing.assert_allclose(row.reach_radius, radius, rtol=1e-12)


# Laws of scale


def test_metrics_of_similar_designs_scale_as_their_units_say(tmp_path):
    lengths = [1.0, 2.0, 0.5]
    options = {"alpha_over_length": 0.3, "accuracy": 0.1}
    atlas = build_atlas(similar_designs(*lengths), tmp_path / "a.zarr", 2_000, **options)
    power = {"m": 1, "m2": 2, "m3": 3, "1": 0, "1/m": -1}
    for metric in chosen_metrics(tuple(METRIC_GROUPS)):
        found = atlas[metric.name].values
        for length, value in zip(lengths, found, strict=True):
            expected = found[0] * length ** power[metric.unit]
            np.testing.assert_allclose(value, expected, 1e-9, err_msg=metric.name)
        relative = over_length(atlas, metric.name)
        np.testing.assert_allclose(relative, np.broadcast_to(found[:1], found.shape), 1e-9)
        assert relative.dims == atlas[metric.name].dims


def test_sparse_clouds_are_counted_by_the_length_of_each_design(tmp_path):
    """Beside a long design a radius of 0.05 m would be too small for it alone."""
    for k, lengths in enumerate([(1.0, 2.0), (1.0,)]):
        options = SMALL | {"alpha_over_length": 0.05}
        with pytest.warns(SoftreachWarning, match=rf"of {len(lengths)} designs? and") as told:
            build_atlas(similar_designs(*lengths), tmp_path / f"{k}.zarr", **options)
        assert "alpha = 0.05 L" in str(told[0].message)


# A metric of one's own is one object: computed, stored, refused, sent to workers


def mean_height(tips):
    return tips[:, 2].mean()


ABOUT = {"name": "mean_height", "unit": "m", "meaning": "mean height of the tips"}
MEAN_HEIGHT = Metric(**ABOUT, needs=(Need.TIPS,), compute=mean_height)


def built_with(metrics, tmp_path, **options):
    """The small atlas with these metrics."""
    return build_atlas(small_space(), tmp_path / "a.zarr", **SMALL | {"metrics": metrics} | options)


def test_a_metric_of_ones_own_is_one_object(tmp_path):
    atlas = built_with([MEAN_HEIGHT], tmp_path)
    assert atlas.mean_height.attrs == {"units": "m", "long_name": "mean height of the tips"}
    for number in range(4):
        alone = sr.compute_cloud(small_space().design(number), n=2_000)
        assert atlas.mean_height.values.flat[number] == alone.tip.values[:, 2].mean()
    best = best_designs(tmp_path / "a.zarr", "mean_height", count=4)
    assert best.mean_height.values.tolist() == sorted(atlas.mean_height.values.flat)[::-1]


def test_a_profile_of_ones_own_lies_over_stations_and_quantiles(tmp_path):
    doubled = Metric(
        name="twice_the_torsion",
        unit="1/m",
        meaning="2 u3",
        needs=(Need.STRAIN_STATISTICS,),
        compute=lambda statistics: 2 * statistics["torsion_quantile"].values,
        over=("station", "quantile"),
    )
    atlas = built_with(("curvature", doubled), tmp_path)
    assert atlas.twice_the_torsion.dims == ("revolution", "taper", "station", "quantile")
    np.testing.assert_array_equal(atlas.twice_the_torsion, 2 * atlas.torsion_quantile)


def test_every_need_can_be_met(tmp_path):
    seen = []
    asks = Metric(
        name="asks",
        unit="1",
        meaning="asks for everything",
        needs=tuple(Need),
        compute=lambda *found: seen.append(dict(zip(Need, found, strict=True))) or 0.0,
    )
    options = SMALL | {"metrics": [asks], "accuracy": 0.1}
    build_atlas(similar_designs(2.0), tmp_path / "a.zarr", **options)
    (found,) = seen
    arm = similar_designs(2.0).design(0)
    assert found[Need.ARM] == arm
    assert (found[Need.LENGTH], found[Need.ALPHA]) == (2.0, 1.0)
    tips = sr.tip_positions(arm, found[Need.ACTIVATIONS], tol=1e-6)
    np.testing.assert_array_equal(found[Need.TIPS], tips)
    hull = sr.convex_hull(found[Need.TIPS])
    np.testing.assert_allclose(found[Need.CONVEX_VOLUME], hull.volume, rtol=1e-9)
    assert found[Need.CONVEX_VOLUME] == found[Need.ALPHA_COMPLEX].volumes.sum()
    assert found[Need.REACHABLE_SET].volume < found[Need.REACHABLE_SET].convex_volume
    assert found[Need.STRAIN_STATISTICS].sizes["station"] == 6


def test_what_metrics_share_is_computed_once_for_each_design(tmp_path, monkeypatch):
    calls = Counter()

    def counting(owner, name):
        real = getattr(owner, name)

        def counted(*given, **options):
            calls[name] += 1
            return real(*given, **options)

        monkeypatch.setattr(owner, name, counted)

    shared = ("delaunay", "stream_statistics", "reachable_set")
    for name in shared:
        counting(import_module("softreach.atlas.metrics"), name)
    counting(TipMap, "tips_and_status")
    built_with(tuple(METRIC_GROUPS), tmp_path, accuracy=0.1)
    assert calls == dict.fromkeys([*shared, "tips_and_status"], 4)


@pytest.mark.parametrize(
    ("compute", "message"),
    [
        (lambda tips: np.nan, "mean_height = nan: must be finite"),
        (lambda tips: tips[0], r"mean_height: of shape \(3,\), must be of shape \(\)"),
        (lambda tips: "high", "mean_height: ValueError: could not convert"),
        (lambda tips: tips.hight, "mean_height: AttributeError: .*hight"),
    ],
)
def test_a_metric_without_a_number_fails_its_designs_and_says_so(tmp_path, compute, message):
    faulty = replace(MEAN_HEIGHT, compute=compute)
    with pytest.warns(SoftreachWarning, match=f"4 designs failed, .*MetricFailed: {message}"):
        built_with([faulty], tmp_path)
    assert atlas_status(tmp_path / "a.zarr").failed == 4


def test_nan_is_an_answer_where_the_metric_says_when(tmp_path):
    sometimes = replace(MEAN_HEIGHT, compute=lambda tips: np.nan, nan_if="there is no sky")
    atlas = built_with([sometimes], tmp_path)
    assert np.isnan(atlas.mean_height).all()
    assert atlas_status(atlas).done == 4


@pytest.mark.parametrize(
    ("metrics", "message"),
    [
        (("extend",), "metrics = 'extend': must be some of extent, convex"),
        ((), "metrics = none: must be some of extent"),
        ((MEAN_HEIGHT, replace(MEAN_HEIGHT, unit="1")), "name of a metric = mean_height"),
        ((replace(MEAN_HEIGHT, name="volume"),), "name of a metric = volume: must be the name of"),
        ((replace(MEAN_HEIGHT, name="status"),), "= status: must be a name that the atlas does n"),
        ((replace(MEAN_HEIGHT, name="taper"),), "= taper: must be a name that the atlas does not"),
    ],
)
def test_metrics_that_cannot_be_told_apart_are_refused(tmp_path, metrics, message):
    with pytest.raises(InvalidInput, match=message) as caught:
        built_with(metrics, tmp_path)
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "a.zarr").exists()


def test_a_call_with_other_metrics_does_not_resume(tmp_path):
    first = built_with(("extent", MEAN_HEIGHT), tmp_path).load()
    assert_same(built_with((MEAN_HEIGHT, "extent"), tmp_path).load(), first)
    for metrics, message in [
        (("extent",), "metrics: mean_height there and not here"),
        (("extent", "convex", MEAN_HEIGHT), "metrics: convex_volume here and not there"),
        (("extent", replace(MEAN_HEIGHT, compute=np.mean)), "mean_height, compute: 'tests.* there"),
    ]:
        with pytest.raises(InvalidInput, match=message):
            built_with(metrics, tmp_path)


def test_a_store_is_read_without_the_functions_of_its_metrics(tmp_path):
    store = tmp_path / "a.zarr"
    asked = SMALL | {"metrics": ("convex", MEAN_HEIGHT)}
    AtlasStore.begin(store, command(small_space(), **asked))
    convex, height = AtlasStore.open(store).command.metrics
    assert convex is METRIC_GROUPS["convex"][0]
    assert height.to_dict() == MEAN_HEIGHT.to_dict()
    with pytest.raises(MetricFailed, match=r"test_metrics:mean_height .*pass the metric"):
        height.value({Need.TIPS: np.zeros((1, 3))}, {})


def test_lambdas_are_refused_in_one_line_where_processes_compute_them(process, tmp_path):
    typed = replace(MEAN_HEIGHT, compute=lambda tips: 0.0)
    with pytest.raises(InvalidInput, match=r"compute of metric .*lambda"):
        built_with([typed], tmp_path, executor=process)
    with ThreadPoolExecutor(1) as threads:
        atlas = built_with([typed], tmp_path, executor=threads)
    assert (atlas.mean_height == 0).all()


def test_processes_know_the_modules_of_actuators_and_metrics(process, tmp_path):
    trunk = sr.designs.minimal_trunk()
    cable = Cable(place=(0.03, 0.0), name="cable", activation_bounds=(0.0, 1e-4))
    base = trunk.replace(actuators=(*trunk.actuators[:2], cable))
    space = sr.DesignSpace.grid(base, **{"cable.place[0]": [0.01, 0.03]})
    options = SMALL | {"metrics": ("convex", MEAN_HEIGHT)}
    alone = build_atlas(space, tmp_path / "a.zarr", **options).load()
    found = build_atlas(space, tmp_path / "b.zarr", executor=process, **options).load()
    assert_same(found, alone)


# Atlases over loads: what is stable counts, and what is not is told


PAYLOADS = [0.005, 0.1]  # everywhere stable, and in part [kg]
SQUEEZING = [100.0, 4000.0]  # stable, and more than the stubby arm can carry [kg]
N = 60


def count(tips, activations):
    assert np.isfinite(tips).all()
    assert len(tips) == len(activations)
    return len(tips)


COUNTED = {"name": "stable_samples", "unit": "1", "meaning": "number of stable samples"}
COUNT = Metric(**COUNTED, needs=(Need.TIPS, Need.ACTIVATIONS), compute=count)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    arm = designs.lce_arm().replace(loads=Loads(gravity=(0.0, 0.0, -9.81)))
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
    return build_atlas(space, store, N, alpha_over_length=0.6, metrics=metrics)


def test_lost_samples_count_for_nothing_but_their_share(built):
    arm = designs.lce_arm().replace(loads=Loads(gravity=(0.0, 0.0, -9.81), payload=PAYLOADS[1]))
    cloud = compute_cloud(arm, N)
    stable = cloud.status.values == TipStatus.STABLE
    at = built.isel({"loads.payload": 1})
    assert 0 < at.lost_share.item() == pytest.approx(1.0 - stable.mean())
    assert at.stable_samples.item() == stable.sum()
    tips = cloud.tip.values[stable]
    assert at.z_min.item() == pytest.approx(tips[:, 2].min())
    assert at.volume.item() == pytest.approx(concave_hull(tips, 0.6 * arm.length).volume)
    assert built.lost_share.values[0] == 0.0
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
    for atlas, payload in zip([built] * 2 + [squeezed[0]] * 2, PAYLOADS + SQUEEZING, strict=True):
        cloud = atlas_cloud(atlas, **{"loads.payload": payload})
        lost = (cloud.status.values != TipStatus.STABLE).mean()
        assert lost == atlas.lost_share.sel({"loads.payload": payload}).item()
        assert (np.isnan(cloud.tip.values).all(axis=1) != has_tip(cloud.status.values)).all()
