"""Laws of compilation."""

from __future__ import annotations

import logging
import os
import subprocess
import sys

import pytest
from numba import njit

import softreach.kernels.compiler  # noqa: F401  (it listens to the compiler)
from softreach.cli.first_run import compilation_announced

SCRIPT = """
import hashlib
import numpy as np
import softreach as sr
from softreach.rod.kinematics import tips_and_jacobians

arm = sr.designs.redundant_trunk()
gamma = np.random.default_rng(0).uniform(-5 / 3, 0, (500, 4))
shape = sr.configuration(arm, gamma[:50])
results = (*tips_and_jacobians(arm, gamma), sr.tip_positions(arm, gamma), shape.position.values)
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
