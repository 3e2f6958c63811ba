"""The demo, pictures of large clouds and of hulls, and the memory of large clouds."""

from __future__ import annotations

import contextlib
import io
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path

from benchmarks.memory import peak_bytes, reset_peak
from softreach import plot
from softreach.arm import designs
from softreach.cloud.clouds import compute_cloud, open_cloud, save_cloud
from softreach.cloud.volume import concave_hull
from softreach.plot.style import pyplot
from softreach.support.errors import SoftreachWarning

ALPHA = 0.05


def main(points: int = 2_000_000, tips: int = 50_000_000) -> None:
    """Print the tables."""
    print("## Demo, pictures and memory\n")
    print_demo()
    print_pictures(points)
    print_memory(tips)


def print_demo() -> None:
    """`softreach demo` in processes of its own, kernels compiled before."""
    command = [sys.executable, "-m", "softreach", "demo", "--json", "--out"]
    print("`softreach demo`, from the start of the process to its end, warm, the best of three:\n")
    print("| Threads | Wall [s] | CPU [s] | Wanted |\n|---|--:|--:|--:|")
    for threads in (1, 2):
        environment = os.environ | {"SOFTREACH_NUM_THREADS": str(threads)}

        def demo(environment: dict[str, str] = environment) -> None:
            with tempfile.TemporaryDirectory() as folder:
                run = [*command, folder]
                subprocess.run(run, check=True, env=environment, stdout=subprocess.DEVNULL)

        demo()
        wall, cpu = least(demo, resource.RUSAGE_CHILDREN)
        print(f"| {threads} | {wall:.1f} | {cpu:.1f} | {'6' if threads == 2 else ''} |")


def print_pictures(points: int) -> None:
    arm = designs.minimal_trunk()
    cloud, small = compute_cloud(arm, points), compute_cloud(arm, min(points, 400_000))
    hull = concave_hull(small.tip, ALPHA * arm.length)
    rows: dict[str, Callable[[], object]] = {
        f"one view of {points:,} points": lambda: plot.plot_cloud(cloud),
        f"four views of {points:,} points and the arm": lambda: plot.plot_views(cloud, arm),
        f"a hull of {len(hull.faces):,} faces": lambda: plot.plot_hull(hull),
    }
    print("\nPictures, not yet written to a file, the best of three:\n")
    print("| What | Wall [s] | CPU [s] | Wanted |\n|---|--:|--:|--:|")
    for what, draw in rows.items():
        wall, cpu = least(closing(draw))
        print(f"| {what} | {wall:.2f} | {cpu:.2f} | {'2' if 'points and' in what else ''} |")


def closing(draw: Callable[[], object]) -> Callable[[], None]:
    def run() -> None:
        draw()
        pyplot().close("all")

    return run


def least(work: Callable[[], object], who: int = resource.RUSAGE_SELF) -> tuple[float, float]:
    """Wall and CPU seconds, the least of three, as other work on the machine only adds."""
    costs = []
    for _ in range(3):
        wall, cpu = time.perf_counter(), cpu_seconds(who)
        work()
        costs.append((time.perf_counter() - wall, cpu_seconds(who) - cpu))
    walls, cpus = zip(*costs, strict=True)
    return min(walls), min(cpus)


def cpu_seconds(who: int) -> float:
    used = resource.getrusage(who)
    return used.ru_utime + used.ru_stime


def print_memory(tips: int) -> None:
    """Peak memory of the whole process, imports and kernels among it, beside the result's."""
    task = [sys.executable, "-m", "benchmarks.bench_pictures", "memory", str(tips)]
    found = json.loads(subprocess.run(task, stdout=subprocess.PIPE, text=True, check=True).stdout)
    size = found.pop("result")
    print(f"\nMemory of {tips:,} tips with their activations, {size / 2**20:,.0f} MB:\n")
    print("| What | Peak of the process [MB] | Times the result | Wanted |\n|---|--:|--:|--:|")
    for what, peak in found.items():
        print(f"| {what} | {peak / 2**20:,.0f} | {peak / size:.2f} | 1.3 |")


def memory(tips: int) -> dict[str, int]:
    """The bytes of a cloud, and the peaks of computing, saving and reading it."""
    arm, peaks = designs.minimal_trunk(), {}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "cloud.zarr"
        save_cloud(compute_cloud(arm, 20_000), path)
        reset_peak()
        cloud = compute_cloud(arm, tips)
        peaks["computing"] = peak_bytes()
        reset_peak()
        save_cloud(cloud, path)
        peaks["saving, the cloud in memory"] = peak_bytes()
        size = cloud.nbytes
        del cloud
        reset_peak()
        open_cloud(path)
        peaks["reading"] = peak_bytes()
    return {"result": size, **peaks}


def test_a_picture(benchmark):
    cloud = compute_cloud(designs.minimal_trunk(), 10_000)
    benchmark(closing(lambda: plot.plot_views(cloud)))


if __name__ == "__main__":
    warnings.simplefilter("ignore", SoftreachWarning)
    if sys.argv[1:2] == ["memory"]:
        with contextlib.redirect_stdout(io.StringIO()):
            told = memory(int(sys.argv[2]))
        print(json.dumps(told))
    else:
        main(*map(int, sys.argv[1:]))
