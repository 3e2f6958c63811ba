"""`softreach atlas`: what it prints, draws and refuses."""

from __future__ import annotations

import json

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import open_atlas
from softreach.atlas.store import AtlasStore
from softreach.cli import atlas as atlas_command
from softreach.cli.app import run
from tests.atlas.families import SMALL, command, gapped_space


def test_every_figure_is_written_as_png_and_pdf(paper, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    atlas_command.figures(paper.encoding["source"], out=tmp_path, panels=2)
    capsys.readouterr()
    names = {"clouds", "hulls", "corners", "curvature", "map_volume", "map_exact_unreachability"}
    assert names <= {path.stem for path in tmp_path.glob("*.png")}
    assert {p.stem for p in tmp_path.glob("*.png")} == {p.stem for p in tmp_path.glob("*.pdf")}


BUILD = ("--vary", "taper_deg=0,2", "--n", "500", "--metrics", "extent,concave")


def test_a_built_atlas_is_that_of_the_library(tmp_path, capsys):
    store = str(tmp_path / "a.zarr")
    assert run(["atlas", "build", store, *BUILD, "--alpha", "0.8L", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["done"] == 2
    atlas = open_atlas(store)
    assert atlas.volume.attrs["alpha_over_length"] == 0.8
    alone = sr.compute_cloud(sr.designs.minimal_trunk(taper=np.radians(2)), n=500)
    volume = atlas.volume.sel(taper=np.radians(2), method="nearest")
    np.testing.assert_allclose(volume, sr.concave_hull(alone.tip, 0.8).volume, rtol=1e-12)


def test_the_best_of_a_store_are_printed_in_units_of_people(tmp_path, capsys):
    store = str(tmp_path / "a.zarr")
    assert run(["atlas", "build", store, *BUILD, "--alpha", "0.8L"]) == 0
    capsys.readouterr()
    assert run(["atlas", "best", store, "volume", "--where", "taper_deg<=1", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["taper_deg"] == [0.0]


def test_the_status_says_what_is_wrong_with_which_design(tmp_path, capsys):
    store = AtlasStore.begin(tmp_path / "a.zarr", command(gapped_space(), **SMALL))
    store.write_status(3, "no luck")
    assert run(["atlas", "status", str(tmp_path / "a.zarr")]) == 0
    said = capsys.readouterr().out
    assert "number 3" in said
    assert "no luck" in said


def test_an_atlas_has_all_groups_of_metrics_unless_some_are_chosen(tmp_path, monkeypatch, capsys):
    from softreach import atlas as library
    from softreach.atlas.metrics import METRIC_GROUPS

    chosen = {}
    monkeypatch.setattr(library, "build_atlas", lambda *_, **options: chosen.update(options))
    monkeypatch.setattr(atlas_command, "status", lambda *_, **__: None)
    assert run(["atlas", "build", str(tmp_path / "a.zarr"), "--vary", "taper_deg=0,2"]) == 0
    assert chosen["metrics"] == tuple(METRIC_GROUPS)
    assert run(["atlas", "build", "--help"]) == 0
    text = capsys.readouterr().out
    assert all(group in text for group in METRIC_GROUPS)
