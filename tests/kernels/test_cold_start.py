"""What a first run compiles: as little as can be, and nothing that crept in."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path

import pytest
from benchmarks.bench_cold import COMMANDS, ROOT, Cold, measured, recorded

from softreach import kernels
from softreach.kernels.parts import KernelDispatcher

ROD = {"rod._tips"}
SLOPES = ROD | {"jacobian._jacobians"}
HULL = {
    "spatial_sort._sort_keys",
    "delaunay._insert",
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

FEW = {"cloud": ("--n", "2000"), "volume": ("--n", "2000"), "demo": ("--n", "2000")}


@pytest.fixture(scope="module")
def runs(tmp_path_factory) -> dict[str, Cold]:
    """Every command in a process of its own, with one kernel cache that starts empty."""
    folder: Path = tmp_path_factory.mktemp("cold")
    return {name: measured(name, folder, *FEW.get(name, ())) for name in COMMANDS}


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_uses_its_kernels_and_no_other_each_for_one_set_of_types(runs, name):
    assert runs[name].used == dict.fromkeys(KERNELS[name], 1)


@pytest.mark.slow
def test_no_kernel_is_compiled_by_two_commands(runs):
    kernels = set().union(*KERNELS.values())
    compiled = [kernel for run in runs.values() for kernel in run.compiled if kernel in kernels]
    assert sorted(compiled) == sorted(kernels)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_function_is_compiled_for_one_set_of_types_with_few_exceptions(runs, name):
    ours = {n: times for n, times in runs[name].compiled.items() if not n.startswith("numba.")}
    assert max(ours.values(), default=1) <= 2
    assert {n for n, times in ours.items() if times == 2} <= TWICE


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_kernels_ask_numba_for_little_of_its_own(runs, name):
    of_numba = [times for n, times in runs[name].compiled.items() if n.startswith("numba.")]
    assert sum(of_numba) <= OF_NUMBA


@pytest.fixture(scope="module")
def warm(tmp_path_factory) -> tuple[Path, Cold]:
    """A folder with a warm kernel cache, and what the warm-up did."""
    folder: Path = tmp_path_factory.mktemp("warm")
    return folder, recorded(["warmup", "--loads"], folder)


@pytest.mark.slow
def test_the_warm_up_compiles_every_kernel(warm):
    assert _kernels() <= warm[1].used.keys()


@pytest.mark.slow
def test_after_the_warm_up_no_command_of_the_readme_compiles_anything(warm):
    compiled = {" ".join(line): recorded(line, warm[0]).compiled for line in _of_readme()}
    assert len(compiled) >= 7
    assert {line: names for line, names in compiled.items() if names} == {}


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


def _of_readme() -> list[list[str]]:
    """The arguments of the commands in the README that end by themselves, with small clouds."""
    text = (ROOT / "README.md").read_text(encoding="utf-8").replace("400000", "2000")
    lines = [line.split("#")[0] for line in text.splitlines() if line.startswith("softreach ")]
    return [line.split()[1:] for line in [*lines, "softreach demo --out out --n 2000"]]
