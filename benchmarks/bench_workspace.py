"""The reachable volume beside the routes through a point cloud, in one run.

`python benchmarks/bench_workspace.py [n]` prints a Markdown table; under pytest-benchmark the same
work runs on a small cloud.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Callable

import pytest

import softreach as sr
from softreach.workspace import reachable_set

ALPHA = 0.03


def cloud(arm: sr.Manipulator, n: int) -> None:
    """The tips alone: what any route through a cloud pays first."""
    sr.compute_cloud(arm, n=n)


def alpha_shape(arm: sr.Manipulator, n: int) -> float:
    """Volume of the alpha shape of n tips."""
    from softreach.geometry.alpha_shape import AlphaComplex
    from softreach.geometry.delaunay import delaunay

    tips = sr.compute_cloud(arm, n=n).tip.values
    return float(AlphaComplex(triangulation=delaunay(tips)).volume(ALPHA))


def reach(accuracy: float) -> Callable[[sr.Manipulator, int], float]:
    """Volume of the reachable set; no cloud, so n is not used."""

    def route(arm: sr.Manipulator, n: int) -> float:
        del n
        return reachable_set(arm, accuracy=accuracy).volume

    return route


def surface(arm: sr.Manipulator, n: int) -> float:
    """The same with the closed surface."""
    del n
    return reachable_set(arm).surface().volume


ROUTES: dict[str, Callable[[sr.Manipulator, int], float | None]] = {
    "cloud alone": cloud,
    "alpha shape of the cloud": alpha_shape,
    "reachable set, 0.3 %": reach(3e-3),
    "reachable set, 0.1 %": reach(1e-3),
    "reachable set, 0.3 %, and its surface": surface,
}


@pytest.mark.parametrize("name", ROUTES)
def test_reachable_volume(benchmark, name):
    volume = benchmark(ROUTES[name], sr.designs.minimal_trunk(), 4000)
    if name.startswith("reachable"):
        assert volume == pytest.approx(0.69164, rel=3e-3)


def timed(name: str, arm: sr.Manipulator, n: int, repeat: int) -> tuple[float, float | None]:
    """The fastest of some runs [s], and the volume."""
    route, fastest, volume = ROUTES[name], float("inf"), None
    for _ in range(repeat):
        start = time.perf_counter()
        volume = route(arm, n)
        fastest = min(fastest, time.perf_counter() - start)
    return fastest, volume


def main(n: int = 400_000, repeat: int = 5) -> None:
    """Print the table."""
    arm = sr.designs.minimal_trunk()
    for route in ROUTES.values():
        route(arm, 2000)  # compile or load
    print(f"Minimal trunk, Ω = 108°, φ = 2°; cloud of {n:,} tips; fastest of {repeat}\n")
    print("| route | V [L³] | wall [s] | times the cloud alone | of the alpha shape |")
    print("|---|--:|--:|--:|--:|")
    results = {name: timed(name, arm, n, repeat) for name in ROUTES}
    one, whole = results["cloud alone"][0], results["alpha shape of the cloud"][0]
    for name, (wall, volume) in results.items():
        shown = f"{volume:.5f}" if volume is not None else ""
        print(f"| {name} | {shown} | {wall:.3f} | {wall / one:.1f} | 1/{whole / wall:.1f} |")
    redundant = sr.designs.redundant_trunk()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        start = time.perf_counter()
        four = reachable_set(redundant)
    wall = time.perf_counter() - start
    print(f"\nRedundant trunk: {four.volume:.4f} ± {four.volume_error:.4f} L³ in {wall:.2f} s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int, nargs="?", default=400_000)
    parser.add_argument("--repeat", type=int, default=5)
    asked = parser.parse_args()
    main(asked.n, asked.repeat)
