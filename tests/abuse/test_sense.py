"""Numbers, names, labels and files that mean nothing: refused where they enter, in one line."""

import zipfile

import numpy as np
import pytest

import softreach as sr
from softreach.arm import Loads
from softreach.cli.app import run
from softreach.inverse.request import position_in
from softreach.requirements import Mesh, Requirements
from softreach.support.errors import InvalidInput
from softreach.support.quantity import read_quantity
from tests.abuse.refusals import raised_by, refusal_of

ROBOT = sr.designs.three_tendon_robot()
TEXT = ROBOT.to_toml()
BEYOND = [
    ("length_m = 0.2", "length_m = 1001", "<= 1000 m"),
    ("length_m = 0.2", "length_m = 1e-7", ">= 1e-06"),
    ("outer_radius_m = 0.0007", "outer_radius_m = 21", "100 times the length"),
    ("distance_m = 0.01", "distance_ratio = 1e3", "at most the length of the arm"),
    ("offset_deg = 90.0", "offset_deg = 1e300", "deg"),
    ("young_modulus_pa = 54000000000.0", "young_modulus_pa = 1e300", "<= 1e+15 Pa"),
    ("tension_bounds_n = [0.0, 8.0]", "tension_bounds_n = [0, 1e300]", "up to 1e+15"),
    ("", "\n[loads]\ntip_force_n = [0, 1e300, 0]", "<= 1e+15 N"),
    ("", "\n[rest]\ncurvature_y_per_m = 1e155", "<= 1e+06 1/m"),
    ("", "\n[rest]\ncurvature_y_per_m = 1e5", "at most 100 turns"),
    ("", f"\nx = {'[' * 90_000}", "nested too deep"),
]


@pytest.mark.parametrize(("old", "new", "bound"), BEYOND, ids=lambda one: one.strip()[:30])
def test_a_number_that_no_arm_has_is_refused_with_its_bound(old, new, bound):
    text = TEXT.replace(old, new) if old else TEXT + new
    assert text != TEXT
    assert bound in str(raised_by(lambda: sr.Manipulator.from_toml(text)))


def test_activations_that_push_a_tendon_or_are_far_from_bounds_are_refused():
    assert "cannot push" in str(raised_by(lambda: sr.tip_positions(ROBOT, [[-1.0, 0.0, 0.0]])))
    assert "1000 times" in str(raised_by(lambda: sr.tip_positions(ROBOT, [[9e3, 0.0, 0.0]])))
    trunk = sr.designs.minimal_trunk()
    assert np.isfinite(sr.tip_positions(trunk, [[-5 / 3, 0.5, 0.0]])).all()  # no bound is one


def test_labels_count_and_not_the_places_of_columns():
    arm = sr.designs.minimal_trunk()
    cloud = sr.compute_cloud(arm, 200)
    turned = cloud.isel(axis=[2, 0, 1])
    one, other = (np.sort(sr.convex_hull(each.tip).vertices, axis=0) for each in (turned, cloud))
    assert np.array_equal(one, other)
    assert "x, y, z" in str(raised_by(lambda: sr.plot.plot_cloud(turned)))
    activation = cloud.activation.isel(bundle=[1, 2, 0]).transpose()
    assert np.allclose(sr.tip_positions(arm, activation), cloud.tip, rtol=0.0, atol=1e-15)
    strange = activation.assign_coords(bundle=["a", "b", "c"])
    assert "labeled left, right" in str(raised_by(lambda: sr.tip_positions(arm, strange)))


@pytest.mark.parametrize("unit", ["mm", "m"])
@pytest.mark.parametrize("suffix", ["stl", "ply", "obj", "glb"])
def test_a_mesh_of_ours_is_read_in_the_unit_that_its_file_states(suffix, unit, tmp_path):
    trimesh = pytest.importorskip("trimesh")
    box, path = trimesh.creation.box(extents=(0.1, 0.2, 0.3)), tmp_path / f"box.{suffix}"
    sr.export.export_mesh((box.vertices, box.faces), path, unit=unit)
    assert np.allclose(Mesh.load(path).bounds[1], (0.05, 0.1, 0.15), rtol=1e-6)
    assert "as" in str(raised_by(lambda: Mesh.load(path, unit="cm")))
    box.export(path := tmp_path / "other.stl")
    assert "unit" in str(raised_by(lambda: Mesh.load(path)))
    text = '[[avoid]]\nof = "tip"\nmesh = "other.stl"\n'
    assert "mesh_unit" in str(raised_by(lambda: Requirements.from_toml(text, folder=tmp_path)))


def test_a_mesh_is_never_unpacked(tmp_path):
    with zipfile.ZipFile(tmp_path / "bomb.zip", "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr("a.obj", b"v 0 0 0\n" * 100_000)
    assert ".stl, .ply" in str(raised_by(lambda: Mesh.load(tmp_path / "bomb.zip", unit="m")))


def test_names_are_drawn_as_they_are(tmp_path):
    pytest.importorskip("matplotlib")
    cloud = sr.compute_cloud(sr.designs.redundant_trunk(), 500)
    title, distance = r"$\input$ 50 % _x^", sr.redundancy.activation_distance(cloud, 0.2)
    figure = sr.plot.plot_redundancy({title: cloud}, {title: distance})
    sr.plot.save_figure(figure, tmp_path / "a.svg")
    assert r"$\input$ 50 % _x^" in (tmp_path / "a.svg").read_text()


def test_what_a_terminal_would_obey_is_printed_as_escapes(capsys):
    assert run(["design", "a\x1b[31m\x00\x9b\u202e.toml"]) == 2
    assert r"a\x1b[31m\x00\x9b\u202e.toml" in capsys.readouterr().err


def test_a_command_that_takes_no_points_names_what_does(tmp_path, capsys):
    (tmp_path / "pts.csv").write_text("x,y,z\n0,0,0\n")
    said = refusal_of(["reach", str(tmp_path / "pts.csv")], capsys, tmp_path)
    assert "softreach volume" in said


def test_warmup_that_cannot_keep_anything_says_so_and_fails(monkeypatch, capsys):
    monkeypatch.setattr("softreach.kernels.compiler.not_kept", ["no locator"])
    assert run(["warmup"]) == 1
    assert "nothing could be kept: no locator; set NUMBA_CACHE_DIR" in capsys.readouterr().err


def test_nothing_moves_the_tip_of_a_passive_arm(capsys, tmp_path):
    passive = ROBOT.replace(actuators=())
    cloud = sr.compute_cloud(passive, 4)
    assert "1 or more" in str(raised_by(lambda: sr.dexterity.dexterity(cloud)))
    passive.save(tmp_path / "a.toml")
    assert run(["solve", str(tmp_path / "a.toml"), "--target", "0,0,200mm"]) == 0
    assert "nan" not in capsys.readouterr().out


def test_a_zero_needs_no_unit_and_loads_too_small_for_their_square_are_none():
    assert Loads(gravity=(0.0, 0.0, 1e-300)).gravity == (0.0, 0.0, 0.0)
    assert position_in("target", "80mm,0,120mm") == [0.08, 0.0, 0.12]
    with pytest.raises(InvalidInput):
        position_in("target", "80mm,0.1,120mm")
    assert read_quantity("0", "N") == 0.0
