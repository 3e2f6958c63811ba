"""What a calibration prints, draws and writes, and its commands."""

import json
import re

import numpy as np
import pandas as pd
import pytest

import softreach as sr
from softreach.cli.app import run
from softreach.support.files.text import write_table
from tests.calibration.arms import MODULUS, hanging_tentacle, measured, on_the_bench

ARM = hanging_tentacle()
FREE = ["--free", f"{MODULUS}_pa,pose.position", "--free", "pose.rotation"]


@pytest.fixture(scope="module")
def result():
    """A calibration with samples held out."""
    return sr.calibrate(ARM, measured(on_the_bench(ARM)), free=[MODULUS, "pose"], hold_out=0.3)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder with a design and measured poses of it."""
    monkeypatch.chdir(tmp_path)
    ARM.save("arm.toml")
    pd.DataFrame(measured(on_the_bench(ARM))).to_csv("poses.csv", index=False)
    return tmp_path


def lines_of(result):
    return {line.split()[0]: line for line in str(result).splitlines()}


def test_numbers_are_shown_to_two_digits_of_their_errors_beside_those_of_the_design(result):
    sigma = result.sigma[MODULUS] / 1e3
    found = re.search(r" ([\d.]+) ± ([\d.]+) kPa +300$", lines_of(result)[MODULUS])
    assert found
    assert float(found[1]) == pytest.approx(result.values[MODULUS] / 1e3, abs=0.06 * sigma)
    assert float(found[2]) == pytest.approx(sigma, rel=0.05)
    assert lines_of(result)["pose.x"].endswith(" mm    0")


def test_errors_held_out_stand_beside_those_of_rivals(result):
    rows = [re.split(r"  +", line.strip()) for line in str(result).splitlines()]
    table = {row[0]: row[1:] for row in rows if len(row) == 6}
    assert table["error of places [mm]"][1:] == ["rms", "median", "95 % below", "rms / L"]
    held = {law: row for law, row in table.items() if row[0] == "6 held out"}
    assert set(held) == {
        "calibrated",
        "design, base fitted",
        "constant curvature, 16 numbers",
        "quadratic ridge, 60 numbers",
    }
    assert float(held["calibrated"][1]) == pytest.approx(1e3 * result.held_out.rms, rel=0.01)


def test_the_table_holds_what_was_measured_and_missed(result, tmp_path):
    write_table(tmp_path / "missed.csv", result.table("mm"), overwrite=False)
    table = pd.read_csv(tmp_path / "missed.csv")
    np.testing.assert_allclose(table["t 2_n"], result.data.inputs[:, 1])
    assert table.held_out.sum() == result.held.sum()
    off = table[[f"tool_predicted_{a}_mm" for a in "xyz"]].to_numpy()
    off = off - table[[f"tool_{a}_mm" for a in "xyz"]].to_numpy()
    np.testing.assert_allclose(np.linalg.norm(off, axis=1), table.tool_error_mm, atol=1e-6)
    np.testing.assert_allclose(off, 1e3 * result.residuals[:, 1], atol=1e-5)


def test_the_report_is_one_page_that_asks_for_nothing(result, tmp_path):
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    path = tmp_path / "report.html"
    result.report().save(path)
    page = path.read_text()
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert "http:" not in page
    assert "https:" not in page
    assert "default-src &#39;none&#39;" in page or "default-src 'none'" in page
    for text in (result.verdict.sentence, result.data.digest, "330", "constant curvature"):
        assert text in page


def test_a_picture_shows_every_marker_and_every_input_that_moves(result):
    pytest.importorskip("matplotlib")
    figure = sr.plot.plot_calibration(result, view="back")
    space = figure.axes[0]
    dots = next(c for c in space.collections if c.get_label() == "measured").get_offsets()
    places = 1e3 * result.data.places.reshape(-1, 3)
    np.testing.assert_allclose(dots, places[:, [0, 2]])
    assert space.xaxis_inverted()
    labels = [ax.get_xlabel() for ax in figure.axes]
    assert labels[2:] == ["sample, in order of time", "t 1 [N]", "t 2 [N]", "t 3 [N]"]
    markers = figure.axes[1]
    assert [text.get_text() for text in markers.get_xticklabels()] == ["half", "tool"]
    assert markers.get_ylabel() == "error [mm]"
    shown = np.concatenate([dots.get_offsets()[:, 1] for dots in markers.collections[:2]])
    np.testing.assert_allclose(
        np.sort(shown), np.sort(1e3 * np.linalg.norm(result.residuals[:, 0], axis=1))
    )


def test_an_outlier_leaves_the_scale_of_a_picture_to_the_others():
    pytest.importorskip("matplotlib")
    data = pd.DataFrame(measured(on_the_bench(ARM), count=30))
    data.loc[5, "tool_x_mm"] += 1000.0
    figure = sr.plot.plot_calibration(sr.calibrate(ARM, data, free=[MODULUS, "pose"], rivals=False))
    assert figure.axes[2].get_ylim()[1] < 100
    assert "1 beyond" in [text.get_text() for text in figure.axes[2].texts]


def test_the_command_writes_what_python_finds(folder, capsys):
    arguments = ["calibrate", "arm.toml", "poses.csv", *FREE, "--no-rivals", "--hold-out", "0.2"]
    assert run([*arguments, "-o", "bench.toml", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    result = sr.calibrate(ARM, "poses.csv", free=[MODULUS, "pose"], hold_out=0.2, rivals=False)
    numbers = {number["number"]: number for number in record["numbers"]}
    assert numbers[MODULUS]["value"] == pytest.approx(result.values[MODULUS])
    assert numbers["pose.rz"]["sigma"] == pytest.approx(np.degrees(result.sigma["pose.rz"]))
    assert numbers["pose.rz"]["unit"] == "deg"
    errors = {(row["law"], row["samples"]): row["rms_m"] for row in record["errors"]}
    assert errors["calibrated", "4 held out"] == pytest.approx(result.held_out.rms)
    bench = sr.Manipulator.load("bench.toml")
    assert bench == result.arm
    again = sr.calibrate(bench, "poses.csv", free=[MODULUS, "pose"], rivals=False)
    assert again.before.rms < 1e-3


def test_the_command_prints_in_the_unit_asked_for(folder, capsys):
    assert run(["calibrate", "arm.toml", "poses.csv", *FREE, "--unit", "cm"]) == 0
    text = capsys.readouterr().out
    assert "error of places [cm]" in text
    assert re.search(r"pose.x +1\.0\d+ ± 0\.\d+ cm", text)


def test_the_command_takes_columns_priors_and_tied_numbers(folder, capsys):
    pd.read_csv("poses.csv").rename(
        columns={"t 1_N": "a_N"} | {f"tool_{a}_mm": f"d3_{a}_mm" for a in "xyz"}
    ).to_csv("odd.csv", index=False)
    arguments = ["calibrate", "arm.toml", "odd.csv", "--free", "pose", "--free", "*.young_modulus"]
    arguments += ["--input", "t 1=a_N", "--marker", "tool=d3", "--no-rivals", "--json"]
    assert run([*arguments, "--prior", f"{MODULUS}=300kPa:1Pa", "--prior", "pose.rz=5deg"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert list(record["markers"]) == ["half", "tool"]
    assert record["numbers"][6]["value"] == pytest.approx(3e5, rel=1e-4)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--free", "rings[0].material.yong_modulus"], "did you mean"),
        (["--free", "pose", "--prior", "pose.x=5"], "a finite number with its unit (m, cm, mm"),
        (["--free", "pose", "--prior", "pose.x"], "NAME=WIDTH or NAME=MEAN:WIDTH"),
        (["--free", "pose", "--prior", "foo=1"], "with the full name of a free number"),
        (["--free", "pose", "--input", "t 1"], "NAME=COLUMN"),
        (["--free", "pose", "--marker", "tool=a", "--marker", "tool=b"], "given once for tool"),
        (["--free", "pose", "--noise", "loud"], "a length > 0 such as 0.2mm"),
        (["--free", "pose", "--table", "poses.csv"], "overwrite"),
    ],
)
def test_what_the_command_cannot_use_costs_one_line(options, said, folder, capsys):
    assert run(["calibrate", "arm.toml", "poses.csv", *options]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    assert said in text
    assert sorted(path.name for path in folder.iterdir()) == ["arm.toml", "poses.csv"]


def test_planned_poses_become_a_calibration(folder, capsys):
    plan = ["plan-poses", "arm.toml", *FREE, "-n", "9", "--candidates", "64", "--noise", "0.2mm"]
    assert run([*plan, "-o", "plan.csv"]) == 0
    text = capsys.readouterr().out
    assert re.search(rf"{re.escape(MODULUS)} +300\.\d+ ± 0\.\d+ kPa +0\.\d+ %", text)
    assert run([*plan, "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    table = pd.read_csv("plan.csv")
    inputs = table[["t_1_N", "t_2_N", "t_3_N"]].to_numpy()
    np.testing.assert_allclose(inputs, record["poses"], rtol=1e-5, atol=1e-9)
    assert record["noise_m"] == 2e-4
    filled = measured(on_the_bench(ARM), inputs=inputs)
    places = {name: values for name, values in filled.items() if name.endswith("_mm")}
    table.assign(**places).to_csv("plan.csv", index=False)
    assert run(["calibrate", "arm.toml", "plan.csv", *FREE, "--no-rivals"]) == 0
    assert "9 samples of half, tool" in capsys.readouterr().out
