"""An atlas that is read: its clouds, designs, best designs, and its figures."""

import pickle
import re
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import softreach as sr
from softreach.arm.parameters import changed
from softreach.atlas import atlas_cloud, atlas_design, atlas_status, best_designs, build_atlas
from softreach.atlas.build import begin_design
from softreach.atlas.metrics import METRIC_GROUPS
from softreach.atlas.store import AtlasStore
from softreach.cli.app import run
from softreach.picture.projection import view_axes
from softreach.plot import atlas_figures, plot_metric_map
from softreach.plot.atlas import box_over_length, hull_over_length, panel_extent, sheet_axes
from softreach.support.errors import InvalidInput, SoftreachWarning
from tests.atlas.families import (
    SMALL,
    TINY,
    assert_same,
    command,
    gapped_space,
    similar_designs,
    small_space,
)
from tests.laws import of_length


def test_stored_clouds_are_those_of_the_cloud_alone_to_half_a_step(paper):
    at = {"revolution": 0.0, "taper": np.radians(3)}
    stored = atlas_cloud(paper, **at)
    alone = sr.compute_cloud(sr.cloud.design_of(stored), n=20_000, seed=1)
    assert stored.activation.equals(alone.activation)
    assert np.abs(stored.tip.values - alone.tip.values).max() <= 0.5e-5 * (1 + 1e-9)
    assert stored.attrs == alone.attrs


EVERYDAY = {
    "where": lambda data, dim: data.where(data[dim] == data[dim]),
    "where drop": lambda data, dim: data.where(data[dim] > data[dim][0], drop=True),
    "reindex": lambda data, dim: data.reindex({dim: [*data[dim].values, 1e3]}),
    "merge": lambda data, dim: xr.merge([data, data], compat="override", join="outer"),
    "max": lambda data, dim: data.max(),
    "diff": lambda data, dim: data.diff(dim),
    "concat": lambda data, dim: xr.concat([data, data], "again"),
    "to_dataframe": lambda data, dim: data.drop_dims("sample").to_dataframe(),
    "pickle": lambda data, dim: pickle.loads(pickle.dumps(data.load())),
}


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return build_atlas(small_space(), tmp_path_factory.mktemp("atlas") / "small.zarr", **TINY)


@pytest.mark.parametrize("operation", EVERYDAY.values(), ids=EVERYDAY)
def test_an_atlas_that_was_read_is_a_dataset_like_any_other(small, operation):
    operation(small, "taper")._repr_html_()


def test_so_is_a_cloud(tmp_path, trunk):
    sr.save_cloud(sr.compute_cloud(trunk, 50), tmp_path / "cloud.zarr")
    cloud = sr.open_cloud(tmp_path / "cloud.zarr")
    for name in ("where", "where drop", "reindex", "max", "diff", "pickle"):
        EVERYDAY[name](cloud.assign_coords(sample=np.arange(50.0)), "sample")._repr_html_()
    assert cloud.reindex(axis=["z", "none"]).tip.isnull().any()


def test_a_metric_that_a_later_version_has_does_not_stop_an_atlas(tmp_path, monkeypatch):
    settings = {**TINY, "metrics": ["extent"], "keep_clouds": False}
    with monkeypatch.context() as older:
        older.setattr("softreach.atlas.space.version", lambda _: "0.0.9")
        older.setitem(METRIC_GROUPS, "extent", METRIC_GROUPS["extent"][:-1])
        begun = build_atlas(small_space(), tmp_path / "a.zarr", **settings).load()
    with pytest.warns(SoftreachWarning, match=r"begun by softreach 0\.0\.9"):
        atlas = build_atlas(small_space(), tmp_path / "a.zarr", **settings)
    assert_same(atlas, begun)


def test_a_cloud_of_somebodys_own_actuator_opens_without_its_module(tmp_path, trunk):
    cloud = sr.compute_cloud(trunk, 50)
    cloud.attrs["design"] = cloud.attrs["design"].replace('kind = "fiber"', 'kind = "Magnets"')
    sr.save_cloud(cloud, tmp_path / "cloud.zarr")
    found = sr.open_cloud(tmp_path / "cloud.zarr")
    assert sr.convex_hull(found.tip).volume == sr.convex_hull(cloud.tip).volume
    with pytest.raises(sr.InvalidDesign, match=r"Magnets.*--import"):
        sr.cloud.design_of(found)


def test_so_does_an_atlas(tmp_path, monkeypatch):
    """Its points and metrics; whoever asks for the design is told what is missing."""
    place = tmp_path / "a.zarr"
    built = build_atlas(small_space(), place, **SMALL).load()
    known = sr.Manipulator.from_toml

    def unknown(text, source):
        return known(text.replace('kind = "fiber"', 'kind = "Magnets"'), source)

    monkeypatch.setattr(sr.Manipulator, "from_toml", unknown)
    found = sr.open_atlas(place)
    assert_same(found.load(), built)
    assert best_designs(found, "volume").volume == built.volume.max()
    assert atlas_status(place).done == 4
    for ask in (atlas_design, atlas_cloud):
        with pytest.raises(sr.InvalidDesign, match=r"Magnets.*--import"):
            ask(found, revolution=0.5, taper=0.0)


def test_clouds_that_were_not_kept_are_computed_again(tmp_path):
    atlas = build_atlas(small_space(), tmp_path / "a.zarr", keep_clouds=False, **SMALL)
    assert "tip" not in atlas
    again = atlas_cloud(atlas, revolution=0.5, taper=0.0)
    alone = sr.compute_cloud(sr.cloud.design_of(again), n=2_000)
    assert again.tip.equals(alone.tip)


def test_any_reader_of_zarr_and_cf_understands_the_store(tmp_path):
    build_atlas(small_space(length=[1.0, 1.5]), tmp_path / "a.zarr", **SMALL)
    raw = xr.open_zarr(tmp_path / "a.zarr", consolidated=False, zarr_format=3, chunks=None)
    tips = raw.tip.isel(revolution=1, taper=1, length=1).T.values
    alone = sr.compute_cloud(of_length(sr.designs.minimal_trunk(1.5), 1.5), n=2_000)
    np.testing.assert_allclose(tips, alone.tip, atol=0.6e-5)
    assert raw.taper.attrs["units"] == "rad"
    assert raw.status.attrs["flag_meanings"].split()[1] == "done"


def test_designs_with_more_bundles_share_the_activations_of_the_others(tmp_path):
    space = sr.DesignSpace.listed(sr.designs.minimal_trunk(), **{"left.bundles": [1, 2]})
    atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    few, more = atlas_cloud(atlas, design=0), atlas_cloud(atlas, design=1)
    assert (few.activation.shape[1], more.activation.shape[1]) == (3, 4)
    np.testing.assert_array_equal(few.activation, more.activation[:, :3])


def test_best_designs_are_the_best_that_meet_the_constraints(paper):
    found = best_designs(paper, "volume", where="taper<=0.01", count=3)
    truth = np.sort(paper.volume.sel(taper=0.0).values)[::-1]
    np.testing.assert_array_equal(found.volume, truth[:3])
    for where in (["taper_deg<=0.57"], "taper_deg<0.57"):
        assert best_designs(paper, "volume", where=where, count=3).identical(found)
    between = best_designs(paper, "volume", where=["taper_deg>=0.9", "taper_deg<=2.1"], count=99)
    taper = np.degrees(between.taper)
    assert 0.9 < taper.min() <= taper.max() < 2.1  # both constraints of one name
    least = best_designs(paper, "unreachability", smallest=True)
    np.testing.assert_allclose(least.unreachability, [paper.unreachability.min()])
    assert best_designs(paper, "volume", where=["volume>=9"]).sizes["rank"] == 0
    with pytest.raises(InvalidInput, match="metric = volumes: must be one of"):
        best_designs(paper, "volumes")


def test_no_tip_lies_outside_its_panel_of_the_sheet(paper):
    extent = panel_extent(box_over_length(paper), "oblique")
    seen = np.moveaxis(paper.tip.values, 2, -1).reshape(-1, 3) @ view_axes("oblique")[:2].T
    assert extent.left < seen[:, 0].min() < seen[:, 0].max() < extent.right
    assert extent.bottom < seen[:, 1].min() < seen[:, 1].max() < extent.top


def test_maps_need_two_parameters(paper):
    with pytest.raises(InvalidInput, match="a grid of two parameters"):
        plot_metric_map(paper.isel(taper=0), "volume")
    with pytest.raises(InvalidInput, match="metric = volumes"):
        plot_metric_map(paper, "volumes")


@pytest.fixture(scope="module")
def some(tmp_path_factory) -> Path:
    """A store with a design that is done, one that is not, one that failed and a gap."""
    place = tmp_path_factory.mktemp("some") / "a.zarr"
    asked = command(gapped_space(), **SMALL)
    store = AtlasStore.begin(place, asked)
    begin_design(store, 1)()
    store.write_status(3, "no luck")
    return place


def test_every_question_takes_a_store_or_what_was_opened_of_it(some):
    at = {"taper": np.radians(2), "outer_radius": 0.1}
    best = partial(best_designs, metric="volume")
    design, cloud = partial(atlas_design, **at), partial(atlas_cloud, **at)
    for ask in (atlas_status, best, design, cloud):
        first, *others = (ask(place) for place in (some, str(some), sr.open_atlas(some)))
        for answer in others:
            assert answer.identical(first) if ask in (best, cloud) else answer == first


def test_reading_an_atlas_makes_none_of_its_designs(tmp_path, monkeypatch):
    build_atlas(small_space(), tmp_path / "a.zarr", **SMALL)

    def made(*_):
        raise AssertionError("a design was made")

    monkeypatch.setattr(sr.DesignSpace, "design", made)
    assert atlas_status(tmp_path / "a.zarr").done == 4
    assert len(best_designs(tmp_path / "a.zarr", "volume", count=4).volume) == 4


def test_building_an_atlas_makes_each_design_once_before_any_is_computed(tmp_path, monkeypatch):
    made, plain = [], sr.DesignSpace.design
    monkeypatch.setattr(sr.DesignSpace, "design", lambda *a: made.append(a[1]) or plain(*a))
    build_atlas(small_space(), tmp_path / "a.zarr", shard=(3, 4), **SMALL)
    assert made == [0, 1, 2, 3, 3]


def test_what_is_no_atlas_or_not_there_is_refused_by_every_question(trunk, tmp_path):
    with pytest.raises(InvalidInput, match="by build_atlas; it does not exist"):
        sr.open_atlas(tmp_path / "nothing.zarr")
    assert not (tmp_path / "nothing.zarr").exists()
    cloud = sr.compute_cloud(trunk, n=10)
    for ask in (atlas_status, partial(best_designs, metric="x"), atlas_design, atlas_cloud):
        with pytest.raises(InvalidInput, match="a store, or a dataset from open_atlas"):
            ask(cloud)


def test_the_status_counts_every_design_once(some):
    status = atlas_status(some)
    counts = (status.designs, status.done, status.todo, status.failed, status.gaps)
    assert counts == (4, 1, 1, 1, 1)
    assert status.messages[3] == "no luck"
    assert "leaves no tip" in status.messages[2]
    assert re.search(r"^number 3 +no luck$", str(status), re.MULTILINE)


def test_a_part_of_an_atlas_keeps_the_numbers_of_its_designs(some):
    part = sr.open_atlas(some).isel(outer_radius=[1])
    assert part.number.values.tolist() == [[1], [3]]
    assert atlas_status(part).messages == {3: "no luck"}
    assert atlas_design(part, taper=np.radians(4), outer_radius=0.1).profile.taper == np.radians(4)


def test_questions_about_a_design_name_the_parameters_they_need(some):
    for ask in (atlas_design, atlas_cloud):
        with pytest.raises(InvalidInput, match="parameters = taper: must be all of taper, outer_r"):
            ask(some, taper=0.0)
    with pytest.raises(InvalidInput, match="must be done; its status is 3"):
        atlas_cloud(some, taper=np.radians(4), outer_radius=1 / 16)


# Figures


def test_figures_show_each_design_in_lengths_of_its_own(tmp_path):
    """Similar designs of any size fill the same box."""
    small, large, both = (
        build_atlas(similar_designs(*lengths), tmp_path / f"{lengths[0]}.zarr", **SMALL)
        for lengths in ((1.0,), (2.0,), (0.5, 2.0, 1.0))
    )
    for atlas in (large, both):
        np.testing.assert_allclose(box_over_length(atlas), box_over_length(small), rtol=1e-12)


def test_maps_and_hulls_of_an_atlas_over_length_are_relative_to_each_length(tmp_path):
    base = sr.designs.minimal_trunk(taper=0.0)
    space = sr.DesignSpace.grid(base, revolution=[0.5, 1.5], length=[0.5, 2.0])
    atlas = build_atlas(space, tmp_path / "a.zarr", **SMALL)
    best = float((atlas.volume / np.array([0.5, 2.0]) ** 3).max())
    marked = plot_metric_map(atlas, "volume").texts[-1].get_text()
    assert marked == f"{best:.3f}"
    for place in np.ndindex(2, 2):
        volume = sr.atlas.over_length(atlas, "volume")[place]
        cloud = atlas_cloud(atlas, revolution=volume.revolution, length=volume["length"])
        np.testing.assert_allclose(hull_over_length(cloud, 0.5).volume, volume, rtol=1e-3)


# `softreach atlas`: what it prints, draws and refuses


def test_there_is_a_figure_of_all_that_an_atlas_holds(paper):
    names = {"clouds", "hulls", "corners", "curvature", "map_volume", "map_exact_unreachability"}
    assert names <= {name for name, _ in atlas_figures(paper, 2)}


BUILD = ("--vary", "taper_deg=0,2", "--n", "500", "--metrics", "extent,concave")


def test_a_built_atlas_and_its_best_designs_are_those_of_the_library(folder, printed):
    assert printed("atlas", "build", "a.zarr", *BUILD, "--alpha", "0.8L")["done"] == 2
    atlas = sr.open_atlas("a.zarr")
    assert atlas.volume.attrs["alpha_over_length"] == 0.8
    alone = sr.compute_cloud(sr.designs.minimal_trunk(taper=np.radians(2)), n=500)
    volume = atlas.volume.sel(taper=np.radians(2), method="nearest")
    np.testing.assert_allclose(volume, sr.concave_hull(alone.tip, 0.8).volume, rtol=1e-12)
    asked = ["atlas", "best", "a.zarr", "volume"]
    assert printed(*asked, "--where", "taper_deg<=1")["taper_deg"] == [0.0]
    assert run([*asked, "--out", "best.toml"]) == 0
    taper = float(best_designs(atlas, "volume").taper[0])
    assert sr.Manipulator.load("best.toml") == sr.designs.minimal_trunk(taper=taper)
    assert run([*asked, "--where", "volume>=9", "--out", "a.toml"]) == 2


# Atlases over numbers of parts, called by their paths in Python, files and commands alike


MODULUS, END = "rings[0].material.young_modulus", "left.end_over_length"
VALUES = {MODULUS: [1e5, 2e5], END: [0.5, 1.0]}
VARIED = ("--vary", f"{MODULUS}_pa=1e5,2e5", "--vary", f"{END}=0.5,1", "--n", "10")


def test_the_dimensions_of_an_atlas_are_the_paths_and_axes_show_symbol_part_and_unit(tmp_path):
    space = sr.DesignSpace.grid(sr.designs.minimal_trunk(), **VALUES)
    atlas = sr.build_atlas(space, tmp_path / "a.zarr", **TINY)
    assert atlas["status"].dims == (MODULUS, END)
    assert atlas[MODULUS].attrs["units"] == "Pa"
    assert (atlas["status"] == 1).all()
    at = {MODULUS: 2e5, END: 0.5}
    alone = changed(sr.designs.minimal_trunk(), at)
    assert atlas_design(atlas, **at) == alone
    cloud = sr.compute_cloud(alone, n=TINY["n"], seed=0)
    np.testing.assert_allclose(atlas_cloud(atlas, **at).tip, cloud.tip, atol=1e-5)
    height = atlas.reach_height.sel(at)
    np.testing.assert_allclose(height, cloud.tip[:, 2].max(), rtol=1e-12)
    across, up = sheet_axes(atlas)
    assert across.label == "E of rings[0].material (Pa)"
    assert up.label == "Z₁/L of left"
    assert plot_metric_map(atlas, "reach_height").get_xlabel() == across.label


def test_the_command_line_writes_the_unit_behind_the_path(folder, printed):
    assert run(["atlas", "build", "a.zarr", *VARIED, "--metrics", "extent"]) == 0
    assert sr.open_atlas("a.zarr")["status"].dims == (MODULUS, END)
    where = ("--where", f"{MODULUS}_pa>=1.5e5", "--where", f"{END}<=0.6")
    found = printed("atlas", "best", "a.zarr", "reach_height", *where)
    assert (found[f"{MODULUS}_pa"], found[END]) == ([2e5], [0.5])


def test_one_number_is_not_varied_under_two_names():
    base = sr.designs.minimal_trunk()
    ring = base.section.rings[0].replace(name="skin")
    arm = base.replace(section=base.section.replace(rings=(ring,)))
    names = {"rings[skin].inner_ratio": [0.5], "rings[0].inner_ratio": [0.6]}
    with pytest.raises(InvalidInput, match="given once"):
        sr.DesignSpace.grid(arm, **names)
