"""Laws of compilation."""

import importlib
import logging
import os
import pickle
import pkgutil
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numba
import numpy as np
import pytest
from numba import njit
from numba.core import caching
from numba.core.codegen import CPUCodegen
from numba.core.compiler_lock import global_compiler_lock as compiling
from numba.core.dispatcher import Dispatcher

import softreach
import softreach as sr
import softreach.kernels.compiler
from softreach import kernels
from softreach.cli.console import console
from softreach.kernels import parts
from softreach.kernels.compiler import FAST, CompilationWatch, kernel, strict

SCRIPT = """
import hashlib
import numpy as np
import softreach as sr
from softreach.rod import as_tip_map

arm = sr.designs.redundant_trunk()
gamma = np.random.default_rng(0).uniform(-5 / 3, 0, (500, 4))
results = (*as_tip_map(arm).tip_twists(gamma), sr.tip_positions(arm, gamma))
for values in results:
    print(hashlib.sha256(values.tobytes()).hexdigest())
"""


@pytest.mark.large
def test_runs_that_compile_at_once_have_the_numbers_of_those_that_load(tmp_path):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}

    def started() -> subprocess.Popen[str]:
        pipe = subprocess.PIPE
        command = [sys.executable, "-c", SCRIPT]
        return subprocess.Popen(command, env=environment, stdout=pipe, stderr=pipe, text=True)

    def numbers(run: subprocess.Popen[str]) -> str:
        out, errors = run.communicate()
        assert (errors, run.returncode) == ("", 0)  # a library compiles in silence
        return out

    first, second = [numbers(run) for run in (started(), started())]
    assert first == second == numbers(started())
    assert not list(tmp_path.rglob("*.tmp.*"))


def test_whoever_listens_hears_what_is_compiled(caplog):
    def made_up(x):
        return x + 1

    made_up.__module__ = "softreach.made_up"
    with caplog.at_level(logging.INFO, "softreach.kernels.compiler"):
        njit(made_up)(1.0)
    assert "compiling softreach.made_up." in caplog.text


def test_the_command_line_announces_compilation_once(capsys):
    log = logging.getLogger("softreach.kernels.compiler")
    with console.listening():
        log.info("compiling one")
        log.info("compiling another")
    log.info("compiling after the command")
    assert capsys.readouterr().err.splitlines() == [
        "softreach: compiling kernels (first run only, then cached on disk)"
    ]


def compiled() -> Iterator[tuple[str, Dispatcher]]:
    """Every compiled function of the kernels."""
    for module in pkgutil.walk_packages(kernels.__path__, "softreach.kernels."):
        names = vars(importlib.import_module(module.name))
        yield from (
            (f"{module.name}.{n}", f) for n, f in names.items() if isinstance(f, Dispatcher)
        )


def kind(function: Dispatcher) -> str:
    options = function.targetoptions
    if not options["fastmath"]:
        return "strict"
    assert options["fastmath"] == FAST
    pasted = options.get("inline") == "always"
    return "inline" if pasted or options.get("forceinline") else "kernel"


def callees(function: Dispatcher) -> Iterator[Dispatcher]:
    source = function.py_func
    for name in source.__code__.co_names:
        if isinstance(found := source.__globals__.get(name), Dispatcher):
            yield found


def test_kernels_call_only_what_is_inlined_and_strict_functions_only_their_like():
    functions = dict(compiled())
    bad = [
        f"{name}, {kind(function)}, calls {called.py_func.__name__}"
        for name, function in functions.items()
        for called in callees(function)
        if kind(called) != ("strict" if kind(function) == "strict" else "inline")
    ]
    assert len(functions) > 100
    assert bad == []


def test_only_the_compiler_module_asks_numba_to_compile():
    root = Path(softreach.__file__).parent
    asks = re.compile(r"\b(n?jit|vectorize|guvectorize|cfunc|stencil|\w*Dispatcher)\b")
    found = [p for p in root.rglob("*.py") if asks.search(p.read_text(encoding="utf-8"))]
    assert sorted(found) == [root / "kernels" / name for name in ("compiler.py", "parts.py")]


WITHOUT = """
from numba.core import typed_passes
del typed_passes.NativeLowering
import numpy as np
import softreach as sr
from softreach.kernels import compiler
assert compiler._PART is compiler._plain, "nothing is missing"
arm = sr.designs.minimal_trunk()
gamma = np.random.default_rng(0).uniform(-5 / 3, 0, (5, 3))
print(*(float(x).hex() for x in sr.tip_positions(arm, gamma).ravel()))
"""


@pytest.mark.large
def test_without_a_private_class_of_numba_kernels_are_compiled_plainly(tmp_path):
    script = [sys.executable, "-c", WITHOUT]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    run = subprocess.run(script, env=environment, capture_output=True, text=True, check=False)
    assert run.returncode == 0, run.stderr
    tips = np.array([float.fromhex(x) for x in run.stdout.split()]).reshape(-1, 3)
    gamma = np.random.default_rng(0).uniform(-5 / 3, 0, (5, 3))
    assert tips == pytest.approx(sr.tip_positions(sr.designs.minimal_trunk(), gamma), rel=1e-13)


def test_private_attributes_that_numba_lacks_are_named(monkeypatch):
    assert parts.missing() == []
    monkeypatch.delattr(CPUCodegen, "_module_pass_manager")
    monkeypatch.setattr(parts, "_PRIVATE", (*parts._PRIVATE, (CPUCodegen, ("_gone",))))
    assert parts.missing() == ["CPUCodegen._module_pass_manager", "CPUCodegen._gone"]


LOADING = """
import numpy as np
import softreach as sr
from numba.core.runtime import rtsys
sr.tip_positions(sr.designs.minimal_trunk(), np.zeros((1, 3)))
print(rtsys._init)
"""


def test_a_process_that_compiles_nothing_prepares_no_compiler():
    """The second of two processes at the latest finds all kernels."""
    script = [sys.executable, "-c", LOADING]
    runs = [subprocess.run(script, capture_output=True, text=True, check=True) for _ in range(2)]
    assert runs[1].stdout == "False\n"


def doubled(x):
    return x + x


@pytest.fixture
def cache(tmp_path, monkeypatch) -> Path:
    """The folder in which Numba caches."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path))
    return tmp_path


def in_a_new_process(compile_with=kernel) -> Dispatcher:
    """The function as another process finds it: not compiled yet, its cache on disk."""
    function = compile_with(doubled)
    assert function(2.5) == 5.0
    return function


def was_loaded(function: Dispatcher) -> bool:
    return sum(function.stats.cache_hits.values()) == 1


VERSION = pickle.dumps(numba.__version__)
DAMAGE = {
    "emptied": lambda whole: b"",
    "cut short": lambda whole: whole[: len(whole) // 2],
    "overwritten": lambda whole: b"\xff" * len(whole),
    "of a module that has moved": lambda whole: VERSION + b"csoftreach.moved\nThing\n.",
    "of a class that was renamed": lambda whole: VERSION + b"csoftreach.arm\nRenamed\n.",
}


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", DAMAGE.values(), ids=DAMAGE)
def test_a_cache_that_cannot_be_read_is_compiled_anew_and_replaced(cache, suffix, damage):
    in_a_new_process()
    (file,) = cache.rglob(f"*.{suffix}")
    file.write_bytes(damage(file.read_bytes()))
    assert not was_loaded(in_a_new_process())
    assert was_loaded(in_a_new_process())


def test_code_for_other_types_is_never_run(cache):
    function = kernel(doubled)
    assert (function(2.5), function(3)) == (5.0, 6)
    one, other = cache.rglob("*.nbc")
    swapped = other.read_bytes(), one.read_bytes()
    one.write_bytes(swapped[0])
    other.write_bytes(swapped[1])
    again: Any = kernel(doubled)
    assert (again(2.5), again(3)) == (5.0, 6)
    assert not again.stats.cache_hits


@pytest.mark.parametrize("compile_with", [kernel, strict])
def test_what_was_compiled_is_loaded_by_later_processes(cache, compile_with):
    assert not was_loaded(in_a_new_process(compile_with))
    assert was_loaded(in_a_new_process(compile_with))


def test_only_one_thread_at_a_time_readies_numba(cache, monkeypatch):
    """Another would compile with what is half loaded, and throw its cache away."""
    locked = []
    monkeypatch.setattr(parts, "_prepare_target", lambda: locked.append(compiling.is_locked()))
    assert kernel(doubled)(2.5) == 5.0
    assert locked == [True]


def test_a_cache_that_cannot_be_written_does_not_stop_the_computation(cache):
    function = kernel(doubled)
    shutil.rmtree(cache)
    cache.write_text("a file where the folder was")
    assert function(2.5) == 5.0


def test_without_any_folder_to_cache_in_kernels_work(monkeypatch):
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", [])
    assert not was_loaded(in_a_new_process())
    assert not was_loaded(in_a_new_process())


def test_compilation_is_told_when_it_begins_and_when_all_of_it_has_ended():
    told = []
    watch = CompilationWatch(lambda: told.append(bool(watch.running)))
    inner = njit(lambda x: x + 1)
    outer = njit(lambda x: 2 * inner(x))
    assert outer(1) == 4
    assert told == [True, False]
    assert outer(2) == 6
    assert told == [True, False]  # compiled already
    assert watch.done == 1
    watch.close()
    outer(1.5)
    assert told == [True, False]
