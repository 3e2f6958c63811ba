"""The command line: what it prints, what it refuses, what its exit codes mean."""

import json
import math
import os
import re
import subprocess
import sys

import numpy as np
import pytest

import softreach as sr
from softreach.arm.parameters import changed
from softreach.cli.app import MODULES, app, run
from softreach.cli.console import console
from softreach.cli.options import design_from
from softreach.rod.summary import describe

# Few samples make the α-shape too fine; the command line prints that and goes on.
pytestmark = pytest.mark.filterwarnings("always::softreach.support.errors.SoftreachWarning")

COMMANDS = [name for name in app if not name.startswith("-")]
HEAVY = {"numba", "scipy", "xarray", "matplotlib", "zarr", "pandas", "pydantic"}


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    path = tmp_path_factory.mktemp("clouds") / "trunk.zarr"
    sr.save_cloud(sr.compute_cloud(sr.designs.minimal_trunk(), n=3_000, seed=1), path)
    return str(path)


@pytest.mark.parametrize("command", COMMANDS)
def test_help_of_every_command_teaches_with_an_example_that_parses(command, capsys):
    assert run([command, "--help"]) == 0
    text = capsys.readouterr().out
    example = text.partition("Example: softreach ")[2].partition("\n\n")[0]
    words = example.split()
    assert words[0] == command
    function, bound, *_ = app.parse_args(words, exit_on_error=False, print_error=False)
    assert function.__module__ == f"softreach.cli.{MODULES[command]}"
    assert bound.arguments


@pytest.mark.parametrize("words", [[], ["-h"], ["--help"], ["-q"]], ids=" ".join)
def test_help_lists_every_command_with_what_it_does(words):
    command = [sys.executable, "-m", "softreach", *words]  # nothing is imported before
    wide = os.environ | {"COLUMNS": "100"}
    text = subprocess.run(command, env=wide, capture_output=True, text=True, check=True).stdout
    for name in COMMANDS:
        function = app[name].default_command
        summary = (function.__doc__ if function else app[name].help).partition("\n")[0]
        assert re.search(rf" {name} +{re.escape(summary)} ", text)


def test_help_has_its_groups_in_order(capsys):
    assert run(["--help"]) == 0
    titles = re.findall(r"╭─ (\w+) ─", capsys.readouterr().out)
    groups = "Start Design Reach Places Families Bench Reference About"
    assert titles == groups.split()


def test_the_version_is_that_of_the_package(capsys):
    from importlib.metadata import version

    assert run(["--version"]) == 0
    assert capsys.readouterr().out.strip() == version("softreach")


@pytest.mark.parametrize(
    "code",
    [
        "import softreach",
        "from softreach.cli.app import run; run(['--help'])",
        "from softreach.cli.app import run; run(['nonsense'])",
        "import softreach as sr; arm = sr.designs.lce_arm(); arm.from_toml(arm.to_toml())",
    ],
)
def test_importing_and_helping_load_no_heavy_library(code):
    script = f"{code}\nimport sys; print(*sys.modules, file=sys.stderr)"
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    loaded = {name.partition(".")[0] for name in done.stderr.split()}
    assert not HEAVY & loaded


class TestDesign:
    def test_what_is_printed_follows_from_the_design(self, printed):
        facts = printed("design", "minimal_trunk", "--set", "taper=3deg")
        arm = sr.designs.minimal_trunk(taper=np.radians(3))
        known = describe(arm)
        assert facts["bundles"] == 3
        assert facts["bundle_names"] == list(arm.bundle_names)
        np.testing.assert_allclose(facts["helical_angle_deg"], np.degrees(known.helical_angles))
        np.testing.assert_allclose(facts["revolution_deg"], [-108, 108, 0])
        assert facts["outer_radius_at_tip_m"] == pytest.approx(arm.profile.radius(arm.length))
        assert any("|γ| = 1.67" in warning for warning in facts["warnings"])

    def test_stiffness_weight_and_ranges_are_those_of_the_library(self, folder, printed):
        rubber = sr.Material(young_modulus=1e5, density=1000.0)
        trunk = sr.designs.minimal_trunk()
        ring = trunk.section.rings[0].replace(material=rubber)
        arm = trunk.replace(section=trunk.section.replace(rings=(ring,)))
        arm.save("rubber.toml")
        facts, known = printed("design", "rubber.toml"), describe(arm)
        assert facts["K1_at_base_and_tip_n_m2"] == known.stiffness.bending.tolist()
        assert facts["mass_kg"] == known.mass
        assert facts["load_number"] == known.load_number
        assert facts["lacking"] == []
        assert [one["name"] for one in facts["activations"]] == list(arm.bundle_names)
        ranges = [one["bending_times_R2"] for one in facts["activations"]]
        assert ranges == known.bundle_bending.tolist()

    def test_warnings_are_apart_unknowns_asked_for_and_ends_of_linear_laws_on_demand(self, capsys):
        assert run(["design", "minimal_trunk"]) == 0
        text, warnings = capsys.readouterr()
        assert warnings.startswith("warning: activations reach |γ| = 1.67")
        assert "-108, 108, 0 deg" in text
        assert "mass  " not in text
        assert "give the density [kg/m³] of rings[0].material to know the mass" in text
        assert "exact to first order" not in text
        assert run(["design", "minimal_trunk", "--verbose"]) == 0
        assert "fiber: The law is exact to first order" in capsys.readouterr().out

    @pytest.mark.parametrize("robot", ["helical_tendon_robot", "three_tendon_robot"])
    @pytest.mark.parametrize(
        "command", ["solve {} --target 0,0,0.1", "reach {} --accuracy 0.3", "cloud {} -n 9 --out c"]
    )
    def test_what_the_linear_law_misses_is_one_line(self, command, robot, folder, capsys):
        run(command.format(robot).split())
        err, said = capsys.readouterr().err, robot.startswith("helical")
        assert err.count("tips are off by up to about") == said
        assert ("L) within the bounds" in err) == said

    def test_a_saved_design_is_the_varied_one(self, folder, printed):
        assert (
            run(["design", "redundant_trunk", "--set", "revolution_deg=60", "--out", "a.toml"]) == 0
        )
        assert sr.Manipulator.load("a.toml") == changed(
            sr.designs.redundant_trunk(), {"revolution": np.radians(60)}
        )
        facts = printed("design", "a.toml")
        np.testing.assert_allclose(facts["revolution_deg"], [-60, 60, 0, 0])


class TestCloud:
    def test_the_cloud_on_disk_is_that_of_the_library(self, folder, printed):
        options = ["--n", "512", "--seed", "3", "--sampler", "sobol", "--out", "a.zarr"]
        facts = printed("cloud", "minimal_trunk", *options, "--set", "taper_deg=1")
        arm = changed(sr.designs.minimal_trunk(), {"taper": np.radians(1)})
        cloud = sr.open_cloud("a.zarr")
        assert cloud.identical(sr.compute_cloud(arm, 512, seed=3, sampler="sobol"))
        assert facts["samples"] == 512
        assert facts["highest_tip_L"] == pytest.approx(float(cloud.tip[:, 2].max()))

    def test_a_cloud_is_named_after_its_design_and_replaces_none_unless_asked(self, folder, capsys):
        again = ["cloud", "minimal_trunk", "--n", "40"]
        assert run(["cloud", "minimal_trunk", "--n", "50"]) == 0
        assert run(again) == 2
        assert "choose another name, or pass --overwrite" in capsys.readouterr().err
        assert sr.open_cloud("minimal_trunk.zarr").sizes["sample"] == 50
        assert run([*again, "--overwrite"]) == 0
        assert sr.open_cloud("minimal_trunk.zarr").sizes["sample"] == 40
        assert [path.name for path in folder.iterdir()] == ["minimal_trunk.zarr"]


class TestVolume:
    def test_volumes_are_those_of_the_library(self, stored, printed):
        facts = printed("volume", stored, "--alpha", "0.4L")
        tip = sr.open_cloud(stored).tip
        hull, convex = sr.concave_hull(tip, 0.4, bias=True), sr.convex_hull(tip)
        assert facts["points"] == 3_000
        assert facts["alpha_L"] == 0.4
        assert facts["volume_L3"] == pytest.approx(hull.volume)
        assert facts["convex_volume_L3"] == pytest.approx(convex.volume)
        assert facts["unreachability"] == pytest.approx(1 - hull.volume / convex.volume)
        corrected = facts["volume_without_sampling_bias_estimate_L3"]
        assert corrected == pytest.approx(hull.volume_corrected)

    @pytest.mark.parametrize(("alpha", "radius"), [("0.3L", 0.3), ("0.3", 0.15)])
    def test_a_radius_is_in_meters_or_in_l(self, alpha, radius, folder, printed):
        sr.designs.minimal_trunk(length=2.0).save("long.toml")
        options = ("--alpha", alpha, "--n", "1000")
        assert printed("volume", "long.toml", *options)["alpha_L"] == radius

    def test_the_critical_radius_leaves_one_region(self, stored, printed):
        assert printed("volume", stored, "--alpha", "critical")["regions"] == 1

    def test_too_fine_a_radius_is_warned_of_and_the_estimate_withheld(self, stored, capsys):
        assert run(["volume", stored, "--alpha", "0.08L"]) == 0
        streams = capsys.readouterr()
        assert "warning: alpha = 0.08 m is" in streams.err
        assert "use more points or a larger alpha" in streams.err
        assert "Traceback" not in streams.err
        assert streams.out.splitlines()[7].endswith("(estimate)  -")


class TestReach:
    ARM = ("reach", "three_tendon_robot", "--accuracy", "0.2")  # its set misses the plane z = 0

    def test_what_was_computed_is_printed_and_saved_before_a_picture_fails(
        self, folder, capsys, monkeypatch
    ):
        def failing(*_, **__):
            raise sr.InvalidInput("grid", "empty", "drawn")

        monkeypatch.setattr("softreach.plot.plot_slices", failing)
        outs = ["--out", "a.png", "--out", "a.ply"]
        assert run([*self.ARM, *outs]) == 2
        streams = capsys.readouterr()
        assert "volume" in streams.out
        assert "grid = empty: must be drawn" in streams.err
        assert [path.name for path in folder.iterdir()] == ["a.ply"]


def test_a_picture_is_where_it_says_and_a_cloud_goes_out_by_suffix(stored, folder, capsys):
    pytest.importorskip("matplotlib.pyplot")
    options = ["--color", "longitudinal", "--activation=-1,0,-0.5"]
    assert run(["show", stored, "--out", "a.pdf", *options]) == 0
    assert (folder / "a.pdf").stat().st_size > 10_000
    assert run(["export", stored, "cloud.npz"]) == 0
    assert capsys.readouterr().out == "a.pdf\ncloud.npz\n"
    with np.load("cloud.npz") as table:
        np.testing.assert_array_equal(table["tip"], sr.open_cloud(stored).tip)


def test_the_demo_writes_every_file_it_names(folder, printed):
    pytest.importorskip("matplotlib.pyplot")
    pytest.importorskip("trimesh")
    facts = printed("demo", "--out", "results", "--n", "4000")
    names = {"design.toml", "cloud.zarr", "cloud.ply", "hull.ply", "cloud.png"}
    assert {path.name for path in (folder / "results").iterdir()} == names
    assert {*facts["written"]} == {f"results/{name}" for name in names}
    assert facts["points"] == 4000
    assert sr.Manipulator.load("results/design.toml") == sr.designs.minimal_trunk()
    assert sr.open_cloud("results/cloud.zarr").sizes["sample"] == 4000


def test_text_that_is_no_toml_is_refused_with_its_line(folder, capsys):
    (folder / "bad.toml").write_text("length_m = = 1\n")
    assert run(["design", "bad.toml"]) == 2
    assert "at line 1" in capsys.readouterr().err


def strict_json(text):
    """What JSON for machines holds; NaN and Infinity are none."""

    def refused(word):
        raise AssertionError(word)

    return json.loads(text, parse_constant=refused)


def test_json_has_null_where_there_is_no_number(capsys):
    nothing = (math.nan, math.inf, -math.inf)
    with console.listening():
        console.rows("", {"gap": (math.nan, "m"), "bounds": (nothing, "")}, as_json=True)
    assert strict_json(capsys.readouterr().out) == {"gap_m": None, "bounds": [None] * 3}
    assert run(["list", "parameters", "minimal_trunk", "--json"]) == 0
    records = {one["parameter"]: one for one in strict_json(capsys.readouterr().out)}
    assert records["rings[0].material.young_modulus_pa"]["value"] is None


class TestList:
    def test_the_names_are_those_of_the_library(self, capsys, printed):
        from softreach.arm.section import material_names
        from softreach.atlas.metrics import METRIC_GROUPS

        metrics = (metric.name for group in METRIC_GROUPS.values() for metric in group)
        known = {"designs": sr.designs.__all__, "materials": material_names(), "metrics": metrics}
        for kind, names in known.items():
            records = printed("list", kind)
            assert run(["list", kind]) == 0
            lines = capsys.readouterr().out.splitlines()[1:]
            assert [next(iter(record.values())) for record in records] == (names := [*names])
            assert [line.split()[0] for line in lines] == names

    def test_every_listed_parameter_can_be_set_to_its_value(self, capsys, printed):
        records = printed("list", "parameters", "lce_arm", "--payload", "2g")
        words = [
            word
            for one in records
            if "." in one["parameter"] and "helical_angle" not in one["parameter"]  # or revolution
            for word in ("--set", f"{one['parameter']}={one['value']!r}")
        ]
        assert run(["list", "parameters", "lce_arm", "--payload", "2g"]) == 0
        plain = capsys.readouterr().out
        assert "loads.payload_kg" in plain
        assert run(["list", "parameters", "lce_arm", *words]) == 0
        assert capsys.readouterr().out == plain


def test_a_quiet_command_prints_results_only(stored, capsys):
    command = ["volume", stored, "--alpha", "0.08L"]
    assert run(command) == 0
    loud = capsys.readouterr()
    assert "warning: " in loud.err
    assert run([*command, "-q"]) == 0
    quiet = capsys.readouterr()
    assert (quiet.err, quiet.out) == ("", loud.out)
    assert run(command) == 0
    assert capsys.readouterr().err == loud.err


def test_a_verbose_command_says_where_an_error_comes_from(capsys):
    assert run(["-v", "design", "nowhere.toml"]) == 2
    text = capsys.readouterr().err
    assert "Traceback" in text
    assert text.endswith("error: design = nowhere.toml: must be a file that exists\n")


# Options that change a design, the same on every command that takes one


NUMBERS = ("rings[0].material.young_modulus=1MPa", "rings[0].material.density=1000kg/m3")


def asked_for(*arguments):
    _, bound, *_ = app.parse_args(["design", *arguments], exit_on_error=False, print_error=False)
    return design_from(*bound.args, **bound.kwargs)


@pytest.mark.parametrize(
    ("options", "loads"),
    [
        (["--gravity", "0, 0, -1.62 m/s2"], {"gravity": (0, 0, -1.62)}),
        (
            ["--gravity", "none", "--tip-force", "-5,0,2.5mN"],
            {"gravity": (0, 0, 0), "tip_force": (-0.005, 0, 0.0025)},
        ),
        (
            ["--set", "loads.tip_moment[1]=3N mm", "--payload", "1g"],
            {"tip_moment": (0, 0.003, 0), "payload": 0.001},
        ),
    ],
)
def test_loads_are_those_of_the_library(options, loads, folder):
    expected = sr.designs.lce_arm().replace(loads=sr.Loads(**loads))
    assert asked_for("lce_arm", *options) == expected


def test_options_change_the_loads_that_a_design_has(folder):
    loads = sr.Loads(gravity=(0, 0, 9.81), payload=0.001)
    sr.designs.lce_arm().replace(loads=loads).save("loaded.toml")
    made = asked_for("loaded.toml", "--payload", "3g")
    assert made.loads == loads.replace(payload=0.003)
    bare = asked_for("loaded.toml", "--payload", "0g", "--gravity", "none")
    assert bare == sr.designs.lce_arm()
    assert asked_for("lce_arm", "--gravity", "none") == bare


@pytest.mark.parametrize(
    ("options", "values"),
    [
        (["--set", "taper=1deg"], {"taper": math.radians(1)}),
        (
            ["--set", "length=80cm", "--set", "left.offset_deg=30"],
            {"length": 0.8, "left.offset": math.radians(30)},
        ),
        (
            ["--set", "left.lower=-2", "--set", "taper_deg=1"],
            {"left.lower": -2, "taper": math.radians(1)},
        ),
    ],
)
def test_settings_are_parameters_of_the_library(options, values, folder):
    assert asked_for("minimal_trunk", *options) == changed(sr.designs.minimal_trunk(), values)


def test_moduli_and_densities_may_come_with_the_loads_that_need_them(folder):
    settings = [word for text in NUMBERS for word in ("--set", text)]
    made = asked_for("minimal_trunk", "--payload", "200g", *settings)
    material = made.section.rings[0].material
    assert (material.young_modulus, material.density) == (1e6, 1000.0)
    assert made.loads == sr.Loads(payload=0.2)


@pytest.mark.parametrize(
    ("word", "points"),
    [("up", "up"), ("down", "down"), ("x", "x"), ("-y", "-y")],
)
def test_the_base_points_the_way_that_is_said(folder, word, points):
    assert asked_for("minimal_trunk", "--base", word).base == sr.Base(points=points)


def test_the_place_and_the_turn_of_a_file_stay(folder):
    base = sr.Base(position=(0, 0, 2), points="x", turn=0.3)
    sr.designs.minimal_trunk().replace(base=base).save("posed.toml")
    made = asked_for("posed.toml", "--base", "down", "--set", "base.turn=0.4rad")
    assert made.base == base.replace(points="down", turn=0.4)


def test_gravity_down_beside_a_hanging_base_pulls_along_the_arm(printed):
    made = asked_for("lce_arm", "--base", "down", "--gravity", "down")
    assert (made.base.points, made.loads) == ("down", sr.Loads())
    facts = printed("design", "lce_arm", "--base", "down", "--gravity", "down")
    assert facts["base"] == "hanging: points down"


def test_a_loaded_cloud_counts_its_stable_samples(folder, printed):
    facts = printed("cloud", "lce_arm", "--n", "64", "--payload", "2g", "--gravity", "up")
    assert (facts["stable"], facts["unstable"], facts["no_equilibrium"]) == (64, 0, 0)
    assert (facts["payload_kg"], facts["base"]) == (0.002, "hanging")
    arm = sr.designs.lce_arm().replace(loads=sr.Loads(gravity=(0, 0, 9.81), payload=0.002))
    assert sr.open_cloud("lce_arm.zarr").identical(sr.compute_cloud(arm, 64))


class TestRestInTheSummary:
    def test_a_loaded_arm_has_its_sag_in_l_and_m(self, printed):
        arm = sr.designs.lce_arm().replace(loads=sr.Loads(gravity=(9.81, 0, 0), payload=0.001))
        facts = printed("design", "lce_arm", "--gravity", "sideways", "--payload", "1g")
        known = sr.rest.rest(arm)
        assert facts["sag_at_rest_L"] == known.sag_over_length
        assert facts["sag_at_rest_m"] == known.sag
        assert facts["at_rest"] == "stable"

    @pytest.mark.large
    def test_an_arm_that_cannot_stand_is_said_to_be_unstable(self, printed):
        assert printed("design", "lce_arm", "--payload", "50g")["at_rest"] == "unstable"

    def test_an_arm_too_heavy_to_be_followed_is_still_described(self, printed):
        facts = printed("design", "lce_arm", "--gravity", "sideways", "--payload", "100kg")
        assert facts["at_rest"] == "unknown: the loads are too large"
        assert facts["sag_at_rest_L"] is None

    def test_an_arm_without_loads_is_judged_by_its_own_weight(self, printed):
        facts = printed("design", "lce_arm")
        held = sr.designs.lce_arm().replace(loads=sr.Loads(gravity=(9.81, 0, 0)))
        assert facts["sag_at_rest_sideways_L"] == sr.rest.rest(held).sag_over_length
        assert facts["at_rest_upright"] == "stable"

    def test_loads_beyond_the_verified_ones_are_warned_of_once(self, capsys, tmp_path):
        arm = ["lce_arm", "--payload", "71g", "--gravity", "up"]
        assert run(["design", *arm]) == 0
        assert capsys.readouterr().err.count("load number is") == 1
        assert run(["cloud", *arm, "--n", "8", "--out", str(tmp_path / "a.zarr")]) == 0
        assert capsys.readouterr().err.count("load number is above 12") == 1


@pytest.mark.parametrize("options", [["--payload", "200g"], ["--set", "loads.payload=1g"]])
def test_loads_ask_in_one_line_for_what_the_arm_lacks(options, capsys):
    assert run(["design", "minimal_trunk", *options]) == 2
    text = capsys.readouterr().err
    assert text.count("\n") == 1
    lacking = [f"rings[0].material.{name}" for name in ("young_modulus", "density")]
    assert text.partition("loads need ")[2].partition(":")[0] == " and ".join(lacking)
    assert all(f"--set {name}=" in text for name in lacking)


def test_a_gradient_takes_parameters_as_list_prints_them(printed):
    command = "gradient", "minimal_trunk", "--accuracy", "0.1"
    assert printed(*command, "taper_deg") == printed(*command, "taper")


# Places and the exact reachable set


def test_activations_lead_to_targets_of_the_line_or_a_file(trunk, folder, printed):
    target = sr.tip_positions(trunk, [[-0.9, -0.3, -0.6]])[0]
    row = ",".join(f"{x:.17g}" for x in target)
    (folder / "bare.csv").write_text(f"{row}\n2,0,0\n")
    (folder / "headed.csv").write_text(f"x,y,z\n{row}\n2,0,0\n")
    for where in (f"--target={row}", "--targets=bare.csv", "--targets=headed.csv"):
        reached, *others = printed("solve", "minimal_trunk", where)
        assert reached["status"] == "reached"
        tips = sr.tip_positions(trunk, reached["activations"])
        np.testing.assert_allclose(tips, np.tile(target, (len(tips), 1)), atol=1e-9)
        assert [one["status"] for one in others] == ["unreachable"] * where.endswith("csv")
        assert all(one["gap_m"] > 1 for one in others)


@pytest.mark.parametrize(
    "words", ["design lce_arm", "list parameters lce_arm", "solve lce_arm --target 2cm,1cm,6cm"]
)
def test_numbers_without_an_error_have_five_digits_at_most(words, capsys):
    assert run(words.split()) == 0
    numbers = re.findall(r"(?<![\w.])\d+(?:\.\d+)?", capsys.readouterr().out)
    assert max(len(number.replace(".", "").strip("0")) for number in numbers) == 5


def test_a_solution_prints_itself_as_the_command_does(capsys):
    assert run(["solve", "lce_arm", "--target", "2cm,1cm,6cm"]) == 0
    (solution,) = sr.solve_inverse(sr.designs.lce_arm(), [[0.02, 0.01, 0.06]])
    assert capsys.readouterr().out == f"{solution}\n"


def test_a_marker_has_a_target_too(folder, printed):
    elbow = sr.arm.Marker(name="elbow", station_over_length=0.5)
    arm = sr.designs.three_tendon_robot(segments=2).replace(markers=[elbow])
    arm.save(folder / "arm.toml")
    tip, place = (
        of(arm, [[5, 2, 0, 0, 6, 7]]).ravel() for of in (sr.tip_positions, sr.rod.marker_positions)
    )
    target, marker = (",".join(f"{1000 * x:.9g}mm" for x in each) for each in (tip, place))
    command = "solve", "arm.toml", f"--target={target}", "--within", "1mm"
    (found,) = printed(*command, "--marker", f"elbow={marker}")
    assert found["status"] == "reached"
    assert found["marker_errors_m"][0][0] < 1e-6


def test_activations_are_told_in_their_units(capsys):
    assert run(["solve", "three_tendon_robot", "--target=0,0,1"]) == 0
    assert capsys.readouterr().out.count(" N") == 3


def test_a_family_that_is_smaller_than_asked_says_so(capsys):
    arm = sr.designs.redundant_trunk()
    text = ",".join(f"{x:.17g}" for x in sr.tip_positions(arm, arm.bounds[:, 0])[0])
    assert run(["solve", "redundant_trunk", f"--target={text}", "--family", "3"]) == 0
    assert "no others found: further searches end at this one" in capsys.readouterr().out


def test_a_path_is_tracked_into_a_file(folder, trunk, capsys):
    gamma = np.linspace([-0.9, -0.3, -0.6], [-0.5, -0.8, -0.7], 5)
    points = sr.tip_positions(trunk, gamma)
    np.savetxt("path.csv", points, delimiter=",", header="x,y,z", comments="")
    assert run(["track", "minimal_trunk", "path.csv", "--out", "activations.csv"]) == 0
    assert "All 5 points are followed: " in capsys.readouterr().out
    found = np.loadtxt("activations.csv", delimiter=",", skiprows=1)[:, :3]
    np.testing.assert_allclose(sr.tip_positions(trunk, found), points, atol=1e-8)


def test_the_reachable_set_is_reported_drawn_and_written(folder, printed):
    outs = ("-o", "reach.ply", "--out", "reach.png")
    found = printed("reach", "minimal_trunk", "--accuracy", "0.02", *outs)
    assert found["volume_L3"] == pytest.approx(0.691, abs=0.002)
    assert 0 < found["unreachability"] < 1
    assert all(path.stat().st_size > 10_000 for path in folder.iterdir())
    assert {path.name for path in folder.iterdir()} == {"reach.ply", "reach.png"}
