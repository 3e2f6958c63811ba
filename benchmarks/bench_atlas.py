"""An atlas beside the sum of its parts, each run alone; one process for each measurement."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.memory import peak_bytes
from benchmarks.table import FOR_DEVELOPERS
from softreach.arm import designs
from softreach.atlas import DesignSpace, build_atlas
from softreach.atlas.metrics import METRIC_GROUPS, Intermediates, Need, chosen_metrics
from softreach.atlas.space import Command
from softreach.atlas.store import AtlasStore
from softreach.support.errors import SoftreachWarning

ALPHA, ACCURACY, TOL = 0.05, 3e-3, 1e-6
PARTS = {
    "tips": "tips",
    "exact": "exact volume, its hull and UNR",
    "concave": "α-shape, convex hull and UNR",
    "convex": "convex hull alone",
    "curvature": "curvature",
    "writing": "writing to the store",
}
GROUPS = {
    "concave": tuple(METRIC_GROUPS),
    "convex": tuple(name for name in METRIC_GROUPS if name != "concave"),
}
"""What the atlas holds with α-shapes and without."""

Times = dict[str, list[float]]


def space(rows: int, columns: int) -> DesignSpace:
    turns, tapers = np.radians(np.linspace(0, 108, rows)), np.radians(np.linspace(0, 3, columns))
    return DesignSpace.grid(designs.minimal_trunk(), revolution=turns, taper=tapers)


def parts(rows: int, columns: int, n: int, _: str = "") -> Times:
    """Wall and CPU seconds of every part of every design, one after the other."""
    command = Command(
        space=space(rows, columns),
        n=n,
        seed=0,
        sampler="uniform",
        tol=TOL,
        alpha_over_length=ALPHA,
        accuracy=ACCURACY,
        metrics=chosen_metrics(tuple(METRIC_GROUPS)),
        keep_clouds=True,
    )
    times: Times = defaultdict(lambda: [0.0, 0.0])
    with tempfile.TemporaryDirectory() as folder:
        store = AtlasStore.begin(Path(folder) / "atlas.zarr", command)
        for index in range(command.space.size):
            one_design(store, index, times)
    return dict(times)


def one_design(store: AtlasStore, index: int, times: Times) -> None:
    command = store.command
    arm, sizes = command.space.design(index), command.profile_sizes
    alone = replace(command, metrics=())
    found = Intermediates(arm, store.cube, alone)
    shared = Intermediates(arm, store.cube, command)
    values = {}

    def measure(part: str, results: Intermediates, *groups: str) -> None:
        with clock(times[part]):
            for metric in chosen_metrics(groups):
                values[metric.name] = metric.value(results, sizes)

    with clock(times["tips"]):
        tips = found[Need.TIPS]
    shared[Need.TIPS]
    measure("exact", found, "exact")
    measure("convex", found, "extent", "convex", "stability")
    measure("concave", shared, "extent", "convex", "concave")
    measure("curvature", found, "curvature")
    with clock(times["writing"]):
        store.write(index, values, tips)


@contextmanager
def clock(total: list[float]) -> Iterator[None]:
    """Add the wall and CPU seconds of a block."""
    wall, cpu = time.perf_counter(), time.process_time()
    yield
    total[0] += time.perf_counter() - wall
    total[1] += time.process_time() - cpu


def atlas(rows: int, columns: int, n: int, kind: str) -> dict[str, float]:
    """Seconds, peak memory [MB] and store size [MB per design] of the whole."""
    total = [0.0, 0.0]
    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "atlas.zarr"
        with clock(total):
            build_atlas(
                space(rows, columns), store, n, alpha_over_length=ALPHA, metrics=GROUPS[kind]
            )
        size = sum(file.stat().st_size for file in store.rglob("*") if file.is_file())
    peak = peak_bytes() / 2**20
    return {"wall": total[0], "cpu": total[1], "peak": peak, "size": size / 1e6 / (rows * columns)}


def run(task: str, *arguments: str) -> None:
    """Run a task in this process, after a small one that loads and compiles."""
    work, (rows, columns, n, kind) = {"parts": parts, "atlas": atlas}[task], arguments
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", SoftreachWarning)
        work(1, 2, 1_000, kind)
        print(json.dumps(work(int(rows), int(columns), int(n), kind)))


def measured(threads: int, *task: object) -> dict:
    """What a task says in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.bench_atlas", *map(str, task)]
    environment = os.environ | {"SOFTREACH_NUM_THREADS": str(threads)}
    return json.loads(
        subprocess.run(
            command, stdout=subprocess.PIPE, text=True, check=True, env=environment
        ).stdout
    )


def main(side: int = 4, n: int = 400_000) -> None:
    """Print the tables."""
    print(f"## Atlas: {side} x {side} designs of {n:,} points\n")
    print_atlas(side, n)
    print(FOR_DEVELOPERS)
    print_parts(measured(1, "parts", side, side, n, "-"), side**2)
    print_memory(side, n)


def print_parts(alone: Times, designs: int) -> None:
    print("Every part run alone, on one thread:\n")
    print("| Part | Wall [s/design] | CPU [s/design] |\n|---|---|---|")
    for name, told in PARTS.items():
        wall, cpu = (seconds / designs for seconds in alone[name])
        print(f"| {told} | {wall:.2f} | {cpu:.2f} |")


def print_atlas(side: int, n: int) -> None:
    print("| α-shapes | threads | wall [s] | designs/min | store [MB/design] | peak [MB] |")
    print("|---|---|---|---|---|---|")
    for kind, shown in (("concave", "yes"), ("convex", "no")):
        for threads in (1, 2):
            found = measured(threads, "atlas", side, side, n, kind)
            rate = 60 * side**2 / found["wall"]
            print(f"| {shown} | {threads} | {found['wall']:.1f} | {rate:.1f} |", end="")
            print(f" {found['size']:.2f} | {found['peak']:.0f} |")


def print_memory(side: int, n: int) -> None:
    """Designs of a tenth of the points: what grows with their number would show sooner."""
    points = n // 10
    print(f"\nPeak memory with {points:,} points, α-shapes and two threads:\n")
    print("| Designs | Peak [MB] |\n|---|---|")
    for rows in (1, side, 4 * side):
        found = measured(2, "atlas", rows, side, points, "concave")
        print(f"| {rows * side} | {found['peak']:.0f} |")


def study(designs_in_all: int = 10_000, share: int = 240) -> None:
    """Print what a study of exact metrics takes on a Dask cluster of this machine, by processes."""
    print(f"## {designs_in_all:,} designs, exact metrics, on Dask processes of one thread\n")
    print(
        "| Processes | Designs | Wall [s] | CPU [s/design] | Designs/min | Of one process |", end=""
    )
    print(" Store [kB/design] | This process [MB] |\n|---|---|---|---|---|---|---|---|")
    alone = None
    for processes, count in ((1, share), (2, share), (4, share), (4, designs_in_all)):
        found = json.loads(
            subprocess.run(
                [
                    sys.executable,
                    "-m",
                    "benchmarks.bench_atlas",
                    "dask",
                    str(processes),
                    str(count),
                ],
                stdout=subprocess.PIPE,
                text=True,
                check=True,
            ).stdout
        )
        rate = 60 * count / found["wall"]
        alone = alone or rate
        print(
            f"| {processes} | {count:,} | {found['wall']:.0f} | {found['cpu'] / count:.3f} |",
            end="",
        )
        print(f" {rate:.0f} | {rate / alone:.2f} | {found['size']:.1f} |", end="")
        print(f" {found['peak']:.0f} |", flush=True)


def on_dask(processes: int, count: int) -> dict[str, float]:
    """Seconds of a study spread evenly, the workers' with them, and its store."""
    from distributed import Client, LocalCluster

    family = DesignSpace.sampled(
        designs.minimal_trunk(),
        count,
        revolution=np.radians([0.0, 108.0]),
        taper=np.radians([0.0, 3.0]),
    )
    with (
        tempfile.TemporaryDirectory() as folder,
        LocalCluster(n_workers=processes, threads_per_worker=1, dashboard_address=None) as cluster,
        Client(cluster) as client,
    ):
        client.run(one_small_design)  # loads and compiles
        before, begin = sum(client.run(time.process_time).values()), time.perf_counter()
        store = Path(folder) / "study.zarr"
        build_atlas(family, store, 1_000, metrics=("exact",), keep_clouds=False, executor=client)
        wall = time.perf_counter() - begin
        cpu = sum(client.run(time.process_time).values()) - before
        size = sum(file.stat().st_size for file in store.rglob("*") if file.is_file())
    return {"wall": wall, "cpu": cpu, "peak": peak_bytes() / 2**20, "size": size / 1e3 / count}


def one_small_design() -> None:
    with tempfile.TemporaryDirectory() as folder:
        build_atlas(space(1, 1), Path(folder) / "a.zarr", 1_000, metrics=("exact",))


def test_an_atlas(benchmark, tmp_path):
    stores = (tmp_path / f"{k}.zarr" for k in range(1_000_000))
    options = {"n": 500, "alpha_over_length": 1.0, "metrics": ("extent", "concave")}
    benchmark(lambda: build_atlas(space(2, 2), next(stores), **options))


if __name__ == "__main__":
    if sys.argv[1:2] in (["parts"], ["atlas"]):
        run(*sys.argv[1:])
    elif sys.argv[1:2] == ["dask"]:
        print(json.dumps(on_dask(*map(int, sys.argv[2:]))))
    elif sys.argv[1:2] == ["study"]:
        study(*map(int, sys.argv[2:]))
    else:
        main(*map(int, sys.argv[1:]))
