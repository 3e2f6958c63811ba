"""An atlas beside the sum of its parts, each run alone, in one process per row."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

from softreach import designs
from softreach.atlas import DesignSpace, build_atlas
from softreach.atlas.metrics import METRICS, hull_metrics, image_metrics
from softreach.errors import SoftreachWarning
from softreach.kinematics import tip_positions
from softreach.sampling import sample_cube


def space(side: int) -> DesignSpace:
    turns, tapers = np.radians(np.linspace(0, 108, side)), np.radians(np.linspace(0, 3, side))
    return DesignSpace.grid(designs.minimal_trunk(), revolution=turns, taper=tapers)


def parts(side: int, n: int) -> None:
    """Every design's tips, volumes and hulls, one after the other, nothing stored."""
    family, cube = space(side), sample_cube("uniform", n, 3)
    for index in range(family.size):
        arm = family.design(index)
        tips = tip_positions(arm, arm.bounds[:, 0] + cube * np.diff(arm.bounds)[:, 0])
        image_metrics(arm, 1e-6, 3e-3)
        hull_metrics(arm, tips, 0.1, ("extent", "concave"))


def whole(side: int, n: int) -> None:
    groups = tuple(name for name in METRICS if name != "curvature")
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "atlas.zarr"
        build_atlas(space(side), store, n, alpha=0.1, metrics=groups)
        size = sum(file.stat().st_size for file in store.rglob("*") if file.is_file())
    print(json.dumps({"bytes": size / side**2}))


def row(task: str, side: int, n: int) -> None:
    """Run one task twice, the first to compile, and report the second."""
    work = {"parts": parts, "atlas": whole}[task]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)
        parts(1, 1_000) if task == "parts" else whole(2, 1_000)
        wall, cpu = time.perf_counter(), time.process_time()
        work(side, n)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(json.dumps({"wall": time.perf_counter() - wall, "cpu": time.process_time() - cpu}))
    print(json.dumps({"peak": peak}))


def main(side: int = 4, n: int = 10_000) -> None:
    """Print the table."""
    print(f"## Atlas: {side} x {side} designs, {n:,} points\n")
    print("| Threads | What | Wall [s] | CPU [s] | Designs/min | Peak [MB] | Store [kB/design] |")
    print("|---|---|---|---|---|---|---|")
    for threads in (1, 2):
        for task in ("parts", "atlas"):
            found = measured(task, side, n, threads)
            rate = 60 * side**2 / found["wall"]
            size = f"{found['bytes'] / 1e3:.0f}" if "bytes" in found else ""
            times = f"{found['wall']:.1f} | {found['cpu']:.1f}"
            print(f"| {threads} | {task} | {times} | {rate:.0f} | {found['peak']:.0f} | {size} |")


def measured(task: str, side: int, n: int, threads: int) -> dict[str, float]:
    command = [sys.executable, "-m", "benchmarks.bench_atlas", task, str(side), str(n)]
    environment = os.environ | {"SOFTREACH_NUM_THREADS": str(threads)}
    said = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    return {k: v for line in said.stdout.splitlines() for k, v in json.loads(line).items()}


def test_an_atlas(benchmark, tmp_path):
    stores = (tmp_path / f"{k}.zarr" for k in range(1_000_000))
    options = {"n": 500, "alpha": 1.0, "metrics": ("extent", "concave")}
    benchmark(lambda: build_atlas(space(2), next(stores), **options))


if __name__ == "__main__":
    if len(sys.argv) == 4:
        row(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
    else:
        main(*map(int, sys.argv[1:]))
