"""What a search prints, draws and writes, its file, and its command."""

import json
import re

import numpy as np
import pandas as pd
import pytest

import softreach as sr
from softreach.cli.app import run
from softreach.optimization.search_file import read_search
from softreach.support.errors import InvalidDesign, InvalidInput
from tests.optimization.test_search import ARM, FAST, FREE, NEEDS, heavy

NEEDS_FILE = """
[limits]
mass = "8kg"

[search]
design = "arm.toml"
maximize = "mass"
designs = 12
accuracy = 0.1
seed = 3
polish = false

[search.free]
taper_deg = [0, 3]
outer_radius = ["60mm", "80mm"]
left.revolution = ["-1rad", "1rad"]
"right.revolution" = "-left.revolution + 5deg"

[search.choices]
left.offset_deg = [50, 60]
"""


@pytest.fixture(scope="module")
def one():
    """A search with one objective."""
    return heavy()


@pytest.fixture(scope="module")
def several():
    """A search with two objectives, which reaches a front without polish."""
    goals = ["mass", "reach_height"]
    return sr.search(ARM, FREE, NEEDS, maximize=goals, polish=False, **FAST)


@pytest.fixture
def folder(folder):
    """A folder with a design, and what is asked of it."""
    ARM.save("arm.toml")
    (folder / "needs.toml").write_text(NEEDS_FILE)
    return folder


def read(text, folder):
    return read_search(text, folder, sr.Manipulator.load, "needs.toml")


def test_it_prints_objectives_with_units_and_parameters_in_their_ranges(one):
    text = repr(one)
    assert "best design, 2 requirements met" in text
    assert re.search(r"largest mass +[\d.]+ kg", text)
    assert re.search(r"\n +revolution +[\d.]+°.* +0 to 103\.13°", text)
    assert re.search(r"\d+ by bounds alone", text)


def test_its_dataset_holds_all_designs_and_which_is_which(one):
    table = one.to_dataset()
    assert table.sizes["design"] == len(one.candidates) + len(one.finalists)
    best = table.isel(design=table.front.values)
    assert best.objective_value.item() == one.best.objectives[0].value
    assert dict(zip(table.parameter.values, best.value.values[0], strict=True)) == one.best.values
    assert (np.diff(table.looked_at.values) >= 0).all()


def test_saved_designs_are_those_of_the_front(one, several, tmp_path):
    one.save(tmp_path / "one")
    assert sr.Manipulator.load(tmp_path / "one" / "best.toml") == one.arm
    several.save(tmp_path / "front", unit="mm")
    paths = sorted((tmp_path / "front").glob("front_*.toml"))
    assert [sr.Manipulator.load(path) for path in paths] == list(several.arms)
    table = pd.read_csv(tmp_path / "front" / "front.csv")
    radii = [1e3 * each.values["outer_radius"] for each in several.front]
    np.testing.assert_allclose(table["outer_radius_mm"], radii, rtol=1e-8)
    every = pd.read_csv(tmp_path / "front" / "candidates.csv")
    assert len(every) == len(several.candidates) + len(several.finalists)
    page = (tmp_path / "front" / "report.html").read_text()
    assert "softreach: Search of designs" in page
    assert page.count("data:image/png") == 1
    assert str(several.problem.digest) in page


def test_a_search_replaces_an_older_one_only_if_one_says_so(one, several, tmp_path):
    several.save(tmp_path)
    (tmp_path / "front_1000.toml").write_text("mine\n")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InvalidInput, match="something is there"):
        one.save(tmp_path)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before
    one.save(tmp_path, overwrite=True)
    assert [path.read_text() for path in tmp_path.glob("front_*.toml")] == ["mine\n"]


def test_pictures_say_their_units_and_tell_the_infeasible_by_shape(one, several):
    pytest.importorskip("matplotlib.pyplot")
    figure = sr.plot.plot_search(one, unit="mm")
    assert figure.axes[0].get_ylabel() == "mass [kg]"
    labels = figure.axes[0].get_legend_handles_labels()[1]
    assert {"on the way", "requirements missed", "full accuracy"} <= {*labels}
    texts = {text.get_text() for text in figure.axes[-1].texts}
    assert {"60 mm", "80 mm", "0°"} <= texts
    figure = sr.plot.plot_search(several, unit="cm")
    assert figure.axes[0].get_ylabel() == "reach_height [cm] (large is better)"
    drawn, found = figure.axes[0].collections[-1].get_offsets(), several.to_dataset()
    heights = found.objective_value.values[found.front.values, 1]
    np.testing.assert_allclose(drawn[:, 1], 1e2 * heights)


def test_a_file_says_the_same_as_the_call(folder):
    asked = read(NEEDS_FILE, folder)
    assert asked["base"] == ARM
    assert asked["requirements"].limits.mass == 8.0
    assert asked["free"]["taper"] == pytest.approx((0.0, np.radians(3)))
    assert asked["free"]["outer_radius"] == (0.06, 0.08)
    assert asked["free"]["left.revolution"] == (-1.0, 1.0)
    assert asked["free"]["right.revolution"] == "-left.revolution + 5deg"
    assert asked["choices"]["left.offset"] == pytest.approx(np.radians([50, 60]))
    of_arm = ("base", "requirements", "free", "choices")
    options = {name: value for name, value in asked.items() if name not in of_arm}
    numbers = {"designs": 12, "accuracy": 0.1, "seed": 3, "polish": False}
    assert options == {"maximize": ["mass"], "minimize": [], **numbers}


FAULTS = {
    "designs = 12": ("desings = 12", 'search.desings = 12: unknown key; did you mean "designs"?'),
    'maximize = "mass"': ('maximize = "mas"', "search.maximize = 'mas': must be one of"),
    "accuracy = 0.1": ("accuracy = 9", "search.accuracy = 9: must be a finite number"),
    "taper_deg = [0, 3]": ("taper_deg = [3, 0]", "search.free.taper_deg = [3, 0]: must be a range"),
    "left.revolution =": ("left.revolutoin =", "search.free.left.revolutoin: is not a parameter"),
    '"-left.revolution + 5deg"': ('"left"', "search.free.right.revolution = 'left': must be"),
    "= [50, 60]": ("= [50, 50]", "search.choices.left.offset_deg = [50, 50]: must be a list of d"),
    '"8kg"': ("8", "limits.mass = 8: must have its unit"),
}


def test_all_faults_of_a_file_are_told_at_once_in_its_own_words(folder):
    text = NEEDS_FILE
    for old, (new, _) in FAULTS.items():
        assert old in text
        text = text.replace(old, new, 1)
    with pytest.raises(InvalidDesign) as error:
        read(text, folder)
    said = str(error.value)
    assert said.startswith(f"needs.toml: {len(FAULTS)} problems")
    assert [expected for _, expected in FAULTS.values() if expected not in said] == []


def test_the_command_writes_what_the_call_finds(folder, capsys):
    code = run(["search", "needs.toml", "--out", "best", "--json"])
    record = json.loads(capsys.readouterr().out)
    assert code == (0 if record["met"] else 1)
    names = {"best.toml", "front.csv", "candidates.csv", "report.html", "search.journal"}
    assert {path.name for path in (folder / "best").iterdir()} == names
    assert sr.describe(sr.Manipulator.load("best/best.toml")).mass <= 8.0
    assert run(["search", "needs.toml", "--out", "best"]) == 2
    assert "best.toml: must be a new name" in capsys.readouterr().err
    assert run(["search", "needs.toml", "--out", "best", "--overwrite"]) == code
    assert "designs, " in capsys.readouterr().out


def test_the_exit_code_says_whether_the_best_meets_all(folder, capsys):
    (folder / "needs.toml").write_text(NEEDS_FILE.replace('"8kg"', '"1g"'))
    assert run(["search", "needs.toml", "-o", "best"]) == 1
    assert "MISSED  mass: " in capsys.readouterr().out
    text = (folder / "best" / "best.toml").read_text()
    assert text.startswith("# Found by a search of softreach; it does not meet all requirements.")


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--designs", "0"], "designs = 0: must be a whole number"),
        (["--storage", "missing/a.journal"], "storage = missing/a.journal: must be a file in a f"),
        (["--out", "arm.toml"], "arm.toml"),
    ],
)
def test_wrong_options_are_refused_in_one_line(options, said, folder, capsys):
    assert run(["search", "needs.toml", *options]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_objectives_are_listed(capsys):
    assert run(["list", "objectives"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines[1:]] == list(sr.optimization.OBJECTIVES)
