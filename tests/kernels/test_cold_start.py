"""What a first run compiles: as little as can be, and nothing that crept in."""

import importlib
import pkgutil
import re
import shutil

import pytest
from benchmarks.bench_cold import COMMANDS, ROOT, measured, recorded

from softreach import kernels
from softreach.kernels.parts import KernelDispatcher

ROD = {"tips._tips"}
SLOPES = ROD | {"slopes._slopes"}
HULL = {"bowyer_watson._sort_keys", "bowyer_watson._insert"}
HULL |= {f"alpha.{name}" for name in ("measure_cells", "boundary_faces", "join_regions")}
REACH = {"raster.stretches", "raster.critical_triangles"}
REACH |= {f"raster.{name}" for name in ("most_crossings", "crossings", "add_counts")}
MESH = {"activation_mesh.interpolation_errors", "activation_mesh.face_planes"}
OF_NEWTON = ("newton_step", "conditions", "merge_equal", "second_preimages")
NEWTON = {"candidates._find_starts", *(f"newton.{name}" for name in OF_NEWTON)}
KERNELS = {
    "cloud": ROD,
    "volume": ROD | HULL,
    "reach": SLOPES | REACH,
    "solve": SLOPES | MESH | NEWTON,
    "demo": ROD | HULL | {"frames.frames", "triangles.fill_triangles"},
}
"""The kernels of each command, every one for one set of types."""

TWICE = {
    "vector.combination",  # of twists and of vectors
    "vector.cross",  # `inline` and `strict`
    "bowyer_watson._reflect",  # with low bits of two types
}
"""Functions that are compiled for two sets of types."""

OF_NUMBA = 20
"""Functions of Numba itself that a command may compile: each costs a twentieth of a second."""

FEW = ("--n", "2000")
WARM_UP = "warmup"
CRITICAL = "volume minimal_trunk --n 5000 --alpha critical"  # its cells are joined one by one
LATER = (
    CRITICAL,
    "design lce_arm",
    "show lce_arm --n 500 --color compliance --out a.png",
    "export lce_arm a.stl --payload 1g",
    "reach redundant_trunk --accuracy 0.2 --out a.png --overwrite",
    "reach lce_arm --base x --payload 1g --accuracy 0.2 --out b.stl",
    "payload lce_arm --gravity up --payloads 1g --accuracy 0.2",
    "gradient lce_arm taper --accuracy 0.2",
    "solve redundant_trunk --target 0.2,0.1,0.6 --family 3",
    "solve lce_arm --payload 1g --target 0.02,0.01,0.06",
    "equilibria lce_arm --payload 1g",
    "cloud lce_arm --n 500 --set loads.follower_force[1]=1mN --payload 1g",
    "atlas build a.zarr --design lce_arm --payload 1g --vary taper_deg=0:1:2 --n 500 --alpha 0.5L",
    "paper --quick --out paper",
)
"""Commands that need kernels for other types, or what few need."""


@pytest.mark.large
def test_nothing_is_compiled_after_a_warm_up(tmp_path):
    """Kernels of all tests from here on: most have been compiled already."""
    warm_up = recorded(WARM_UP.split(), tmp_path, own_cache=False)
    assert _kernels() <= warm_up.used.keys()
    shutil.copytree(ROOT / "examples", tmp_path, dirs_exist_ok=True)
    runs = [recorded(line.split(), tmp_path, own_cache=False) for line in (*_of_readme(), CRITICAL)]
    assert len(runs) >= 6
    assert [run.compiled for run in runs if run.compiled] == []
    for run in runs:
        for kernel, types in run.used.items():
            assert set(types) <= set(warm_up.used[kernel]), kernel


@pytest.mark.large
def test_a_first_run_compiles_its_kernels_once(tmp_path):
    """Every command in a process of its own, with one kernel cache that starts empty."""
    few = {name: FEW for name in ("cloud", "volume", "demo")}
    runs = {name: measured(name, tmp_path, *few.get(name, ())) for name in COMMANDS}
    used = {
        n: {kernel: len(types) for kernel, types in run.used.items()} for n, run in runs.items()
    }
    assert used == {name: dict.fromkeys(KERNELS[name], 1) for name in COMMANDS}

    for name, run in runs.items():
        again = {f: times for f, times in run.compiled.items() if times > 1 and not of_numba(f)}
        assert set(again.values()) <= {2}, name
        assert again.keys() <= TWICE, name
        assert sum(t for f, t in run.compiled.items() if of_numba(f)) <= OF_NUMBA, name

    kernels = set().union(*KERNELS.values())
    compiled = [f for run in runs.values() for f in run.compiled if f in kernels]
    assert sorted(compiled) == sorted(kernels)


@pytest.mark.large
def test_no_command_compiles_after_a_warm_up_of_an_empty_cache(tmp_path):
    pytest.importorskip("matplotlib")
    assert recorded(WARM_UP.split(), tmp_path).compiled
    compiled = {line: recorded(line.split(), tmp_path).compiled for line in LATER}
    assert compiled == {line: {} for line in LATER}


def of_numba(name: str) -> bool:
    return name.startswith("numba.")


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
