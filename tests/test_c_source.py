"""Kinematics in C and tables of the inverse: compiled, and held to the library."""

import ctypes
import re
import shutil
import subprocess
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import softreach as sr
from softreach.arm.actuators import LengthTendon
from softreach.arm.body import RestShape
from softreach.arm.drives import Drive
from softreach.arm.stations import Marker
from softreach.models import c, inverse_table
from softreach.rod.rods import as_tip_map

MANY = 100_000
CHAMBERS = sr.designs.three_chamber_arm()
LOADED = CHAMBERS.replace(loads=sr.Loads(payload=0.005), base=sr.Base(points="down"))
BASE = sr.Base(points="x", turn=0.4, position=(0.1, -0.2, 0.3))
DRIVEN = CHAMBERS.replace(
    drives=(Drive(name="left", gains={"chamber 1": 2.0, "chamber 2": -0.5}, bounds=(0.0, 2e4)),),
    rest=RestShape(curvature_x=1.0, twist=2.0),
    markers=(Marker(name="tool", station_over_length=0.8, offset=(0.0, 0.01, 0.02)),),
    base=BASE,
)
ARMS = {
    "fibers": sr.designs.minimal_trunk().replace(base=BASE),
    "tendons": sr.designs.three_tendon_robot(segments=2),
    "muscles": sr.designs.elephant_trunk(),
    "drives, rest shape, tool": DRIVEN.at_point("tool"),
}
USE = """#include "arm.h"
void jacobians(const double *g, long n, double *tips, double *slopes)
{ const long m = ARM_INPUTS;
  for (long i = 0; i < n; i++) arm_jacobian(g + i * m, tips + 3 * i, slopes + 3 * m * i); }
void tips(const double *g, long n, double *tips)
{ for (long i = 0; i < n; i++) arm_tip(g + i * ARM_INPUTS, tips + 3 * i); }
void frames(const double *g, long n, double *tips, double *directors)
{ for (long i = 0; i < n; i++) arm_frame(g + i * ARM_INPUTS, tips + 3 * i, directors + 9 * i); }
"""
LOOK_UP = """#include "arm.h"
double look_up(const double *places, long n, double *g, double *found)
{ for (long i = 0; i < n; i++) found[i] = arm_lookup(places + 3 * i, g + ARM_INPUTS * i);
  return ARM_ERROR; }
"""


def compiled(folder, text, use):
    """The functions of a file in C, without a warning."""
    if (compiler := shutil.which("cc")) is None:
        pytest.skip("there is no compiler of C")
    (folder / "arm.h").write_text(text)
    (folder / "use.c").write_text(use)
    checks = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    command = [compiler, *checks, "-O2", "-shared", "-fPIC", "-o", "use.so", "use.c"]
    subprocess.run(command, check=True, cwd=folder)
    return ctypes.CDLL(str(folder / "use.so"))


def called(function, given, *shapes):
    """What a function writes into arrays of these shapes, for each row that is given."""
    out = [np.full((len(given), *shape), np.nan) for shape in shapes]
    arrays = [ctypes.c_void_p(each.ctypes.data) for each in (given, *out)]
    function(arrays[0], ctypes.c_long(len(given)), *arrays[1:])
    return out


def activations_of(arm, count):
    low, high = arm.input_bounds.T
    return low + np.random.default_rng(0).random((count, arm.inputs)) * (high - low)


@pytest.mark.parametrize("kind", ARMS)
def test_c_has_the_tips_frames_and_derivatives_of_the_library(kind, tmp_path):
    arm = ARMS[kind]
    library, tip_map = compiled(tmp_path, c(arm), USE), as_tip_map(arm)
    gamma = activations_of(arm, MANY)
    (tips,) = called(library.tips, gamma, (3,))
    exact = tip_map.tips(gamma)
    assert np.abs(tips - exact).max() < 1e-12 * arm.length
    some = gamma[:200]
    tips, slopes = called(library.jacobians, some, (3,), (3, arm.inputs))
    moved = tip_map.tips_and_slopes(some)[1]
    np.testing.assert_allclose(slopes, moved, rtol=0.0, atol=1e-12 * np.abs(moved).max())
    framed, directors = called(library.frames, some, (3,), (3, 3))
    np.testing.assert_array_equal(framed, tips)
    np.testing.assert_allclose(directors[:, 2], tip_map.tip_directions(some), atol=1e-5)
    product = directors @ directors.swapaxes(1, 2)
    np.testing.assert_allclose(product, np.tile(np.eye(3), (200, 1, 1)), atol=1e-9)


@cache
def table_of(kind):
    arms = {"free": CHAMBERS, "loaded": LOADED, "redundant": sr.designs.redundant_trunk()}
    spacing = {"free": 0.1, "loaded": 0.15, "redundant": 0.15}[kind]
    return inverse_table(arms[kind], spacing_over_length=spacing, error_over_length=0.05)


@pytest.mark.parametrize(
    ("kind", "count"), {"free": MANY, "loaded": 5_000, "redundant": MANY}.items()
)
def test_the_error_of_a_table_is_exceeded_nowhere_and_c_looks_up_the_same(kind, count, tmp_path):
    table = table_of(kind)
    arm, rng = table.arm, np.random.default_rng(3)
    cells = np.argwhere(table.cells)
    cell = cells[rng.integers(0, len(cells), count)]
    places = table.origin + table.spacing * (cell + rng.random((count, 3)))
    gamma = table(places)
    away = np.linalg.norm(sr.tip_positions(arm, gamma) - places, axis=1)
    assert away.max() <= table.error <= 0.05 * arm.length
    low, high = arm.input_bounds.T
    assert ((low <= gamma) & (gamma <= high)).all()
    outside = table.origin - rng.random((10, 3))
    library = compiled(tmp_path, c(arm, lookup=table), LOOK_UP)
    asked = np.concatenate([places, outside])
    looked_up, found = called(library.look_up, asked, (arm.inputs,), ())
    np.testing.assert_array_equal(found, np.isfinite(table(asked)[:, 0]))
    np.testing.assert_allclose(looked_up[:count], gamma, rtol=1e-12, atol=1e-9 * np.abs(high).max())


def test_a_table_is_continuous_from_cell_to_cell():
    """Places at either side of a face between two cells have the same activations."""
    table = table_of("free")
    cells = table.cells.astype(bool)
    low = np.argwhere(cells[:-1] & cells[1:])
    face = table.origin + table.spacing * (low + [1.0, 0.3, 0.6])
    step = [1e-9 * table.spacing, 0.0, 0.0]
    np.testing.assert_allclose(table(face - step), table(face + step), atol=1e-3)
    assert len(low) > 50


def test_a_table_is_a_file_of_numpy_with_its_error(tmp_path):
    table = table_of("free")
    table.save(tmp_path / "table.npz")
    with np.load(tmp_path / "table.npz") as stored:
        for name in ("rows", "cells", "activations", "error", "origin", "spacing"):
            np.testing.assert_array_equal(stored[name], getattr(table, name))
    with pytest.raises(sr.InvalidInput, match="overwrite"):
        table.save(tmp_path / "table.npz")
    assert "cells, error up to" in repr(table)


CABLE = LengthTendon(name="cable", distance=0.01, activation_bounds=(0.0, 0.01))
REFUSED = {
    "lookup table": (LOADED, {}),
    "dead zones": (CHAMBERS.replace(actuators=(*CHAMBERS.actuators, CABLE)), {}),
    "name of C": (CHAMBERS, {"name": "7 arms"}),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_has_no_c_is_refused_in_a_sentence(words):
    arm, options = REFUSED[words]
    with pytest.raises((sr.NotPossible, sr.InvalidInput), match=words):
        c(arm, **options)


def test_tables_need_three_free_bundles_and_are_those_of_their_arm():
    flat = sr.designs.three_chamber_arm()
    flat = flat.with_bounds(np.array([[0.0, 1e5], [0.0, 1e5], [0.0, 0.0]]))
    with pytest.raises(sr.InvalidInput, match="free bundles"):
        inverse_table(flat)
    with pytest.raises(sr.NotPossible, match="spacing_over_length"):
        inverse_table(CHAMBERS, spacing_over_length=0.4, error_over_length=1e-6)
    with pytest.raises(sr.InvalidInput, match="lookup"):
        c(CHAMBERS.replace(base=BASE), lookup=table_of("free"))


def test_the_loop_of_the_documentation_compiles_and_keeps_its_rate(tmp_path):
    page = (Path(__file__).parent.parent / "docs" / "models.md").read_text("utf-8")
    (loop,) = re.findall(r"^```c\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    table = table_of("free")
    library = compiled(tmp_path, c(table.arm, lookup=table), loop)
    moved = np.zeros(3)
    target = table.origin + table.spacing * (np.argwhere(table.cells)[0] + 0.5)
    arrays = [ctypes.c_void_p(each.ctypes.data) for each in (target, moved)]
    library.control(*arrays, ctypes.c_double(0.01))
    assert moved.max() == pytest.approx(200.0)
    for _ in range(10_000):
        library.control(*arrays, ctypes.c_double(0.01))
    np.testing.assert_allclose(moved, table(target)[0], rtol=1e-9)


def test_the_command_writes_c(tmp_path, monkeypatch):
    from softreach.cli.app import run

    monkeypatch.chdir(tmp_path)
    assert run(["export", "three_chamber_arm", "arm.h"]) == 0
    assert (tmp_path / "arm.h").read_text() == c(CHAMBERS)
