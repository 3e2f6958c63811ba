"""Laws of compilation."""

from __future__ import annotations

import importlib
import logging
import os
import pkgutil
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from numba import njit
from numba.core.dispatcher import Dispatcher

import softreach
import softreach.kernels.compiler
from softreach import kernels
from softreach.cli.first_run import compilation_announced
from softreach.kernels.compiler import FAST

SCRIPT = """
import hashlib
import numpy as np
import softreach as sr
from softreach.rod import tip_map

arm = sr.designs.redundant_trunk()
gamma = np.random.default_rng(0).uniform(-5 / 3, 0, (500, 4))
shape = sr.configuration(arm, gamma[:50])
results = (*tip_map(arm).tip_twists(gamma), sr.tip_positions(arm, gamma), shape.position.values)
for values in results:
    print(hashlib.sha256(values.tobytes()).hexdigest())
"""


@pytest.mark.slow
def test_the_run_that_compiles_has_the_numbers_of_those_that_load(tmp_path):
    def run() -> str:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
        command = [sys.executable, "-c", SCRIPT]
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        assert done.stderr == ""  # a library compiles in silence
        return done.stdout

    assert run() == run()


def test_whoever_listens_hears_what_is_compiled(caplog):
    def made_up(x):
        return x + 1

    made_up.__module__ = "softreach.made_up"
    with caplog.at_level(logging.INFO, "softreach.kernels.compiler"):
        njit(made_up)(1.0)
    assert "compiling softreach.made_up." in caplog.text


def test_the_command_line_announces_compilation_once(capsys):
    log = logging.getLogger("softreach.kernels.compiler")
    with compilation_announced():
        log.info("compiling one")
        log.info("compiling another")
    log.info("compiling after the command")
    assert capsys.readouterr().err.splitlines() == [
        "softreach: compiling kernels (first run only, then cached on disk)"
    ]


def compiled() -> Iterator[tuple[str, Dispatcher]]:
    """Every compiled function of the kernels."""
    for module in pkgutil.iter_modules(kernels.__path__, "softreach.kernels."):
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


@pytest.mark.parametrize(("name", "function"), [pytest.param(n, f, id=n) for n, f in compiled()])
def test_kernels_call_only_what_is_inlined_and_strict_functions_only_their_like(name, function):
    allowed = {"strict"} if kind(function) == "strict" else {"inline"}
    wrong = [f.py_func.__name__ for f in callees(function) if kind(f) not in allowed]
    assert not wrong, f"{name}, {kind(function)}, calls {wrong}"


def test_only_the_compiler_module_asks_numba_to_compile():
    root = Path(softreach.__file__).parent
    asks = re.compile(r"\b(n?jit|vectorize|guvectorize|cfunc|stencil)\b")
    found = [p for p in root.rglob("*.py") if asks.search(p.read_text(encoding="utf-8"))]
    assert found == [root / "kernels" / "compiler.py"]
