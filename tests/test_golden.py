"""Numbers that another program printed: the README of ActiveFilaments.jl.

ActiveFilaments.jl, by the theory's authors, integrates the same rod in Julia with an adaptive
method. Its README, section "Computing an activated configuration", prints position and directors of
one filament at Z = L/10 (https://github.com/LivingMatterLab/ActiveFilaments.jl, commit 0bf8286)."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

import softreach as sr
from softreach.arm import designs
from softreach.atlas import DesignSpace, atlas_cloud, atlas_status, open_atlas
from softreach.exchange import activefilaments
from softreach.export import export_arm
from softreach.plot import plot_slab
from softreach.rod.kinematics import configuration
from softreach.support.errors import InvalidInput

POSITION = [0.010887432435510243, 0.010588028536001756, 0.08230390930976722]
DIRECTORS = [
    [0.9378971336343721, -0.3068269347479843, -0.16188328769080979],
    [0.24481737934065784, 0.9160122985605073, -0.31778281838178346],
    [0.24579141053584871, 0.25841575222701285, 0.9342418752698606],
]


def test_an_activated_filament_is_that_of_active_filaments_jl():
    """L = 1 m, R2 = L/16, R1 = 0.6 R2, ν = 1/2; three sectors of 30° from the x-axis on."""
    shape = configuration(designs.filament(), [-2.0, -1.3, 0.0], stations=[0.1], tol=1e-12)
    np.testing.assert_allclose(shape.position[0], POSITION, rtol=0, atol=1e-12)
    np.testing.assert_allclose(shape.directors[0], DIRECTORS, rtol=0, atol=1e-12)


# What leaves a posed arm, pictures, meshes and atlases, is where the arm is in the world


CEILING = sr.Base(points="down", position=(0.1, 0.2, 2.0))


@pytest.fixture
def hanging(trunk):
    return trunk.replace(base=CEILING)


def test_a_mesh_hangs_from_the_ceiling(hanging, tmp_path):
    import trimesh

    shape = sr.configuration(hanging, [0, 0, 0])
    export_arm(hanging, shape, tmp_path / "arm.stl")
    low, high = trimesh.load(tmp_path / "arm.stl").bounds
    assert (low[2], high[2]) == pytest.approx((1.0, 2.0), abs=0.01)
    np.testing.assert_allclose((low + high)[:2] / 2, CEILING.position[:2], atol=0.01)


def test_a_slab_goes_through_the_base_unless_it_is_said_where(hanging):
    cloud = sr.compute_cloud(hanging, 5_000)
    axes = plot_slab(cloud, view="front")
    assert any("y - 0.2 L" in text.get_text() for text in axes.texts)
    in_base = plot_slab(sr.compute_cloud(hanging, 5_000, frame="base"), view="front")
    assert any("|y| " in text.get_text() for text in in_base.texts)


def test_an_atlas_holds_the_box_in_the_world_and_the_reach_from_the_base(trunk, hanging):
    spaces = (DesignSpace.grid(arm, taper=[0.02]) for arm in (trunk, hanging))
    options = {"n": 2_000, "metrics": ["extent"]}
    up, down = (sr.build_atlas(space, {}, **options).isel(taper=0) for space in spaces)
    assert float(down.z_max) == pytest.approx(2.0 - float(up.z_min))
    assert float(down.y_min) == pytest.approx(0.2 - float(up.y_max))
    for name in ("reach_height", "reach_radius"):
        assert float(down[name]) == pytest.approx(float(up[name]))


def test_the_base_may_vary_over_an_atlas(hanging):
    space = DesignSpace.grid(hanging, **{"base.position[2]": [1.0, 3.0]})
    store = {}
    atlas = sr.build_atlas(space, store, n=500, metrics=["extent"])
    assert float(atlas.z_max[1] - atlas.z_max[0]) == pytest.approx(2.0)
    cloud = atlas_cloud(store, **{"base.position[2]": 3.0})
    assert cloud.attrs["base_position"] == [0.1, 0.2, 3.0]


def test_a_posed_arm_is_no_filament_of_the_other_program(hanging):
    with pytest.raises(InvalidInput, match=r"base = points down.*upright at the origin"):
        activefilaments.design_script(hanging)


# Files of released versions open as docs/platforms.md says


KEPT = Path(__file__).parent / "data" / "kept"


@pytest.fixture
def arm():
    return sr.Manipulator.load(KEPT / "trunk-0.1.0.toml")


def test_a_kept_design_is_the_one_that_was_written(arm):
    expected = sr.designs.minimal_trunk(revolution=np.radians(108), taper=np.radians(2))
    there, here = (sr.tip_positions(each, [-1.0, -0.5, 0.0]) for each in (arm, expected))
    np.testing.assert_allclose(there, here, rtol=0, atol=1e-12)


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
