"""The reachable volume beside the routes through a point cloud, in one run.

`python benchmarks/bench_workspace.py [n]` prints a Markdown table; under pytest-benchmark the same
work runs on a small cloud.
"""

from __future__ import annotations

import argparse
import math
import time
import warnings
from collections.abc import Callable
from functools import partial
from itertools import count
from multiprocessing import get_context

import pytest

import softreach as sr
from benchmarks.memory import peak_bytes, reset_peak
from benchmarks.table import FOR_DEVELOPERS
from benchmarks.tasks import family_arm
from softreach.arm.parameters import changed, parameters
from softreach.rod.rods import as_tip_map
from softreach.support.parallel import undivided
from softreach.workspace import reachable_set

ALPHA = 0.03
NARROW = (
    *(("trunk", (-0.9, -0.3)), ("trunk", (-1.6, -0.3)), ("trunk", (-5 / 3, 0.0))),
    *(("laboratory arm", (-3.0, -1.0)), ("laboratory arm", (-2.0, 0.0))),
)
DERIVED = (*NARROW, ("redundant trunk", None), ("six bundles", None))
PARAMETERS = 4, 10
MANY = (
    *(("trunk", 1e-2), ("trunk", 3e-3), ("five", 1e-2), ("five", 3e-3)),
    *(("six", 1e-2), ("six", 3e-3), ("twelve", 5e-2), ("twelve", 1e-2)),
)


def cloud(arm: sr.Manipulator, n: int) -> None:
    """The tips alone: what any route through a cloud pays first."""
    sr.compute_cloud(arm, n=n)


def alpha_shape(arm: sr.Manipulator, n: int) -> float:
    """Volume of the alpha shape of n tips."""
    from softreach.geometry.alpha_shape import AlphaComplex, delaunay

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
    print(f"## Reachable sets: minimal trunk, cloud of {n:,} tips, fastest of {repeat}\n")
    print("| route | V [L³] | wall [s] |")
    print("|---|--:|--:|")
    results = {name: timed(name, arm, n, repeat) for name in ROUTES}
    for name, (wall, volume) in results.items():
        shown = f"{volume:.5f}" if volume is not None else ""
        print(f"| {name} | {shown} | {wall:.3f} |")
    print("\n### Four bundles and more\n")
    print("| bundles | accuracy | V [L³] | wall [s] | adds to memory [MB] |")
    print("|--:|--:|--:|--:|--:|")
    for name, accuracy in MANY:
        print(many_row(name, accuracy))
    print(FOR_DEVELOPERS)
    print("\n| design, bounds | route | V [L³] | error | CPU [ms] | raster |")
    print("|---|---|--:|--:|--:|--:|")
    for name, bounds in NARROW:
        print(route_row(name, bounds, repeat))
    print(
        "\nDerivatives of the volume by the first parameters of a design that is new each time, its"
    )
    print(f"set included: CPU time on one thread, the fastest of {repeat}.\n")
    print("| design, bounds | route | 4 parameters [ms] | 10 parameters [ms] | wanted [ms] |")
    print("|---|---|--:|--:|--:|")
    for name, bounds in DERIVED:
        print(derivatives_row(name, bounds, repeat))


def route_row(name: str, bounds: tuple[float, float], repeat: int) -> str:
    """How long the route takes that is found, and the raster alone."""
    from softreach.workspace.reach import rasterized_set

    arm = bounded_arm(name, bounds)
    rod = as_tip_map(arm)
    found = reachable_set(rod)
    work: tuple[Callable[[], object], ...] = (
        lambda: reachable_set(rod),
        lambda: rasterized_set(rod, found.cells, None, 3e-3),
    )
    whole, raster = (1e3 * cpu_seconds(each, repeat) for each in work)
    volume, error = (value / arm.length**3 for value in (found.volume, found.volume_error))
    return (
        f"| {shown_name(name, bounds)} | {getattr(found, 'route', '')} "
        f"| {volume:.9f} | {error:.1e} | {whole:.0f} | {raster:.0f} |"
    )


def derivatives_row(name: str, bounds: tuple[float, float] | None, repeat: int) -> str:
    """How long the derivatives of one design take."""
    arm = bounded_arm(name, bounds)
    names = [each.name for each in parameters(arm).values() if not each.whole]
    radius = float(arm.profile.radius(0.0))
    arms = (changed(arm, {"outer_radius": radius * (1.0 + 1e-4 * k)}) for k in count())
    times = []
    with undivided():
        route = sr.volume_gradient(arm, names[:1]).route
        for number in PARAMETERS:
            few = names[:number]
            times.append(
                1e3 * cpu_seconds(lambda few=few: sr.volume_gradient(next(arms), few), repeat)
            )
    wanted = 100 if route == "flux" else 1000
    return f"| {shown_name(name, bounds)} | {route} | {times[0]:.0f} | {times[1]:.0f} | {wanted} |"


def shown_name(name: str, bounds: tuple[float, float] | None) -> str:
    """The name of a design, and its bounds unless they are its own."""
    return name if bounds is None else f"{name}, {bounds[0]:g} to {bounds[1]:g}"


def bounded_arm(name: str, bounds: tuple[float, float] | None) -> sr.Manipulator:
    """A design of the tables between bounds, or at its own."""
    arm = {
        "trunk": sr.designs.minimal_trunk,
        "laboratory arm": sr.designs.lce_arm,
        "redundant trunk": sr.designs.redundant_trunk,
        "six bundles": partial(family_arm, "six"),
    }[name]()
    return arm if bounds is None else arm.with_bounds(bounds)


def cpu_seconds(work: Callable[[], object], repeat: int) -> float:
    """CPU time of the fastest of some runs [s]."""
    fastest = math.inf
    for _ in range(repeat):
        start = time.process_time()
        work()
        fastest = min(fastest, time.process_time() - start)
    return fastest


def many_row(name: str, accuracy: float) -> str:
    """A row for one design with many bundles, in a process of its own."""
    with get_context("spawn").Pool(1) as pool:
        bundles, volume, error, wall, peak = pool.apply(many, (name, accuracy))
    return (
        f"| {bundles} | {accuracy:g} | {volume:.4f} ± {error:.4f} | {wall:.1f} | {peak / 1e6:.0f} |"
    )


def many(name: str, accuracy: float) -> tuple[int, float, float, float, int]:
    """Bundles, volume and its error [m³], time [s] and memory [bytes] of one search."""
    arm = sr.designs.redundant_trunk() if name == "trunk" else family_arm(name)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reachable_set(arm, accuracy=0.2)  # compile or load
        before, start = reset_peak(), time.perf_counter()
        found = reachable_set(arm, accuracy=accuracy)
    wall = time.perf_counter() - start
    return arm.bundles, found.volume, found.volume_error, wall, peak_bytes() - before


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int, nargs="?", default=400_000)
    parser.add_argument("--repeat", type=int, default=5)
    asked = parser.parse_args()
    main(asked.n, asked.repeat)
