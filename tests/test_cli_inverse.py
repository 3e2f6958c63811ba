"""The commands of the exact reachable set and the inverse problem."""

from __future__ import annotations

import json

import numpy as np
import pytest

import softreach as sr
from softreach.cli.app import run


@pytest.fixture(scope="module")
def target(trunk):
    return sr.tip_positions(trunk, [[-0.9, -0.3, -0.6]])[0]


def test_a_target_is_solved_and_the_activations_lead_there(trunk, target, capsys):
    text = ",".join(f"{x:.17g}" for x in target)
    assert run(["solve", "minimal_trunk", f"--target={text}", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)[0]
    assert found["status"] == "reached"
    tips = sr.tip_positions(trunk, found["activations"])
    np.testing.assert_allclose(tips, np.tile(target, (len(tips), 1)), atol=1e-9)


def test_targets_come_from_a_file_with_or_without_a_header(tmp_path, target, capsys):
    row = ",".join(f"{x:.17g}" for x in target)
    for header in ("", "x,y,z\n"):
        path = tmp_path / "targets.csv"
        path.write_text(f"{header}{row}\n2,0,0\n")
        assert run(["solve", "minimal_trunk", "--targets", str(path), "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert [one["status"] for one in found] == ["reached", "unreachable"]
        assert found[1]["gap_m"] > 1


def test_activations_are_told_in_their_units(capsys):
    assert run(["solve", "three_tendon_robot", "--target=0,0,1"]) == 0
    assert capsys.readouterr().out.count(" N") == 3


def test_a_family_that_is_smaller_than_asked_says_so(capsys):
    arm = sr.designs.redundant_trunk()
    text = ",".join(f"{x:.17g}" for x in sr.tip_positions(arm, arm.bounds[:, 0])[0])
    assert run(["solve", "redundant_trunk", f"--target={text}", "--family", "3"]) == 0
    assert "no others found: further searches end at this one" in capsys.readouterr().out


def test_a_path_is_tracked_into_a_file(tmp_path, trunk, capsys):
    gamma = np.linspace([-0.9, -0.3, -0.6], [-0.5, -0.8, -0.7], 5)
    points = sr.tip_positions(trunk, gamma)
    np.savetxt(tmp_path / "path.csv", points, delimiter=",", header="x,y,z", comments="")
    out = tmp_path / "activations.csv"
    assert run(["track", "minimal_trunk", str(tmp_path / "path.csv"), "--out", str(out)]) == 0
    assert "5 of 5 points followed" in capsys.readouterr().out
    found = np.loadtxt(out, delimiter=",", skiprows=1)[:, :3]
    np.testing.assert_allclose(sr.tip_positions(trunk, found), points, atol=1e-8)


def test_a_path_says_that_the_arm_snaps(tmp_path, capsys, monkeypatch):
    import xarray as xr

    ended = xr.Dataset(
        {
            "activation": (("point", "bundle"), [[0.0, 0.0, 0.0], [np.nan] * 3]),
            "tip_error": ("point", [0.0, np.nan]),
            "status": ("point", [0, 4]),
            "end_length": ((), 0.25),
            "end_length_error": ((), 1e-8),
        },
        attrs={"end": "snaps", "end_bundle": "", "end_bound": ""},
    )
    monkeypatch.setattr(sr, "track_path", lambda *_: ended)
    (tmp_path / "path.csv").write_text("x,y,z\n0,0,1\n0,0,0.5\n")
    out = tmp_path / "activations.csv"
    assert run(["track", "minimal_trunk", str(tmp_path / "path.csv"), "--out", str(out)]) == 0
    assert "1 of 2 points followed, up to 0.25 m of path" in (said := capsys.readouterr().out)
    assert "where the arm snaps" in said


def test_the_reachable_set_is_reported_drawn_and_written(tmp_path, capsys):
    surface, figure = tmp_path / "reach.ply", tmp_path / "reach.png"
    arguments = ["reach", "minimal_trunk", "--accuracy", "0.02", "--json"]
    assert run([*arguments, "-o", str(surface), "--out", str(figure)]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["volume_L3"] == pytest.approx(0.691, abs=0.002)
    assert 0 < found["unreachability"] < 1
    assert surface.stat().st_size > 10_000
    assert figure.stat().st_size > 10_000
