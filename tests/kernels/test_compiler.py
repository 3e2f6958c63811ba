"""Laws of compilation."""

from __future__ import annotations

import os
import subprocess
import sys

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


def test_the_run_that_compiles_has_the_numbers_of_those_that_load(tmp_path):
    def run() -> str:
        environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
        command = [sys.executable, "-c", SCRIPT]
        return subprocess.run(
            command, env=environment, check=True, capture_output=True, text=True
        ).stdout

    assert run() == run()
