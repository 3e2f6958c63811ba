"""Hulls of a cloud: ours beside SciPy's Qhull, in one run.

`python -m benchmarks.bench_geometry [n]` prints a Markdown table of time and peak memory, each row
measured in a process of its own; under pytest-benchmark the same work runs on a small cloud.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
import pytest

from benchmarks.memory import peak_bytes, reset_peak
from benchmarks.table import FOR_DEVELOPERS

if TYPE_CHECKING:
    from softreach.geometry.alpha_shape import AlphaComplex

ALPHA = 0.03
COUNTED = 4_000  # points of which tests are counted, by Python
CACHED = 64  # points that tests alone are of
FEW = 10_000  # points whose triangulation caches hold


def arm_cloud(n: int) -> np.ndarray:
    """Tips of a real arm: strongly non-convex, of very uneven density."""
    import softreach as sr

    arm = sr.designs.minimal_trunk()
    return sr.compute_cloud(arm, n=n, seed=0, sampler="uniform").tip.values


def ours(points: np.ndarray) -> float:
    """Alpha-shape volume by our own triangulation."""
    return _alpha_volume(_shape(points))


def scipy_route(points: np.ndarray) -> float:
    """Alpha-shape volume as one writes it with SciPy."""
    from scipy.spatial import Delaunay

    corners = points[Delaunay(points).simplices]
    edges = corners[:, 1:] - corners[:, :1]
    squares = (edges**2).sum(axis=2)
    crosses = np.cross(np.roll(edges, -1, axis=1), np.roll(edges, -2, axis=1))
    six_volumes = np.abs((edges[:, 0] * crosses[:, 0]).sum(axis=1))
    radii = np.linalg.norm((squares[..., None] * crosses).sum(axis=1), axis=1)
    return float(six_volumes[radii <= 2.0 * ALPHA * six_volumes].sum() / 6.0)


def ours_hull(points: np.ndarray) -> float:
    """The same with surface, regions and area, box by box on all threads."""
    from softreach.geometry.alpha_shape import alpha_hull

    return alpha_hull(points, ALPHA)[0].volume


def ours_with_bias(points: np.ndarray) -> float:
    """The estimate for infinitely many points, at a radius that the quarter cloud bears."""
    from softreach.cloud.volume import concave_hull

    return concave_hull(points, 0.05 if len(points) > 200_000 else 0.3, bias=True).volume_corrected


def qhull_kernels(points: np.ndarray) -> float:
    """SciPy's triangulation, our kernels after it."""
    from tests.oracles.qhull import delaunay

    from softreach.geometry.alpha_shape import AlphaComplex

    return _alpha_volume(AlphaComplex(triangulation=delaunay(points)))


def ours_curve(points: np.ndarray) -> float:
    """The volume at a thousand radii."""
    return float(_shape(points).volume(np.linspace(0.001, ALPHA, 1000))[-1])


def ours_critical(points: np.ndarray) -> float:
    """The volume at the smallest radius that leaves one region."""
    shape = _shape(points)
    return float(shape.volume(shape.critical_alpha()))


def ours_convex(points: np.ndarray) -> float:
    """Convex hull."""
    from softreach.cloud.volume import convex_hull

    return convex_hull(points).volume


def _alpha_volume(shape: AlphaComplex) -> float:
    return float(shape.volumes[shape.radii <= ALPHA].sum())


def _shape(points: np.ndarray) -> AlphaComplex:
    from softreach.geometry.alpha_shape import AlphaComplex, delaunay

    return AlphaComplex(triangulation=delaunay(points))


ROUTES: dict[str, tuple[str, Callable[[np.ndarray], float]]] = {
    "scipy": ("SciPy (Qhull), V(α)", scipy_route),
    "ours": ("softreach, V(α)", ours),
    "bias": ("softreach, hull and bias estimate at 0.05 L", ours_with_bias),
    "convex": ("softreach, convex hull", ours_convex),
    "hull": ("softreach, hull with surface and regions", ours_hull),
    "curve": ("softreach, V at 1000 radii", ours_curve),
    "qhull": ("SciPy's triangulation, our kernels after it", qhull_kernels),
    "critical": ("softreach, critical α and its V", ours_critical),
}
OF_DEVELOPERS = 4
"""So many of the last routes are not for the documentation."""


@pytest.mark.parametrize("name", ROUTES)
def test_hulls(benchmark, name):
    points = arm_cloud(4000)
    volume = benchmark(ROUTES[name][1], points)
    assert volume > 0
    if name in ("ours", "hull", "curve"):
        assert volume == pytest.approx(scipy_route(points), rel=1e-9)


def measure(name: str, n: int) -> dict[str, float]:
    """Time and peak memory of one route, in this process."""
    route = ROUTES[name][1]
    route(arm_cloud(1000))  # compile or load
    points = arm_cloud(n)
    before = reset_peak()
    wall, cpu = time.perf_counter(), time.process_time()
    volume = route(points)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return {"volume": volume, "wall": wall, "cpu": cpu, "memory": peak_bytes() - before}


def measured(name: str, n: int, repeat: int) -> dict[str, float]:
    """The fastest of some runs, each in a fresh process."""
    command = [sys.executable, "-m", "benchmarks.bench_geometry", str(n), "--route", name]
    runs = [
        json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        for _ in range(repeat)
    ]
    return min(runs, key=lambda run: run["cpu"])


def main(n: int = 400_000, repeat: int = 3, names: tuple[str, ...] = tuple(ROUTES)) -> None:
    """Print the table; ratios are of CPU seconds, which other work disturbs least."""
    print(f"## Hulls of {n:,} points, α = {ALPHA} L, the best of {repeat}\n")
    print("| route | V [L³] | wall [s] | CPU [s] | memory [GB] | times less CPU than SciPy |")
    print("|---|--:|--:|--:|--:|--:|")
    slowest = None
    for number, name in enumerate(names):
        if number == len(ROUTES) - OF_DEVELOPERS:
            print(FOR_DEVELOPERS)
        run = measured(name, n, repeat if name not in ("scipy", "qhull") else 1)
        slowest = slowest or run["cpu"]
        row = f"{run['volume']:.6f} | {run['wall']:.2f} | {run['cpu']:.2f} | "
        row += f"{run['memory'] / 1e9:.2f} | {slowest / run['cpu']:.1f}"
        print(f"| {ROUTES[name][0]} | {row} |", flush=True)
    print_roofline(n)


def print_roofline(n: int) -> None:
    """Print how much of the triangulation its arithmetic takes, and how much memory does."""
    from softreach.kernels.points.bowyer_watson import triangulate

    (flops, spheres), (plane_flops, planes) = counted_operations()
    work = spheres * flops + planes * plane_flops
    whole, near = (
        cpu_seconds(partial(triangulate, insertable(size), lambda: False)) / size
        for size in (n, FEW)
    )
    rounds = np.rint(np.array([spheres, planes]) * n / CACHED).astype(int).tolist()
    points = np.random.default_rng(0).random((CACHED, 3))
    alone = cpu_seconds(partial(kernel_of_tests(), points, *rounds)) / n
    print(
        f"\nA point that enters the triangulation takes {spheres:.0f} tests of a sphere and "
        f"{planes:.0f} of a plane (counted for {COUNTED:,}), {work:,.0f} operations, in "
        f"{1e6 * whole:.2f} µs of one core: {1e-9 * work / whole:.1f} GFLOP/s. These tests alone, "
        f"of {CACHED} points, run at {1e-9 * work / alone:.1f} GFLOP/s: {alone / whole:.0%} of the "
        f"time are arithmetic. Of {FEW:,} points, which caches hold, it takes {1e6 * near:.2f} µs: "
        f"{max(0.0, 1 - near / whole):.0%} at most are waiting for memory. The rest are walks, "
        "branches that no core foresees, and the making of cells."
    )


def insertable(n: int) -> np.ndarray:
    """Points of a cloud as they enter a triangulation."""
    from softreach.geometry.surface import unit_scale
    from softreach.kernels.points.bowyer_watson import insertion_order

    points = unit_scale(arm_cloud(n))[0]
    return points[insertion_order(points)]


def counted_operations() -> list[tuple[int, float]]:
    """Operations and number of tests of spheres and planes, counted without the compiler."""
    with tempfile.TemporaryDirectory() as folder:
        np.save(f"{folder}/points.npy", insertable(COUNTED))
        command = [sys.executable, "-m", "benchmarks.flops", f"{folder}/points.npy"]
        environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
        done = subprocess.run(command, env=environment, check=True, capture_output=True)
    found = json.loads(done.stdout)
    return [found["insphere_filter"], found["orient_filter"]]


def kernel_of_tests() -> Callable[[np.ndarray, int, int], float]:
    """A kernel of tests of spheres and planes through some points, so often of each."""
    from softreach.kernels.compiler import strict
    from softreach.kernels.points.predicates import insphere_filter, orient_filter

    @strict
    def tests(points, spheres, planes):
        total, n = 0.0, len(points)
        for k in range(spheres):
            for i in range(n):
                a, b, c, d = (i + k) % n, (i + 1) % n, (i + 2) % n, (i + 3) % n
                total += insphere_filter(points, a, b, c, d, (i + 4) % n)
        for k in range(planes):
            for i in range(n):
                total += orient_filter(points, (i + k) % n, (i + 1) % n, (i + 2) % n, (i + 3) % n)
        return total

    return tests


def cpu_seconds(run: Callable[[], object]) -> float:
    """CPU time of the faster of two runs, after one that compiles or loads [s]."""
    times = []
    for _ in range(3):
        start = time.process_time()
        run()
        times.append(time.process_time() - start)
    return min(times[1:])


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int, nargs="?", default=400_000)
    parser.add_argument("--route", choices=ROUTES)
    parser.add_argument("--repeat", type=int, default=3)
    asked = parser.parse_args()
    if asked.route:
        print(json.dumps(measure(asked.route, asked.n)))
    else:
        main(asked.n, asked.repeat)
