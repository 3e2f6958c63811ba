"""Clouds of ActiveFilaments.jl: two CSV files without headers, and the tips that belong to them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import softreach as sr
from softreach.arm import designs
from softreach.cli.app import run
from softreach.exchange.activefilaments import (
    gamma_path,
    read_cloud,
    write_cloud,
    write_design,
)
from softreach.support.errors import SoftreachWarning
from tests.exchange.julia import json_of

ROWS = 200


@pytest.fixture(scope="module")
def filament() -> sr.Manipulator:
    return designs.filament()


@pytest.fixture
def tips(tmp_path, filament):
    """NAME.csv of a cloud of the filament; NAME_gamma.csv lies beside it."""
    path = tmp_path / "cloud.csv"
    write_cloud(sr.compute_cloud(filament, n=ROWS, tol=1e-9), path)
    return path


def numbers(path) -> np.ndarray:
    return np.array([line.split(",") for line in path.read_text().splitlines()], float)


@pytest.mark.parametrize(("name", "scale"), [("filament", 1), ("minimal_trunk", 3), ("lce_arm", 1)])
def test_the_files_hold_tips_and_the_sectors_of_the_written_filament(name, scale, tmp_path):
    cloud = sr.compute_cloud(getattr(designs, name)(), n=ROWS)
    path = tmp_path / "cloud.csv"
    write_cloud(cloud, path)
    np.testing.assert_array_equal(numbers(path), cloud.tip)
    np.testing.assert_array_equal(numbers(gamma_path(path)), scale * cloud.activation)
    assert gamma_path(path).name == "cloud_gamma.csv"


@pytest.mark.parametrize("name", ["filament", "redundant_trunk", "lce_arm"])
def test_a_cloud_survives_both_files(name, tmp_path):
    arm = getattr(designs, name)()
    cloud = sr.compute_cloud(arm, n=ROWS)
    write_cloud(cloud, tmp_path / "cloud.csv")
    again = read_cloud(arm, tmp_path / "cloud.csv")
    np.testing.assert_array_equal(again.tip, cloud.tip)
    np.testing.assert_allclose(again.activation, cloud.activation, rtol=1e-15)
    assert again.attrs["largest_tip_difference"] < 2e-6 * arm.length
    assert "seed" not in again.attrs
    sr.save_cloud(again, tmp_path / "cloud.zarr")
    assert sr.cloud.design_of(sr.open_cloud(tmp_path / "cloud.zarr")) == arm


def test_the_largest_difference_of_tips_is_told(tips, filament):
    moved = numbers(tips)
    moved[7] += [0, 3e-3, 4e-3]
    np.savetxt(tips, moved, delimiter=",")
    with pytest.warns(SoftreachWarning, match="differ by up to 0.005 L"):
        cloud = read_cloud(filament, tips)
    assert cloud.attrs["largest_tip_difference"] == pytest.approx(5e-3, rel=1e-3)


def test_activations_outside_of_the_bounds_are_told(tips, filament):
    with pytest.warns(SoftreachWarning, match="leave the bounds"):
        read_cloud(filament.with_bounds((-1.5, 0.0)), tips)


def test_numbers_of_julia_are_read(tmp_path, filament):
    tips = tmp_path / "one.csv"
    tips.write_text("-0.0,1.0e-5,1.0\n")
    gamma_path(tips).write_text("-0.0,0.0,-1.0e-17")
    with pytest.warns(SoftreachWarning):
        assert read_cloud(filament, tips).tip.values.tolist() == [[0.0, 1e-5, 1.0]]


HOSTILE = {
    "header": (b"x,y,z\n1,2,3\n", "x"),
    "ragged": (b"1,2,3\n1,2\n", "columns changed"),
    "words": (b"1,2,3\n1,2,three\n", "'three' in row 2, column 3"),
    "empty": (b"", "no rows"),
    "binary": (b"\xff\xfe\x00\x01\n", "no text"),
    "zeros": (b"\0" * 3000, "x00"),
    "not finite": (b"1,2,3\n1,nan,3\n", "row 2"),
    "infinite": (b"1,2,1e999\n", "row 1"),
    "semicolons": (b"1;2;3\n", "rows of comma-separated numbers"),
    "too few columns": (b"1,2\n", "2 columns: must be 3: x, y, z"),
    "long": (b"9" * 100_000 + b"x", "row 1, column 1"),
}


@pytest.mark.parametrize("name", HOSTILE)
def test_what_is_no_table_of_numbers_is_refused_in_one_short_line(name, tips, filament):
    content, told = HOSTILE[name]
    tips.write_bytes(content)
    with pytest.raises(sr.InvalidInput, match=told) as error:
        read_cloud(filament, tips)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400 + len(str(tips))


@pytest.mark.parametrize(
    ("rows", "told"),
    [
        ("0,0\n" * ROWS, "2 columns: must be 3: the sectors of"),
        ("0,0,0\n", f"1 row: must be {ROWS}"),
    ],
)
def test_activations_of_another_shape_are_refused_with_both_numbers(rows, told, tips, filament):
    gamma_path(tips).write_text(rows)
    with pytest.raises(sr.InvalidInput, match=told):
        read_cloud(filament, tips)


def test_a_missing_half_is_named(tips, filament):
    gamma_path(tips).unlink()
    with pytest.raises(sr.InvalidInput, match=r"cloud_gamma\.csv: must be a file that exists"):
        read_cloud(filament, tips)


def test_a_cloud_of_an_arm_that_is_no_filament_is_refused(tmp_path):
    cloud = sr.compute_cloud(designs.three_chamber_arm(), n=10)
    with pytest.raises(sr.InvalidInput, match=r"ActiveFilaments\.jl"):
        write_cloud(cloud, tmp_path / "cloud.csv")
    assert list(tmp_path.iterdir()) == []


@pytest.fixture
def folder(tmp_path, monkeypatch, filament):
    """An empty folder with a definition and a cloud of the filament."""
    monkeypatch.chdir(tmp_path)
    filament.save("filament.toml")
    write_design(filament, "filament.jl")
    Path("filament.json").write_text(json_of(Path("filament.jl").read_text()))
    sr.save_cloud(sr.compute_cloud(filament, n=ROWS), "cloud.zarr")
    return tmp_path


def test_the_command_line_goes_there_and_back(folder, filament, capsys):
    assert run(["import", "filament.json", "again.toml"]) == 0
    assert run(["export", "again.toml", "again.jl"]) == 0
    assert (folder / "again.jl").read_text() == (folder / "filament.jl").read_text().replace(
        "# sector", "# ring 1"
    )
    assert run(["export", "cloud.zarr", "tips.csv", "--format", "activefilaments"]) == 0
    assert run(["import", "tips.csv", "back.zarr", "--design", "filament.toml"]) == 0
    assert "largest difference of tips" in capsys.readouterr().out
    np.testing.assert_array_equal(
        sr.open_cloud("back.zarr").activation, sr.open_cloud("cloud.zarr").activation
    )


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["import", "nothing.json", "a.toml"], "a file that exists"),
        (["import", "cloud.zarr", "a.toml"], ".json or .csv"),
        (["import", "filament.json", "a.zarr"], "ending in .toml"),
        (["import", "filament.json.csv", "a.zarr"], "--design"),
        (["import", "binary.json", "a.toml"], "text in UTF-8"),
        (["import", "binary.csv", "a.zarr", "--design", "filament.json"], "no text"),
        (["export", "cloud.zarr", "a.csv", "--format", "julia"], "activefilaments"),
        (["export", "cloud.zarr", "a.txt", "--format", "activefilaments"], "ending in .csv"),
        (["export", "filament", "a.csv", "--format", "activefilaments"], "ending in .jl"),
        (["export", "three_chamber_arm", "a.jl"], "FiberArchitecture"),
    ],
)
def test_wrong_input_costs_one_line(arguments, told, folder, capsys):
    for name in ("binary.json", "binary.csv"):
        (folder / name).write_bytes(bytes(range(256)) * 100)
    assert run(arguments) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert told in message
    assert not (folder / arguments[2]).exists()
