"""Laws of what a check shows: the command, its exit codes, the picture."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import softreach as sr
from softreach.cli.app import run
from softreach.requirements import Keep, Requirements, Sphere, Target

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def needs(tmp_path, monkeypatch):
    """A file of requirements that the trunk meets."""
    monkeypatch.chdir(tmp_path)
    arm = sr.designs.minimal_trunk()
    tip = sr.tip_positions(arm, [[-0.5, -0.4, -0.3]])
    Requirements(targets=[Target(tip, name="shelf")]).save("needs.toml")
    return "needs.toml"


def test_the_exit_code_says_met_missed_undecided_or_wrong(needs, capsys):
    assert run(["check", "minimal_trunk", needs]) == 0
    assert "met     shelf  1 place reached" in capsys.readouterr().out
    Path("far.toml").write_text("[[reach]]\nplaces_m = [[2.0, 0, 0]]\n")
    assert run(["check", "minimal_trunk", "far.toml", "--unit", "mm"]) == 1
    assert "place 1 at (2000, 0, 0) mm is missed by" in capsys.readouterr().out
    Path("half.toml").write_text("[measures]\nconvex_volume = { at_least = 1.00477 }\n")
    assert run(["check", "minimal_trunk", "half.toml"]) == 3
    assert "UNDECIDED  convex_volume" in capsys.readouterr().out
    assert run(["check", "minimal_trunk", "none.toml"]) == 2
    Path("bad.toml").write_text("[[reach]]\nplaces = 3\n[limit]\n")
    assert run(["check", "minimal_trunk", "bad.toml"]) == 2
    assert "bad.toml: 2 problems" in capsys.readouterr().err
    assert run(["check", "minimal_trunk", needs, "--view", "front"]) == 2


def test_json_holds_every_finding_and_a_picture_is_written(needs, capsys):
    pytest.importorskip("matplotlib")
    assert run(["check", "minimal_trunk", needs, "--json", "--out", "check.png"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["met"] is True
    assert record["findings"][0]["kind"] == "reach"
    assert len(record["poses"][0][0]) == 3
    assert Path("check.png").read_bytes()[:4] == b"\x89PNG"


def test_the_report_holds_every_finding(tmp_path):
    pytest.importorskip("matplotlib")
    pytest.importorskip("jinja2")
    needs = Requirements(targets=[Target([[2.0, 0, 0]], name="<shelf>"), Target([[0, 0, 1.0]])])
    check = sr.check(sr.designs.minimal_trunk(), needs)
    check.report().save(tmp_path / "check.html")
    page = (tmp_path / "check.html").read_text()
    assert '<td class="missed">MISSED</td><td>&lt;shelf&gt;</td>' in page
    assert all(finding.name in str(check) for finding in check.findings)
    assert page.count("<td>") == 2 * len(check.findings) + 1
    assert page.count("data:image/png") == 1


def test_lengths_of_a_file_may_be_in_L_of_the_design(needs, capsys):
    Path("straight.toml").write_text('[[reach]]\nplaces = [["0L", "0L", "1L"]]\n')
    assert run(["check", "lce_arm", "straight.toml"]) == 0


def test_the_example_of_five_places_is_met():
    arm = sr.Manipulator.load(EXAMPLES / "three_fibers.toml")
    check = sr.check(arm, Requirements.load(EXAMPLES / "five_places.toml"))
    assert check.met
    assert check.gaps.shape == (2, 5)


def test_reached_and_missed_places_differ_by_their_markers_and_gaps_are_lines():
    pytest.importorskip("matplotlib.pyplot")
    arm = sr.designs.minimal_trunk()
    tips = sr.tip_positions(arm, [[-0.5, -0.4, -0.3], [-0.1, -0.2, -0.9]])
    places = np.concatenate([tips, [[0.0, 0.0, 1.2]]])
    needs = Requirements(targets=[Target(places)], keeps=[Keep(Sphere((0.6, 0, 0.6), 0.1), False)])
    check = sr.check(arm, needs)
    lines = sr.plot.plot_check(check, view="front", unit="m").lines
    dots, crosses = (next(x for x in lines if x.get_marker() == m) for m in ("o", "X"))
    np.testing.assert_allclose(dots.get_xydata(), tips[:, [0, 2]], atol=1e-9)
    np.testing.assert_allclose(crosses.get_xydata(), [[0.0, 1.2]], atol=1e-12)
    (gap,) = [line for line in lines if line.get_label() == "gap"]
    ends = np.array([places[2], check.nearest[0, 2]])[:, [0, 2]]
    np.testing.assert_allclose(gap.get_xydata(), ends, atol=1e-12)
