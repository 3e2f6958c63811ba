"""Options that change a design, the same on every command that takes one."""

from __future__ import annotations

import json
import math

import pytest

import softreach as sr
from softreach.arm.parameters import changed
from softreach.cli.app import app, run
from softreach.cli.changes import Changes

pytestmark = pytest.mark.filterwarnings("always::softreach.support.errors.SoftreachWarning")

OPTIONS = (
    "--base",
    "--payload",
    "--gravity",
    "--tip-force",
    "--set",
    "--taper-deg",
    "--revolution-deg",
)
TAKE_ONE_DESIGN = ("design", "cloud", "volume", "reach", "solve", "track", "show", "export")
HEAVY = ("rings[0].material.young_modulus=1MPa", "rings[0].material.density=1000kg/m3")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """An empty folder to work in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def saved(folder, *arguments):
    """The design that `softreach design ... --out` writes."""
    assert run(["design", *arguments, "--out", "a.toml"]) == 0
    return sr.Manipulator.load("a.toml")


@pytest.mark.parametrize("command", TAKE_ONE_DESIGN)
def test_every_command_that_takes_a_design_offers_to_change_it(command, capsys):
    assert run([command, "--help"]) == 0
    text = capsys.readouterr().out
    assert all(f"{option} " in text for option in OPTIONS)
    assert "in the world, whose +z points up" in " ".join(text.replace("│", "").split())


@pytest.mark.parametrize(
    ("options", "loads"),
    [
        (["--payload", "2g"], {"payload": 0.002}),
        (["--payload", "2e-3 kg", "--gravity", "down"], {"payload": 0.002}),
        (["--gravity", "upright"], {}),
        (["--gravity", "up"], {"gravity": (0, 0, 9.81)}),
        (["--gravity", "hanging"], {"gravity": (0, 0, 9.81)}),
        (["--gravity", "sideways"], {"gravity": (9.81, 0, 0)}),
        (["--gravity", "-1.62,0,0.5"], {"gravity": (-1.62, 0, 0.5)}),
        (["--gravity", "0, 0, -1.62 m/s2"], {"gravity": (0, 0, -1.62)}),
        (
            ["--gravity", "none", "--tip-force", "-5,0,2.5mN"],
            {"gravity": (0, 0, 0), "tip_force": (-0.005, 0, 0.0025)},
        ),
        (["--tip-force=0,0,-0.01"], {"tip_force": (0, 0, -0.01)}),
        (["--set", "loads.payload=2g"], {"payload": 0.002}),
        (["--set", "loads.payload_kg=0.002"], {"payload": 0.002}),
        (
            ["--set", "loads.tip_moment[1]=3N mm", "--payload", "1g"],
            {"tip_moment": (0, 0.003, 0), "payload": 0.001},
        ),
    ],
)
def test_loads_are_those_of_the_library(options, loads, folder):
    expected = sr.designs.lce_arm().replace(loads=sr.Loads(**loads))
    assert saved(folder, "lce_arm", *options) == expected


def test_options_change_the_loads_that_a_design_has(folder):
    loads = sr.Loads(gravity=(0, 0, 9.81), payload=0.001)
    sr.designs.lce_arm().replace(loads=loads).save("loaded.toml")
    made = saved(folder, "loaded.toml", "--payload", "3g")
    assert made.loads == loads.replace(payload=0.003)
    bare = saved(folder, "loaded.toml", "--payload", "0g", "--gravity", "none")
    assert bare == sr.designs.lce_arm()


@pytest.mark.parametrize(
    ("options", "values"),
    [
        (["--set", "taper=1deg"], {"taper": math.radians(1)}),
        (["--set", "taper=0.01rad"], {"taper": 0.01}),
        (["--set", "taper_deg=1"], {"taper": math.radians(1)}),
        (
            ["--set", "length=80cm", "--set", "left.offset_deg=30"],
            {"length": 0.8, "left.offset": math.radians(30)},
        ),
        (
            ["--set", "left.lower=-2", "--taper-deg", "1"],
            {"left.lower": -2, "taper": math.radians(1)},
        ),
        (["--set", "radius_ratio = 0.5"], {"radius_ratio": 0.5}),
    ],
)
def test_settings_are_parameters_of_the_library(options, values, folder):
    assert saved(folder, "minimal_trunk", *options) == changed(sr.designs.minimal_trunk(), values)


def test_moduli_and_densities_may_come_with_the_loads_that_need_them(folder):
    settings = [word for text in HEAVY for word in ("--set", text)]
    made = saved(folder, "minimal_trunk", "--payload", "200g", *settings)
    material = made.section.rings[0].material
    assert (material.young_modulus, material.density) == (1e6, 1000.0)
    assert made.loads == sr.Loads(payload=0.2)


@pytest.mark.parametrize(
    ("word", "points"),
    [("hanging", "down"), ("upright", "up"), ("down", "down"), ("x", "x"), ("-y", "-y")],
)
def test_the_base_points_the_way_that_is_said(folder, word, points):
    assert saved(folder, "minimal_trunk", "--base", word).base == sr.Base(points=points)


def test_the_place_and_the_turn_of_a_file_stay(folder):
    base = sr.Base(position=(0, 0, 2), points="x", turn=0.3)
    sr.designs.minimal_trunk().replace(base=base).save("posed.toml")
    made = saved(folder, "posed.toml", "--base", "hanging", "--set", "base.turn=0.4rad")
    assert made.base == base.replace(points="down", turn=0.4)


def test_gravity_down_beside_a_hanging_base_pulls_along_the_arm(folder, capsys):
    made = saved(folder, "lce_arm", "--base", "hanging", "--gravity", "down")
    assert (made.base.points, made.loads) == ("down", sr.Loads())
    assert run(["design", "lce_arm", "--base", "hanging", "--gravity", "down", "--json"]) == 0
    *_, last = capsys.readouterr().out.splitlines()
    assert json.loads(last)["base"] == "hanging: points down"


def test_a_place_below_a_hanging_arm_is_reached(capsys):
    place = ["minimal_trunk", "--target", "0.2,0.1,-0.6"]
    assert run(["solve", *place, "--base", "hanging"]) == 0
    assert "reached" in capsys.readouterr().out.splitlines()[0]
    assert run(["solve", *place]) == 0
    assert "unreachable" in capsys.readouterr().out.splitlines()[0]


def test_a_loaded_cloud_counts_its_stable_samples(folder, capsys):
    options = ["--n", "64", "--payload", "2g", "--gravity", "hanging", "--json"]
    assert run(["cloud", "lce_arm", *options]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["stable"], facts["unstable"], facts["no_equilibrium"]) == (64, 0, 0)
    assert (facts["payload_kg"], facts["base"]) == (0.002, "hanging")
    arm = sr.designs.lce_arm().replace(loads=sr.Loads(gravity=(0, 0, 9.81), payload=0.002))
    assert sr.open_cloud("lce_arm.zarr").identical(sr.compute_cloud(arm, 64))


class TestRestInTheSummary:
    def facts(self, capsys, *arguments):
        assert run(["design", *arguments, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    def test_a_loaded_arm_has_its_sag_in_l_and_m(self, capsys):
        arm = sr.designs.lce_arm().replace(loads=sr.Loads(gravity=(9.81, 0, 0), payload=0.001))
        facts = self.facts(capsys, "lce_arm", "--gravity", "sideways", "--payload", "1g")
        known = sr.rest.rest(arm)
        assert facts["sag_at_rest_L"] == known.sag_over_length
        assert facts["sag_at_rest_m"] == known.sag
        assert facts["at_rest"] == "stable"

    def test_an_arm_that_cannot_stand_is_said_not_to_be_stable(self, capsys):
        assert self.facts(capsys, "lce_arm", "--payload", "50g")["at_rest"] == "not stable"

    def test_an_arm_too_heavy_to_be_followed_is_still_described(self, capsys):
        facts = self.facts(capsys, "lce_arm", "--gravity", "sideways", "--payload", "100kg")
        assert facts["at_rest"] == "unknown: the loads are too large"
        assert facts["sag_at_rest_L"] is None

    def test_an_arm_without_loads_is_judged_by_its_own_weight(self, capsys):
        facts = self.facts(capsys, "lce_arm")
        held = sr.designs.lce_arm().replace(loads=sr.Loads(gravity=(9.81, 0, 0)))
        assert facts["sag_at_rest_sideways_L"] == sr.rest.rest(held).sag_over_length
        assert facts["at_rest_upright"] == "stable"

    def test_nothing_is_said_where_moduli_are_not_known(self, capsys):
        assert not any("rest" in name for name in self.facts(capsys, "minimal_trunk"))

    def test_loads_beyond_the_verified_ones_are_warned_of_once(self, capsys, tmp_path):
        assert run(["design", "lce_arm", "--payload", "100g"]) == 0
        assert capsys.readouterr().err.count("load number is") == 1
        out = ["--out", str(tmp_path / "a.zarr")]
        assert run(["cloud", "lce_arm", "--payload", "100g", "--n", "8", *out]) == 0
        assert capsys.readouterr().err.count("load number is above 12") == 1


@pytest.mark.parametrize(
    ("options", "lacking"),
    [
        (["--payload", "200g"], ("young_modulus", "density")),
        (["--tip-force", "0,0,1N", "--gravity", "none"], ("young_modulus",)),
        (["--gravity", "up", "--set", HEAVY[0]], ("density",)),
        (["--set", "loads.payload=1g"], ("young_modulus", "density")),
    ],
)
def test_loads_ask_in_one_line_for_what_the_arm_lacks(options, lacking, capsys):
    assert run(["design", "minimal_trunk", *options]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    asked = text.partition("must be on an arm with ")[2].partition(";")[0]
    assert asked == " and ".join(f"rings[0].material.{name}" for name in lacking)
    assert all(f"--set rings[0].material.{name}=" in text for name in lacking)


def test_no_gravity_on_an_arm_without_loads_changes_nothing(folder):
    assert saved(folder, "minimal_trunk", "--gravity", "none") == sr.designs.minimal_trunk()


def test_every_change_has_an_option(capsys):
    """No field of the changes is forgotten in what a stored cloud refuses."""
    every = Changes(
        base="up",
        revolution_deg=1.0,
        taper_deg=1.0,
        payload="1g",
        gravity="up",
        tip_force="0",
        settings=["a=1"],
    )
    assert len(every.given) == len(vars(every))
    _, bound, *_ = app.parse_args(["design", "x", "--set", "a=1", "--set", "b=2"])
    assert bound.arguments["changes"].settings == ["a=1", "b=2"]
