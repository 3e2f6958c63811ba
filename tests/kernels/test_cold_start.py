"""What a first run compiles: as little as can be, and nothing that crept in."""

from __future__ import annotations

import importlib
import pkgutil
import re
from pathlib import Path

import pytest
from benchmarks.bench_cold import COMMANDS, ROOT, Cold, measured, recorded

from softreach import kernels
from softreach.kernels.parts import KernelDispatcher

ROD = {"tips._tips"}
SLOPES = ROD | {"jacobian._jacobians"}
HULL = {
    "spatial_sort._sort_keys",
    "bowyer_watson._insert",
    "alpha.measure_cells",
    "alpha.boundary_faces",
    "alpha.join_regions",
}
REACH = {
    "contour.stretches",
    "contour.critical_triangles",
    "raster.most_crossings",
    "raster.crossings",
    "raster.add_counts",
}
MESH = {
    "activation_mesh.interpolation_errors",
    "activation_mesh.face_planes",
    "space_tree.sort_into_children",
}
NEWTON = {
    "candidates._find_starts",
    "newton.newton_step",
    "newton.conditions",
    "newton.merge_equal",
    "folds.second_preimages",
}
KERNELS = {
    "cloud": ROD,
    "volume": ROD | HULL,
    "reach": SLOPES | REACH,
    "solve": SLOPES | MESH | NEWTON,
    "demo": ROD | HULL | {"frames.frames"},
}
"""The kernels of each command, every one for one set of types."""

TWICE = {
    "vector.combination",  # of twists and of vectors
    "vector.cross",  # `inline` and `strict`
    "spatial_sort._reflect",  # with low bits of two types
}
"""Functions that are compiled for two sets of types."""

OF_NUMBA = 20
"""Functions of Numba itself that a command may compile: each costs a twentieth of a second."""

FEW = ("--n", "2000")
WARM_UP = "warmup --loads"


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("cold")


@pytest.fixture(scope="module")
def runs(folder) -> dict[str, Cold]:
    """Every command in a process of its own, with one kernel cache that starts empty."""
    few = {name: FEW for name in ("cloud", "volume", "demo")}
    return {name: measured(name, folder, *few.get(name, ())) for name in COMMANDS}


@pytest.fixture(scope="module")
def warm_up(folder, runs) -> Cold:
    """What the warm-up does after them."""
    return recorded(WARM_UP.split(), folder)


def test_a_command_uses_its_kernels_and_no_other_each_for_one_set_of_types(runs):
    used = {
        name: {kernel: len(types) for kernel, types in run.used.items()}
        for name, run in runs.items()
    }
    assert used == {name: dict.fromkeys(KERNELS[name], 1) for name in COMMANDS}


def test_no_kernel_is_compiled_by_two_commands(runs, warm_up):
    kernels = set().union(*KERNELS.values())
    every = [*runs.values(), warm_up]
    compiled = [kernel for run in every for kernel in run.compiled if kernel in kernels]
    assert sorted(compiled) == sorted(kernels)


def test_a_function_is_compiled_for_one_set_of_types_with_few_exceptions(runs):
    twice = {
        name: {n: times for n, times in run.compiled.items() if times > 1 and not of_numba(n)}
        for name, run in runs.items()
    }
    assert {times for of_one in twice.values() for times in of_one.values()} == {2}
    assert set().union(*twice.values()) <= TWICE


def test_kernels_ask_numba_for_little_of_its_own(runs):
    asked = {n: sum(t for f, t in run.compiled.items() if of_numba(f)) for n, run in runs.items()}
    assert {name: times for name, times in asked.items() if times > OF_NUMBA} == {}


def of_numba(name: str) -> bool:
    return name.startswith("numba.")


def test_the_warm_up_compiles_every_kernel(warm_up):
    assert _kernels() <= warm_up.used.keys()


def test_after_the_warm_up_no_command_of_the_readme_compiles_anything(runs, warm_up, folder):
    """The warm-up uses all that they use, for the same types."""
    others = [line for line in _of_readme() if line not in COMMANDS.values()]
    found = [*runs.values(), *(recorded(line.split(), folder) for line in others)]
    assert len(found) >= 7
    assert [run.compiled for run in found[len(runs) :] if run.compiled] == []
    for run in found:
        for kernel, types in run.used.items():
            assert set(types) <= set(warm_up.used[kernel]), kernel


def _kernels() -> set[str]:
    """Every function that is made to be called from Python, by the name of the benchmark."""
    modules = [
        importlib.import_module(f"{kernels.__name__}.{module.name}")
        for module in pkgutil.walk_packages(kernels.__path__)
    ]
    return {
        f"{module.__name__.rsplit('.', 1)[1]}.{name}"
        for module in modules
        for name, function in vars(module).items()
        if type(function) is KernelDispatcher  # not of a class that makes parts of it
        and function.py_func.__module__ == module.__name__
        and function.targetoptions.get("inline") != "always"
    }


def _of_readme() -> list[str]:
    """The commands in the README that end by themselves, whatever their number of samples."""
    text = re.sub(r" --n \d+", "", (ROOT / "README.md").read_text(encoding="utf-8"))
    lines = [line.split("#")[0] for line in text.splitlines() if line.startswith("softreach ")]
    commands = [" ".join(line.split()[1:]) for line in lines]
    return [command for command in commands if not command.startswith("studio")]
