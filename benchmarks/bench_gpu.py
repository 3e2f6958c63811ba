"""Tips, slopes and cells on a GPU beside the processor of the same machine.

    python -m benchmarks.bench_gpu

It needs a GPU, so that `make bench` does not run it; docs/clouds.md has what it printed.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from numba import cuda

import softreach as sr
from benchmarks.table import print_table
from softreach.cloud.cells import reached_cells
from softreach.kernels.rod import cuda as kernels
from softreach.rod.cuda import CudaRod, device_name
from softreach.rod.rods import as_tip_map

_TRUNK = sr.designs.redundant_trunk()
_LEFT = _TRUNK.actuators[0].replace(bundles=9)
ARMS = {
    "paper's trunk, 3 bundles": sr.designs.minimal_trunk(),
    "redundant trunk, 4 bundles": sr.designs.redundant_trunk(),
    "the same, 12 bundles": _TRUNK.replace(actuators=(_LEFT, *_TRUNK.actuators[1:])).with_bounds(
        [[-0.5, 0.0]] * 12
    ),
}
_N = 2_000_000


def _fastest(call: Callable[[], object], repeats: int = 7) -> float:
    """Seconds of the fastest of several calls, the first of which compiles and is not counted."""
    call()
    seconds = []
    for _ in range(repeats):
        begun = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - begun)
    return min(seconds)


def _errors() -> Iterator[dict[str, object]]:
    """Differences from the CPU's tips, slopes and twists, over L."""
    for name, arm in ARMS.items():
        on_cpu, on_gpu = as_tip_map(arm), as_tip_map(arm, device="cuda")
        cube = sr.rod.as_tip_map(arm).box.from_cube(
            np.random.default_rng(1).random((10_000, arm.inputs))
        )
        (tips, slopes), (other, moved) = (m.tips_and_slopes(cube) for m in (on_cpu, on_gpu))
        twists = on_gpu.tip_twists(cube)[1] - on_cpu.tip_twists(cube)[1]
        scale = np.abs(slopes).max()
        yield {
            "arm": name,
            "tips [L]": f"{np.abs(other - tips).max() / arm.length:.1e}",
            "slopes, of the largest": f"{np.abs(moved - slopes).max() / scale:.1e}",
            "twists, of the largest": f"{np.abs(twists).max() / scale:.1e}",
        }


def _rates() -> Iterator[dict[str, object]]:
    """Tips and slopes a second: kernels alone, with transfers, and on the CPU."""
    for name, arm in ARMS.items():
        seconds = _seconds(arm)
        yield {"arm": name, **{what: f"{_N / s:.2g}" for what, s in seconds.items()}}


def _seconds(arm: sr.Manipulator) -> dict[str, float]:
    on_cpu, on_gpu = as_tip_map(arm), as_tip_map(arm, device="cuda")
    gamma = on_cpu.box.from_cube(np.random.default_rng(2).random((_N, arm.inputs)))
    rod, inner = on_gpu.rod, on_gpu.inputs.activations(gamma)
    assert isinstance(rod, CudaRod)
    rod.prepare()
    given = [cuda.to_device(a) for a in (rod.packed, inner, rod.offset)]
    made = cuda.device_array((_N, 3)), cuda.device_array((_N, 3, inner.shape[1]))
    grid = -(-_N // kernels.THREADS), kernels.THREADS

    def on_card(derivatives: bool) -> None:
        kernels.walk(inner.shape[1], derivatives)[grid](*given, *made)
        cuda.synchronize()

    return {
        "tips a second, kernel": _fastest(lambda: on_card(False)),
        "slopes, kernel": _fastest(lambda: on_card(True)),
        "tips with transfers": _fastest(lambda: on_gpu.tips(gamma)),
        "tips, CPU": _fastest(lambda: on_cpu.tips(gamma), 3),
        "slopes, CPU": _fastest(lambda: on_cpu.tips_and_slopes(gamma), 3),
    }


def _cells(count: int) -> Iterator[dict[str, object]]:
    """Volumes of reached cells of two edges, to edge 0 linearly, beside the exact one."""
    arm = sr.designs.minimal_trunk()
    exact, volumes = sr.reachable_set(arm, accuracy=1e-4), list[float]()
    for share in (0.008, 0.004):
        begun = time.perf_counter()
        cells = reached_cells(arm, count, cell=share * arm.length, device="cuda")
        seconds = time.perf_counter() - begun
        volumes.append(cells.volume / arm.length**3)
        limit = 2.0 * volumes[-1] - volumes[0] if len(volumes) > 1 else np.nan
        yield {
            "samples": f"{count:.0e}",
            "edge [L]": share,
            "seconds": round(seconds, 2),
            "reached [L³]": round(volumes[-1], 5),
            "at edge 0 [L³]": round(limit, 5),
            "exact [L³]": f"{exact.volume / arm.length**3:.5f}",
            "convex hull [L³]": round(cells.convex_volume / arm.length**3, 5),
        }


def _whole(device: str) -> dict[str, object]:
    """A cloud of 100 million samples from the command to the store."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["cloud", "minimal_trunk", "--n", "100000000", "--out", f"{folder}/a.zarr"]
        begun = time.perf_counter()
        run = [sys.executable, "-m", "softreach", *command, "--device", device]
        done = subprocess.run(run, capture_output=True, text=True, cwd=folder, check=False)
        seconds = time.perf_counter() - begun
        size = sum(f.stat().st_size for f in Path(folder).rglob("*") if f.is_file())
        lines = [x for x in (done.stdout + done.stderr).splitlines() if "compute" in x]
        return {
            "device": device,
            "whole command [s]": round(seconds, 1),
            "of it to compute": " ".join(lines[-1:]).strip("│ ") or done.stderr[-300:],
            "written [GB]": round(size / 1e9, 2),
        }


def main() -> None:
    """Print every table."""
    print(f"{device_name()}, {os.cpu_count()} cores\n")
    print_table(_errors(), ["arm"])
    print()
    print_table(_rates(), ["arm"])
    print()
    for count in (1_000_000_000, 10_000_000_000):
        print_table(_cells(count))
        print()
    print_table((_whole(device) for device in ("cuda", "cpu")), ["device", "of it to compute"])


if __name__ == "__main__":
    main()
