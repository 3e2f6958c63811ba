"""A metric of one's own is one object: computed, stored, refused, sent to workers."""

from __future__ import annotations

import pickle
from collections import Counter
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from importlib import import_module
from multiprocessing import get_context

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import (
    METRIC_GROUPS,
    Metric,
    MetricFailed,
    Need,
    atlas_status,
    best_designs,
    build_atlas,
)
from softreach.atlas.metrics import chosen_metrics
from softreach.atlas.store import AtlasStore
from softreach.rod.tip_map import TipMap
from softreach.support.errors import InvalidInput, SoftreachWarning
from tests.atlas.families import SMALL, assert_same, command, similar_designs, small_space
from tests.cable import Cable


def mean_height(tips):
    return tips[:, 2].mean()


MEAN_HEIGHT = Metric(
    name="mean_height",
    unit="m",
    meaning="mean height of the tips",
    needs=(Need.TIPS,),
    compute=mean_height,
)


def test_a_metric_of_ones_own_is_one_object(tmp_path):
    atlas = build_atlas(small_space(), tmp_path / "a.zarr", **SMALL | {"metrics": [MEAN_HEIGHT]})
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
    metrics = ("curvature", doubled)
    atlas = build_atlas(small_space(), tmp_path / "a.zarr", **SMALL | {"metrics": metrics})
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
    np.testing.assert_array_equal(
        found[Need.TIPS], sr.tip_positions(arm, found[Need.ACTIVATIONS], tol=1e-6)
    )
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

    shared = ("delaunay", "stream_statistics")
    for name in shared:
        counting(import_module("softreach.atlas.intermediates"), name)
    counting(import_module("softreach.workspace"), "reachable_set")
    counting(TipMap, "tips_and_status")
    options = SMALL | {"metrics": tuple(METRIC_GROUPS), "accuracy": 0.1}
    build_atlas(small_space(), tmp_path / "a.zarr", **options)
    assert calls == dict.fromkeys([*shared, "reachable_set", "tips_and_status"], 4)


# Metrics that cannot be had


@pytest.mark.parametrize(
    ("compute", "message"),
    [
        (lambda tips: np.nan, "mean_height = nan: must be finite"),
        (lambda tips: np.inf, "mean_height = inf: must be finite"),
        (lambda tips: tips[0], r"mean_height: of shape \(3,\), must be of shape \(\)"),
        (lambda tips: "high", "mean_height: ValueError: could not convert"),
        (lambda tips: tips.hight, "mean_height: AttributeError: .*hight"),
        (lambda: 0.0, "mean_height: TypeError: .*positional"),
    ],
)
def test_a_metric_without_a_number_fails_its_designs_and_says_so(tmp_path, compute, message):
    faulty = replace(MEAN_HEIGHT, compute=compute)
    with pytest.warns(SoftreachWarning, match=f"4 designs failed, .*MetricFailed: {message}"):
        build_atlas(small_space(), tmp_path / "a.zarr", **SMALL | {"metrics": [faulty]})
    assert atlas_status(tmp_path / "a.zarr").failed == 4


def test_nan_is_an_answer_where_the_metric_says_when(tmp_path):
    sometimes = replace(MEAN_HEIGHT, compute=lambda tips: np.nan, nan_if="there is no sky")
    atlas = build_atlas(small_space(), tmp_path / "a.zarr", **SMALL | {"metrics": [sometimes]})
    assert np.isnan(atlas.mean_height).all()
    assert atlas_status(atlas).done == 4


@pytest.mark.parametrize(
    ("metrics", "message"),
    [
        (("extend",), "metrics = 'extend': must be some of extent, convex"),
        ((), "metrics = none: must be some of extent"),
        ("extent", "metrics = 'extent': must be some of"),
        ((MEAN_HEIGHT, replace(MEAN_HEIGHT, unit="1")), "name of a metric = mean_height"),
        ((replace(MEAN_HEIGHT, name="volume"),), "name of a metric = volume: must be of one"),
        (
            (replace(MEAN_HEIGHT, name="status"),),
            "name of a metric = status: must be a name that the atlas does not use",
        ),
        (
            (replace(MEAN_HEIGHT, name="taper"),),
            "name of a metric = taper: must be a name that the atlas does not use",
        ),
    ],
)
def test_metrics_that_cannot_be_told_apart_are_refused(tmp_path, metrics, message):
    with pytest.raises(InvalidInput, match=message) as caught:
        build_atlas(small_space(), tmp_path / "a.zarr", **SMALL | {"metrics": metrics})
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "a.zarr").exists()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "mean height"}, "name of the metric = mean height: must be letters"),
        ({"needs": ("tips",)}, "needs of metric mean_height = .*: must be some of Need.ARM"),
        ({"compute": 3}, "compute of metric mean_height = 3: must be a function"),
        ({"over": ("sample",)}, "over of metric mean_height = .*: must be"),
    ],
)
def test_faulty_metrics_are_refused_when_they_are_made(change, message):
    with pytest.raises(InvalidInput, match=message):
        replace(MEAN_HEIGHT, **change)


# Metrics and stores


def test_a_call_with_other_metrics_does_not_resume(tmp_path):
    store = tmp_path / "a.zarr"
    asked = SMALL | {"metrics": ("extent", MEAN_HEIGHT)}
    first = build_atlas(small_space(), store, **asked).load()
    again = SMALL | {"metrics": (MEAN_HEIGHT, "extent")}
    assert_same(build_atlas(small_space(), store, **again).load(), first)
    for metrics, message in [
        (("extent",), "metrics: mean_height there and not here"),
        (("extent", "convex", MEAN_HEIGHT), "metrics: convex_volume here and not there"),
        (
            ("extent", replace(MEAN_HEIGHT, compute=np.mean)),
            "metric mean_height, compute: 'tests.atlas.test_own_metrics:mean_height' there",
        ),
        (("extent", replace(MEAN_HEIGHT, unit="1")), "metric mean_height, unit: 'm' there, '1'"),
    ]:
        with pytest.raises(InvalidInput, match=message):
            build_atlas(small_space(), store, **SMALL | {"metrics": metrics})


def test_a_store_is_read_without_the_functions_of_its_metrics(tmp_path):
    store = tmp_path / "a.zarr"
    asked = SMALL | {"metrics": ("convex", MEAN_HEIGHT)}
    AtlasStore.begin(store, command(small_space(), **asked))
    convex, height = AtlasStore.open(store).command.metrics
    assert convex is METRIC_GROUPS["convex"][0]
    assert height.to_dict() == MEAN_HEIGHT.to_dict()
    with pytest.raises(MetricFailed, match=r"test_own_metrics:mean_height .*pass the metric"):
        height.value({Need.TIPS: np.zeros((1, 3))}, {})


def test_workers_can_get_the_functions_of_all_metrics():
    tips = np.arange(6.0).reshape(2, 3)
    for metric in chosen_metrics([*METRIC_GROUPS, MEAN_HEIGHT]):
        sent = pickle.loads(pickle.dumps(metric))
        assert sent.to_dict() == metric.to_dict()
        if metric.needs == (Need.TIPS,):
            assert sent.value({Need.TIPS: tips}, {}) == metric.value({Need.TIPS: tips}, {})


def test_lambdas_are_refused_in_one_line_where_workers_compute_them(tmp_path):
    typed = replace(MEAN_HEIGHT, compute=lambda tips: 0.0)
    options = SMALL | {"metrics": [typed]}
    with (
        ProcessPoolExecutor(1) as pool,
        pytest.raises(InvalidInput, match=r"compute of metric mean_height = .*lambda") as caught,
    ):
        build_atlas(small_space(), tmp_path / "a.zarr", executor=pool, **options)
    assert "\n" not in str(caught.value)
    with ThreadPoolExecutor(1) as threads:
        atlas = build_atlas(small_space(), tmp_path / "a.zarr", executor=threads, **options)
    assert (atlas.mean_height == 0).all()


def test_worker_processes_know_actuators_and_metrics_of_ones_own(tmp_path):
    """The modules of the classes and functions are imported where the task arrives."""
    trunk = sr.designs.minimal_trunk()
    cable = Cable(place=(0.03, 0.0), name="cable", activation_bounds=(0.0, 1e-4))
    base = trunk.replace(actuators=(*trunk.actuators[:2], cable))
    space = sr.DesignSpace.grid(base, **{"cable.place[0]": [0.01, 0.03]})
    options = {"n": 50, "metrics": ("extent", MEAN_HEIGHT)}
    alone = build_atlas(space, tmp_path / "a.zarr", **options).load()
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        found = build_atlas(space, tmp_path / "b.zarr", executor=pool, **options).load()
    assert_same(found, alone)
