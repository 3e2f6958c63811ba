"""A rod without actuators is an arm: against closed forms, and through everything asked of arms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import softreach as sr
from softreach import export, plot
from softreach.cli.app import run
from softreach.rod import TipStatus, tip_map
from softreach.sampling import SAMPLERS
from softreach.workspace import ReachablePoint
from tests.oracles import column, elastica

AT_REST = np.zeros((1, 0))
LENGTH, RADIUS, DENSITY, YOUNG = 1.0, 1e-4, 1000.0, 1e9


def rod(loads=None, radius=RADIUS, density=DENSITY, young=YOUNG):
    """So thin that it does not stretch."""
    material = sr.Material(young_modulus=young, density=density)
    return sr.Manipulator(
        profile=sr.LinearTaper(length=LENGTH, outer_radius=radius),
        section=sr.Section(rings=(sr.Ring(inner_ratio=0.0, material=material),)),
        actuators=(),
        loads=loads,
    )


BENDING = YOUNG * math.pi / 4 * RADIUS**4
WEIGHT = DENSITY * math.pi * RADIUS**2  # per length, for g = 1 m/s²
THICK = rod(sr.Loads(gravity=(9.81, 0.0, 0.0)), radius=0.05, young=1e6)
FREE = rod()
both = pytest.mark.parametrize("arm", [FREE, THICK], ids=["free", "loaded"])


@pytest.mark.parametrize("load", [1.0, 10.0])
def test_a_tip_force_bends_an_elastica(load):
    force = load * BENDING / LENGTH**2
    bent = rod(sr.Loads(gravity=(0, 0, 0), tip_force=(force, 0, 0)))
    tip = tip_map(bent, 1e-9).tips(AT_REST)[0]
    np.testing.assert_allclose(tip[[0, 2]], elastica.tip_loaded(load), atol=2e-8)


@pytest.mark.parametrize("load", [1.0, 4.0, 10.0, 50.0])
def test_a_heavy_cantilever_drops_as_published(load):
    gravity = load * BENDING / (WEIGHT * LENGTH**3)
    tip = tip_map(rod(sr.Loads(gravity=(0, gravity, 0))), 1e-9, warn=False).tips(AT_REST)[0]
    np.testing.assert_allclose(tip[[1, 2]], elastica.heavy(load), atol=2e-7)


@pytest.mark.parametrize(("share", "rings"), [(0.99, 0), (1.01, 1)])
def test_a_column_leans_above_its_greatest_height(share, rings):
    gravity = share * column.greenhill() * BENDING / (WEIGHT * LENGTH**3)
    every = sr.equilibria(rod(sr.Loads(gravity=(0, 0, -gravity))), [])
    assert every.is_ring.sum() == rings
    assert (every.status == TipStatus.STABLE).sum() == 1
    assert every.status[every.followed] == (TipStatus.UNSTABLE if rings else TipStatus.STABLE)


def test_without_loads_it_stays_straight():
    np.testing.assert_allclose(sr.tip_positions(FREE, AT_REST), [[0.0, 0.0, LENGTH]], atol=1e-15)
    shape = sr.configuration(FREE, [])
    np.testing.assert_allclose(shape.position[:, 2], shape.Z, atol=1e-14)


@both
def test_it_has_one_tip_and_shape(arm):
    tip = sr.tip_positions(arm, AT_REST)
    assert sr.tip_jacobian(arm, AT_REST).shape == (1, 6, 0)
    shape = sr.configuration(arm, [])
    np.testing.assert_allclose(shape.position[-1], tip[0], atol=1e-6)
    assert shape.sizes["bundle"] == 0
    np.testing.assert_array_equal(tip_map(arm).status(np.zeros((3, 0))), [TipStatus.STABLE] * 3)
    with pytest.raises(sr.InvalidInput, match=r"\(n, 0\)"):
        sr.tip_positions(arm, np.zeros((1, 1)))


@both
@pytest.mark.parametrize("sampler", SAMPLERS)
def test_a_cloud_repeats_its_tip(arm, sampler):
    cloud = sr.compute_cloud(arm, n=10, sampler=sampler)
    np.testing.assert_allclose(cloud.tip, np.tile(sr.tip_positions(arm, AT_REST), (10, 1)))
    assert sr.convex_hull(cloud.tip).volume == 0.0


@both
def test_its_reachable_set_is_a_point(arm):
    found = sr.reachable_set(arm)
    assert isinstance(found, ReachablePoint)
    np.testing.assert_allclose(found.tip, sr.tip_positions(arm, AT_REST)[0], atol=1e-6)


@both
def test_the_inverse_reaches_its_tip_and_nothing_else(arm):
    tip = tip_map(arm, 1e-10).tips(AT_REST)[0]
    here, elsewhere = sr.solve_inverse(tip_map(arm, 1e-10), [tip, tip + [0.0, 0.1, 0.0]])
    assert here.activations.shape == (1, 0)
    assert elsewhere.status.name == "UNREACHABLE"
    assert elsewhere.gap == pytest.approx(0.1, abs=1e-6)


def test_what_never_rests_is_refused():
    upright = THICK.replace(loads=sr.Loads(payload=2.0))
    with pytest.raises(sr.InvalidInput, match="none of 1 activations tried"):
        sr.reachable_set(upright)


@both
def test_files_and_bounds_hold_it(arm, tmp_path):
    arm.save(tmp_path / "rod.toml")
    assert sr.Manipulator.load(tmp_path / "rod.toml") == arm
    assert arm.with_bounds((0, 1)) == arm
    assert "passive" in repr(arm)
    assert sr.describe(arm).bundle_extension.shape == (0, 2)
    assert arm._repr_html_()


def test_a_file_without_the_key_has_forgotten_its_actuators():
    text = FREE.to_toml().replace("actuators = []\n", "")
    with pytest.raises(sr.InvalidDesign, match="actuators: required key is missing"):
        sr.Manipulator.from_toml(text)


@both
def test_pictures_and_exports_show_it(arm, tmp_path):
    shape, cloud = sr.configuration(arm, []), sr.compute_cloud(arm, n=10)
    plot.save_figure(plot.plot_views(cloud, arm, shape), tmp_path / "views.png")
    plot.save_figure(plot.plot_cross_section(arm), tmp_path / "section.png")
    plot.save_figure(plot.plot_equilibria(sr.equilibria(arm, [])), tmp_path / "equilibria.png")
    export.export_arm(arm, shape, tmp_path / "arm.stl")
    export.export_cloud(cloud, tmp_path / "cloud.csv")
    sr.save_cloud(cloud, tmp_path / "cloud.zarr")
    assert sr.open_cloud(tmp_path / "cloud.zarr").sizes["bundle"] == 0


def test_the_command_line_takes_it(tmp_path, capsys):
    design, cloud = str(tmp_path / "rod.toml"), str(tmp_path / "rod.zarr")
    THICK.save(design)
    for arguments in (
        ["design", design],
        ["cloud", design, "--n", "10", "--out", cloud],
        ["show", cloud, "--out", str(tmp_path / "rod.png")],
        ["reach", design],
        ["equilibria", design, "--out", str(tmp_path / "all.png")],
        ["equilibria", design, "--json"],
    ):
        assert run(arguments) == 0, capsys.readouterr().err
    assert '"degree": 1' in capsys.readouterr().out
