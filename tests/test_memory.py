"""Free memory: what a container leaves of its limit."""

import dataclasses
import sys
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest

import softreach as sr
from softreach.rod import as_tip_map
from softreach.sampling import sample_cube
from softreach.support import memory
from softreach.support.errors import SoftreachWarning, no_warnings, warn
from tests.bodies import rubber

LIMITED = {
    "memory.max": "8000",
    "memory.current": "7000",
    "memory.stat": "anon 1500\ninactive_file 5000\nactive_file 500\n",
}


@pytest.fixture
def container(tmp_path, monkeypatch):
    monkeypatch.setattr(memory, "_CONTROL_GROUP", tmp_path)
    monkeypatch.setattr(memory, "_system", lambda: 1e6)

    def of(files: dict[str, str]) -> None:
        for name, text in files.items():
            (tmp_path / name).write_text(text)

    return of


UNLIMITED = LIMITED | {"memory.max": "max"}


@pytest.mark.parametrize(
    ("files", "free"), [(LIMITED, 8000 - 7000 + 5000), ({}, 1e6), (UNLIMITED, 1e6)]
)
def test_files_kept_only_to_read_are_free_and_without_a_limit_the_system_says(
    container, files, free
):
    container(files)
    assert memory.free_memory() == free


def test_a_cloud_for_which_there_is_no_memory_is_refused():
    said = r"^n = 10.*of memory, of which .* GB are free$"
    with pytest.raises(sr.errors.NotPossible, match=said):
        sr.compute_cloud(sr.designs.minimal_trunk(), 10**12)


def test_cells_for_which_there_is_no_memory_are_refused(trunk, monkeypatch):
    image = dataclasses.replace(sr.reachable_set(trunk, accuracy=0.05).image)  # nothing counted
    monkeypatch.setattr(memory, "_NOTICED", 0)
    monkeypatch.setattr(memory, "free_memory", lambda: 100.0)
    with pytest.raises(sr.errors.NotPossible, match="cells of the lattice = "):
        _ = image.counts


@pytest.mark.skipif(sys.platform != "linux", reason="other systems take freed memory themselves")
def test_memory_that_was_freed_is_returned_to_the_system():
    def resident() -> int:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    pieces = [bytes(20_000) for _ in range(5000)]
    del pieces[:-1]  # the last holds the others in the heap
    before = resident()
    memory.return_memory()
    assert resident() < before - 50e6


# Warnings name the line of whoever called softreach, and are silenced on one thread only


def test_a_warning_names_the_line_of_the_caller(trunk):
    tips = sr.compute_cloud(trunk, 500).tip.values
    soft = rubber(trunk, sr.Loads(gravity=(0.0, 0.0, -9.81)), young=3e4)
    for cause in (lambda: as_tip_map(soft), lambda: sr.concave_hull(tips, alpha=0.01)):
        with pytest.warns(SoftreachWarning) as caught:
            cause()
        assert {warning.filename for warning in caught} == {__file__}


def test_what_one_thread_silences_another_still_says():
    silenced, said = threading.Event(), threading.Event()

    def silent() -> None:
        with no_warnings():
            silenced.set()
            said.wait()
            warn("silent")

    thread = threading.Thread(target=silent)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        thread.start()
        silenced.wait()
        warn("loud")
        said.set()
        thread.join()
    assert [str(warning.message) for warning in caught] == ["loud"]


def test_sobol_points_in_blocks_are_those_of_one_draw_without_a_warning():
    from scipy.stats import qmc

    points = sample_cube("sobol", 64, 3, 5)  # warnings are errors here
    expected = qmc.Sobol(3, scramble=True, rng=np.random.default_rng(5)).random(64)
    np.testing.assert_array_equal(points, expected)
