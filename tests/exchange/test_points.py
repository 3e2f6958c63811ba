"""Points of other programs: the same places from every format, and their hulls in closed form."""

import json
import re

import numpy as np
import pytest

import softreach as sr
from softreach.cli.app import run
from softreach.exchange import read_points

CUBE = np.array(np.meshgrid(*[np.linspace(0.0, 100.0, 6)] * 3)).reshape(3, -1).T  # [mm]


def write_csv(path, points, header=""):
    np.savetxt(path, points, delimiter=",", header=header, comments="", fmt="%.17g")


@pytest.fixture
def files(tmp_path):
    pd, trimesh = pytest.importorskip("pandas"), pytest.importorskip("trimesh")
    pytest.importorskip("pyarrow")
    write_csv(tmp_path / "named.csv", CUBE, "x_mm,y_mm,z_mm")
    write_csv(tmp_path / "tips.csv", CUBE[:, ::-1], "tip z [mm],tip y [mm],tip x [mm]")
    write_csv(tmp_path / "plain.csv", CUBE)
    np.savetxt(tmp_path / "spaces.txt", CUBE)
    pd.DataFrame(CUBE, columns=list("xyz")).to_parquet(tmp_path / "table.parquet")
    np.save(tmp_path / "array.npy", CUBE)
    trimesh.PointCloud(CUBE).export(tmp_path / "cloud.ply")
    return sorted(tmp_path.iterdir())


def test_every_format_holds_the_same_places(files):
    assert len(files) == 7
    for file in files:
        cloud = read_points(file, unit="mm")
        assert np.allclose(cloud.tip, 1e-3 * CUBE, rtol=0, atol=1e-9), file.name
        assert cloud.activation.shape == (216, 0)


def test_a_cloud_that_was_exported_is_read_back(trunk, tmp_path):
    cloud = sr.compute_cloud(trunk, 100)
    for unit in ("m", "mm"):
        sr.export.export_cloud(cloud, file := tmp_path / f"{unit}.csv", unit=unit)
        assert np.allclose(read_points(file).tip, cloud.tip, rtol=0, atol=1e-12)


def test_the_volume_of_a_cube_and_the_area_of_a_square_are_printed(tmp_path, capsys):
    write_csv(tmp_path / "cube.csv", CUBE, "x_mm,y_mm,z_mm")
    assert run(["volume", str(tmp_path / "cube.csv"), "--alpha", "60mm", "--json"]) == 0
    assert '"volume_m3": 0.001' in capsys.readouterr().out
    write_csv(tmp_path / "square.csv", CUBE[::6, :2])
    assert run(["volume", str(tmp_path / "square.csv"), "--unit", "mm", "--alpha", "30mm"]) == 0
    assert "area (in one plane)  10000 mm²" in capsys.readouterr().out


def test_places_inside_and_another_shape_are_those_of_two_cubes(tmp_path, capsys):
    names = [str(tmp_path / name) for name in ("cube.csv", "moved.csv")]
    write_csv(names[0], CUBE, "x_mm,y_mm,z_mm")
    write_csv(names[1], CUBE + [60.0, 0.0, 0.0], "x_mm,y_mm,z_mm")
    words = ["volume", names[0], "--alpha", "60mm", "--inside", names[1], "--compare", names[1]]
    assert run([*words, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["places_inside"] == (CUBE[:, 0] <= 40.0).tolist()
    assert found["overlap_m3"] == pytest.approx(4e-4, rel=1e-9)
    assert found["symmetric_difference_m3"] == pytest.approx(12e-4, rel=1e-9)
    assert found["farthest_m"] == found["farthest_of_other_m"] == pytest.approx(0.06)
    assert run(words) == 0
    assert re.search("places inside +108 of 216", capsys.readouterr().out)


def test_a_place_is_inside_if_it_is_in_a_tetrahedron_that_is_kept():
    from scipy.spatial import Delaunay

    rng = np.random.default_rng(0)
    points, places = rng.random((1000, 3)), rng.random((4000, 3))
    hull, mesh = sr.concave_hull(points, 0.3), Delaunay(points)
    cell = mesh.find_simplex(places)
    edges = points[mesh.simplices[cell, 1:]] - points[mesh.simplices[cell, :1]]
    center = np.linalg.solve(2.0 * edges, (edges**2).sum(axis=2, keepdims=True))
    kept = (cell >= 0) & (np.linalg.norm(center[..., 0], axis=1) <= 0.3)
    assert (hull.contains(places) == kept).all()


def test_the_largest_region_is_that_of_the_larger_of_two_cubes():
    both = np.concatenate([CUBE, 0.5 * CUBE + [300.0, 0.0, 0.0]])
    hull = sr.concave_hull(both, 60.0)
    assert hull.regions == 2
    assert hull.largest_region == pytest.approx(1e6)
    assert hull.volume == pytest.approx(1.125e6)
    ball = np.random.default_rng(0).normal(size=(40_000, 3))  # cut into boxes
    ball /= np.linalg.norm(ball, axis=1)[:, None].clip(1.0)
    shapes = (sr.concave_hull(x, 0.3) for x in (ball, np.concatenate([ball, ball[:5000] + 5.0])))
    alone, beside = (each.largest_region for each in shapes)
    assert alone == pytest.approx(beside, rel=1e-9)


def test_points_are_drawn(tmp_path):
    pytest.importorskip("matplotlib")
    np.save(tmp_path / "a.npy", CUBE)
    for name in ("a.png", "a.html"):
        assert run(["show", str(tmp_path / "a.npy"), "--out", str(tmp_path / name)]) == 0
        assert (tmp_path / name).stat().st_size > 1000


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.csv", "x,y,z\n1,2,nan\n", "z in row 0 = nan"),
        ("a.csv", "x,y,z\n1,2,3\n1,2,3,4\n", "row 1 of .* = 4 cells: must be 3"),
        ("a.csv", "u,v,w\n1,2,3\n", "must be x, y and z"),
        ("a.csv", "x_mm,y_cm,z_mm\n1,2,3\n", "must be of one unit"),
        ("a.csv", "", "a table in CSV"),
        ("a.csv", "1,2,3\n1,2,a\n", "column z = .*: must be numbers"),
        ("a.npy", "no array", "a table in CSV"),
    ],
)
def test_what_holds_no_points_is_refused_in_one_line(tmp_path, name, text, message):
    (tmp_path / name).write_text(text)
    with pytest.raises(sr.InvalidInput, match=message) as refused:
        read_points(tmp_path / name)
    assert "\n" not in str(refused.value)


def test_options_of_a_design_are_refused_on_points(tmp_path, capsys):
    write_csv(tmp_path / "cube.csv", CUBE)
    assert run(["volume", str(tmp_path / "cube.csv"), "--n", "1000"]) == 2
    assert "on points, which have no design" in capsys.readouterr().err
    assert run(["volume", str(tmp_path / "cube.csv"), "--alpha", "0.1L"]) == 2
    assert "like 5cm" in capsys.readouterr().err
