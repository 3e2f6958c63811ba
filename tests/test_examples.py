"""Scripts of users run from a wheel outside the clone; pictures of the docs are what they say."""

import os
import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from tools import conventions
from tools.conventions import arm_with
from tools.gallery import PAGE, PICTURES, measured, page, rows_of

import softreach as sr
from softreach.arm import ObliqueMuscle, RadialMuscle, designs

ROOT = Path(__file__).parent.parent
EXAMPLES = ROOT / "examples"
SOURCE = Path(sr.__file__).parent


@pytest.fixture(scope="session")
def installed(tmp_path_factory):
    """The environment of a user who installed the wheel; kernels are compiled already."""
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    site = folder / "site"
    zipfile.ZipFile(wheel).extractall(site)
    for path in (SOURCE / "kernels").rglob("*"):  # with their times, by which the cache knows them
        if path.is_file():
            target = site / "softreach" / path.relative_to(SOURCE)
            target.parent.mkdir(exist_ok=True)
            shutil.copy2(path, target)
    (folder / "softreach").write_text(f'#!/bin/sh\nexec "{sys.executable}" -m softreach "$@"\n')
    (folder / "softreach").chmod(0o755)
    path = os.pathsep.join([str(folder), str(Path(sys.executable).parent), os.environ["PATH"]])
    return os.environ | {"PYTHONPATH": str(site), "PATH": path, "MPLBACKEND": "agg"}


def printed_by(environment, folder, *command):
    words = [*map(str, command)]
    done = subprocess.run(words, cwd=folder, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_wheel_is_what_runs(installed, tmp_path):
    where = "import softreach; print(softreach.__file__)"
    assert str(SOURCE) not in printed_by(installed, tmp_path, sys.executable, "-c", where)


@pytest.mark.large
def test_my_tendon_arm(installed, tmp_path):
    script, design = EXAMPLES / "tendon_arm.sh", EXAMPLES / "tendon_arm.toml"
    text = printed_by(installed, tmp_path, "bash", script, design)
    assert "target (60, 40, -270) mm: reached" in text
    written = {"slices.png", "reachable.html", "reachable.stl", "payload.png"}
    written |= {"cloud.zarr", "cloud.png", "cloud.csv"}
    assert {path.name for path in tmp_path.iterdir()} == written


@pytest.mark.large  # docs/requirements.md does the same
def test_a_requirement_is_checked(installed, tmp_path):
    script = EXAMPLES / "requirement_check.py"
    text = printed_by(installed, tmp_path, sys.executable, script, EXAMPLES / "tendon_arm.toml")
    assert text.count(": reached") == 3
    assert text.count(": missed by") == 2


@pytest.mark.large
def test_an_actuator_of_ones_own_and_an_atlas_that_is_interrupted(installed, tmp_path):
    files = EXAMPLES / "spine.toml", EXAMPLES / "magnets.py"
    text = printed_by(installed, tmp_path, "bash", EXAMPLES / "own_actuator.sh", *files)
    *_, last = (line for line in text.splitlines() if line.startswith("  done"))
    assert last.split() == ["done", "12"]
    assert "best exact_volume of spines.zarr" in text


# The gallery shows every named design as it is


TEXT = PAGE.read_text(encoding="utf-8")
ROWS = rows_of(TEXT)
QUICK = [name for name in designs.__all__ if getattr(designs, name)().bundles == 3]


def test_the_page_is_written_by_the_tool_from_all_named_designs():
    assert list(ROWS) == designs.__all__
    assert page(ROWS) == TEXT


def parsed(text: str) -> tuple[float, float, str]:
    """Value, error and unit of a number as people write it."""
    found = re.fullmatch(r"\(?([\d.]+) ± ([\d.]+)\)?(e-\d+)? (.+)", text)
    assert found
    power = found[3] or ""
    return float(found[1] + power), float(found[2] + power), found[4]


@pytest.mark.parametrize("name", QUICK)
def test_the_numbers_on_the_page_are_those_of_the_exact_set(name):
    for text, again in zip(ROWS[name], measured(name), strict=True):
        value, error, unit = parsed(text)
        assert error < 0.01 * value
        assert parsed(again)[0] == pytest.approx(value, abs=error, rel=1e-6)
        assert parsed(again)[2] == unit


def test_every_design_has_a_small_picture():
    sizes = {path.stem: path.stat().st_size for path in PICTURES.glob("*.png")}
    assert sorted(sizes) == sorted(designs.__all__)
    assert max(sizes.values()) < 150_000


# What the picture of conventions says is so, and it is the picture that the script draws


@pytest.mark.parametrize("words", conventions.STRAIGHT)
def test_straight_actuators_bend_the_way_the_picture_says(words):
    actuator, activation = conventions.STRAIGHT[words]
    (tip,) = sr.tip_positions(arm_with(actuator), [[activation]])
    away = "away" in words
    assert (tip[0] < -0.1) if away else (tip[0] > 0.1)
    assert tip[1] == pytest.approx(0, abs=1e-9)
    extension = sr.configuration(arm_with(actuator), [activation]).extension
    assert (extension > 1).all() == away


def test_positive_angles_turn_from_d1_to_d2_seen_from_the_tip():
    quarter = conventions.FIBER.replace(offset=np.pi / 2)
    (tip,) = sr.tip_positions(arm_with(quarter), [[-0.05]])
    assert tip[1] > 0.01
    outline = arm_with(conventions.WINDING).outline([0.0, 1.0])
    assert outline.center[1] - outline.center[0] == pytest.approx(conventions.WINDING.revolution)


@pytest.mark.parametrize(
    ("actuator", "activation", "sign"),
    [
        (conventions.WINDING, -0.1, -1),
        (ObliqueMuscle(helical_angle=0.4, extent=2 * np.pi), -0.1, -1),
        (conventions.TENDON.replace(revolution=3.0), 10.0, -1),
        (RadialMuscle(extent=2 * np.pi), -0.1, 0),
        (conventions.CHAMBER, 1e4, 0),
    ],
)
def test_what_is_right_handed_and_contracts_turns_the_tip_clockwise(actuator, activation, sign):
    twist = sr.configuration(arm_with(actuator), [activation]).sel(component="u3").curvature
    np.testing.assert_array_equal(np.sign(np.round(twist, 9)), sign)


def test_the_picture_in_the_documentation_is_the_one_that_is_drawn(tmp_path):
    plt = pytest.importorskip("matplotlib.pyplot")
    conventions.conventions_figure().savefig(tmp_path / "new.png", dpi=conventions.DPI)
    old, new = plt.imread(conventions.PICTURE), plt.imread(tmp_path / "new.png")
    assert old.shape == new.shape, "run python -m tools.conventions"
    assert np.abs(old - new).mean() < 0.01, "run python -m tools.conventions"
