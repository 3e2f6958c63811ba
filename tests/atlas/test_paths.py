"""Atlases over numbers of parts, called by their paths in Python, files and commands alike."""

from __future__ import annotations

import json

import numpy as np
import pytest

import softreach as sr
from softreach.arm.actuators import Tendon
from softreach.arm.material import Material
from softreach.arm.parameters import changed
from softreach.arm.profile import PiecewiseTaper
from softreach.arm.section import Ring, Section
from softreach.atlas import DesignSpace, atlas_cloud, atlas_design, best_designs, open_atlas
from softreach.atlas.space_file import parse_space
from softreach.atlas.store import AtlasStore
from softreach.cli.app import run
from softreach.support.errors import InvalidInput
from tests.atlas.families import TINY, assert_same, command

MODULUS, END = "rings[0].material.young_modulus", "left.end_over_length"
VALUES = {MODULUS: [1e5, 2e5], END: [0.5, 1.0]}
BUILD = ("--vary", f"{MODULUS}_pa=1e5,2e5", "--vary", f"{END}=0.5,1", "--n", "10")


def space() -> DesignSpace:
    return DesignSpace.grid(sr.designs.minimal_trunk(), **VALUES)


def built(store):
    return sr.build_atlas(space(), store, **TINY)


def test_the_dimensions_of_an_atlas_are_the_paths(tmp_path):
    atlas = built(tmp_path / "a.zarr")
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


@pytest.mark.parametrize("url", [False, True])
def test_an_atlas_over_paths_is_resumed_where_it_stopped(tmp_path, url):
    store = f"memory://{tmp_path.name}/a.zarr" if url else tmp_path / "a.zarr"
    sr.build_atlas(space(), store, **TINY, shard=(1, 2))
    assert open_atlas(store)["status"].values.tolist() == [[0, 1], [0, 1]]
    assert_same(built(store).load().drop_attrs(), built({}).load().drop_attrs())


def test_another_value_of_a_path_is_another_command(tmp_path):
    begun = AtlasStore.begin(tmp_path / "a.zarr", command(space(), **TINY))
    other = DesignSpace.grid(space().base, **VALUES | {END: [0.5, 0.9]})
    with pytest.raises(InvalidInput, match=rf"it differs in {END}: \(0.5, 1.0\) there"):
        AtlasStore.begin(begun.location, command(other, **TINY))


def test_the_best_design_is_found_under_a_constraint_on_a_path(tmp_path):
    best = best_designs(built(tmp_path / "a.zarr"), "reach_radius", where={END: (None, 0.6)})
    assert best[END].item() == 0.5


def test_the_command_line_writes_the_unit_behind_the_path(tmp_path, capsys):
    store = str(tmp_path / "a.zarr")
    assert run(["atlas", "build", store, *BUILD, "--metrics", "extent"]) == 0
    assert open_atlas(store)["status"].dims == (MODULUS, END)
    capsys.readouterr()
    where = ("--where", f"{MODULUS}_pa>=1.5e5", "--where", f"{END}<=0.6")
    assert run(["atlas", "best", store, "reach_height", *where, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found[f"{MODULUS}_pa"], found[END]) == ([2e5], [0.5])


@pytest.mark.parametrize(
    "table",
    [
        f'"{MODULUS}_pa" = [1e5, 2e5]\nleft.end_over_length = "0.5:1:2"',
        '"rings[0]".material.young_modulus_pa = [1e5, 2e5]\n"left.end_over_length" = [0.5, 1]',
    ],
)
def test_a_file_names_the_same_paths(table):
    parsed = parse_space(f"[parameters]\n{table}", lambda _: sr.designs.minimal_trunk())
    assert parsed == space()
    assert DesignSpace.from_dict(space().to_dict()) == space()


def test_axes_of_figures_show_symbol_part_and_unit(tmp_path):
    pytest.importorskip("matplotlib")
    from softreach.plot import plot_metric_map, sheet_axes

    atlas = built(tmp_path / "a.zarr")
    across, up = sheet_axes(atlas)
    assert across.label == "E of rings[0].material (Pa)"
    assert up.label == "$Z_1/L$ of left"
    assert plot_metric_map(atlas, "reach_height").get_xlabel() == across.label


def test_designs_that_no_arm_can_have_are_known_before_anything_runs(tmp_path):
    names = {"rings[0].inner_ratio": [0.5, 1.0], "rings[0].material.poisson_ratio": [0.4, 0.6]}
    grid = DesignSpace.grid(sr.designs.minimal_trunk(), **names)
    assert list(grid.gaps) == [1, 2, 3]
    assert grid.gaps[3].count("must be") == 2
    impossible = DesignSpace.grid(grid.base, **{"rings[0].inner_ratio": [1.0]})
    with pytest.raises(InvalidInput, match="valid for at least one design"):
        sr.build_atlas(impossible, tmp_path / "a.zarr", **TINY)
    assert not (tmp_path / "a.zarr").exists()


def test_one_number_is_not_varied_under_two_names():
    base = sr.designs.minimal_trunk()
    ring = base.section.rings[0].replace(name="skin")
    arm = base.replace(section=base.section.replace(rings=(ring,)))
    names = {"rings[skin].inner_ratio": [0.5], "rings[0].inner_ratio": [0.6]}
    with pytest.raises(InvalidInput, match="given once"):
        DesignSpace.grid(arm, **names)


def tendon_arm() -> sr.Manipulator:
    """Two materials, and two tendons that are driven together."""
    soft, skin = (Material(young_modulus=modulus) for modulus in (1e6, 2e6))
    rings = (
        Ring(inner_ratio=0.4, outer_ratio=0.9, material=soft),
        Ring(inner_ratio=0.9, material=skin, name="skin"),
    )
    profile = PiecewiseTaper(length=0.3, stations_over_length=(0.0, 0.5, 1.0), radii=(0.02,) * 3)
    pull = Tendon(name="pull", distance=0.01, bundles=2, activation_bounds=(0.0, 20.0))
    return sr.Manipulator(profile=profile, section=Section(rings=rings), actuators=(pull,))


def test_an_arm_of_other_parts_has_an_atlas_too(tmp_path):
    names = {"rings[skin].material.young_modulus": [1e6, 4e6], "profile.radii[1]": [0.01, 0.02]}
    grid = DesignSpace.grid(tendon_arm(), **names)
    atlas = sr.build_atlas(grid, tmp_path / "a.zarr", **TINY)
    assert open_atlas(tmp_path / "a.zarr")["status"].dims == tuple(names)
    at = {"rings[skin].material.young_modulus": 4e6, "profile.radii[1]": 0.01}
    assert atlas_design(atlas, **at) == changed(tendon_arm(), at)
    reach = best_designs(atlas, "reach_radius", smallest=True)
    stiffest = (reach[name].item() for name in names)
    assert tuple(stiffest) == (4e6, 0.02)
