"""What leaves a posed arm, pictures, meshes and atlases, is where the arm is in the world."""

from __future__ import annotations

import numpy as np
import pytest

import softreach as sr
from softreach.atlas import DesignSpace, atlas_cloud
from softreach.exchange import activefilaments
from softreach.export import export_arm
from softreach.plot import plot_slab
from softreach.support.errors import InvalidInput

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


def test_the_card_of_an_arm_is_drawn_in_the_world(trunk, hanging):
    assert trunk._repr_html_().split("<pre")[0] != hanging._repr_html_().split("<pre")[0]
    assert "points down, at (0.1, 0.2, 2) m" in hanging._repr_html_()


def test_a_slab_goes_through_the_base_unless_it_is_said_where(hanging):
    cloud = sr.compute_cloud(hanging, 5_000)
    axes = plot_slab(cloud, view="front")
    assert any("y - 0.2 L" in text.get_text() for text in axes.texts)
    in_base = plot_slab(sr.compute_cloud(hanging, 5_000, frame="base"), view="front")
    assert any("|y| " in text.get_text() for text in in_base.texts)


def test_an_atlas_holds_the_box_in_the_world_and_the_reach_from_the_base(trunk, hanging):
    found = {}
    for name, arm in (("up", trunk), ("down", hanging)):
        space = DesignSpace.grid(arm, taper=[0.02])
        found[name] = sr.build_atlas(space, {}, n=2_000, metrics=["extent"]).isel(taper=0)
    up, down = found["up"], found["down"]
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


def test_a_posed_arm_is_no_filament_of_the_other_program(hanging, tmp_path):
    with pytest.raises(InvalidInput, match=r"base = points down.*upright at the origin"):
        activefilaments.write_design(hanging, tmp_path / "arm.jl")
