"""Arms under load: tips, volumes and postures beside free arms, in one run.

`python -m benchmarks.bench_loads [n]` prints Markdown tables; under pytest-benchmark the same work
runs on few samples.
"""

from __future__ import annotations

import itertools
import math
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

import softreach as sr
from benchmarks import loads_peers
from benchmarks.bench_kernels import best_time, twelve_bundles
from benchmarks.table import FOR_DEVELOPERS, Row, print_table
from softreach.rod.free import FreeRod
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.tip_map import TipMap, TipStatus, has_tip
from softreach.support import parallel
from softreach.workspace import reachable_set

GRAVITY, DENSITY = 9.81, 1000.0
BASES = {"down": (0.0, 0.0, GRAVITY), "side": (GRAVITY, 0.0, 0.0), "up": (0.0, 0.0, -GRAVITY)}
SIDE = BASES["side"]
NEWTONS = 1.0
KINDS = {
    "gravity": sr.Loads(gravity=SIDE),
    "gravity and payload with a lever": sr.Loads(
        gravity=SIDE, payload=0.5, payload_arm=(0.05, 0.02, 0.1)
    ),
    "gravity and a force across it": sr.Loads(gravity=SIDE, tip_force=(0.0, NEWTONS, 0.0)),
    "gravity and a force that follows": sr.Loads(gravity=SIDE, follower_force=(NEWTONS, 0.0, 0.0)),
}
MARGIN = 0.02  # nearer to the loss of stability every error is magnified


def rubber(arm: sr.Manipulator, load_number: float, loads: sr.Loads) -> sr.Manipulator:
    """The arm of one heavy material, of which ρgL³/(E R2²) is the load number, under loads."""
    young = DENSITY * GRAVITY * arm.length**3 / (load_number * arm.profile.radius(0.0) ** 2)
    ring = arm.section.rings[0]
    material = ring.material.replace(young_modulus=float(young), density=DENSITY)
    section = arm.section.replace(rings=(ring.replace(material=material),))
    return arm.replace(section=section, loads=loads)


def trunk(load_number: float = 2.5, loads: sr.Loads = KINDS["gravity"], taper: float = 2.0):
    """The paper's trunk, heavy."""
    arm = sr.designs.minimal_trunk(math.radians(108), math.radians(taper))
    return rubber(arm, load_number, loads)


def six_bundles() -> sr.Manipulator:
    """The minimal trunk with two narrow bundles in each architecture."""
    arm = sr.designs.minimal_trunk()
    return arm.replace(actuators=tuple(f.replace(bundles=2, extent=0.4) for f in arm.fibers))


ARMS = {
    3: sr.designs.minimal_trunk,
    4: sr.designs.redundant_trunk,
    6: six_bundles,
    12: twelve_bundles,
}


def activations(rod: TipMap, n: int) -> np.ndarray:
    """The corners of the box where they are few, and others at random."""
    corners = rod.box.corners() if rod.box.bundles <= 6 else np.empty((0, rod.box.bundles))
    rest = np.random.default_rng(0).random((n - len(corners), rod.box.bundles))
    return np.concatenate([corners, rod.box.from_cube(rest)])


class Tips(NamedTuple):
    """What loaded tips cost beside free ones."""

    cpu: float
    """[s a tip]."""
    ratio: float
    """To a free tip."""
    wall: float
    """[s], all samples."""
    shares: np.ndarray
    """Of stable, unstable and missing tips."""


def loaded_and_free(arm: sr.Manipulator, n: int) -> Tips:
    """Tips with their status, of a loaded arm and of the same arm without loads."""
    loaded, free = LoadedRod(arm), FreeRod(arm)
    gamma = activations(loaded, n)
    status = loaded.status(gamma[:4096])  # compiles, and makes what is made once
    with_loads = best_time(lambda: loaded.equilibria(gamma), repeat=3)
    without = best_time(lambda: free.tips(gamma))
    shares = np.bincount(status, minlength=3) / len(status)
    return Tips(with_loads.cpu / n, with_loads.cpu / without.cpu, with_loads.wall, shares)


def main(n: int = 400_000) -> None:
    """Print the tables."""
    print(f"## Arms under load, tol = 1e-6, {parallel.thread_count()} threads\n")
    print("The paper's trunk of rubber, load number ρgL³/(E R2²) = 2.5, gravity across its base.\n")
    _tip_table(n)
    _peer_table()
    print(FOR_DEVELOPERS)
    _volume_table()
    _bundle_table(n // 10)
    _posture_table()


def _tip_table(n: int) -> None:
    def row(name: str, loads: sr.Loads) -> Row:
        arm = trunk(loads=loads)
        found = loaded_and_free(arm, n)
        return {
            "load": name,
            "CPU [µs a tip]": f"{1e6 * found.cpu:.2f}",
            "times a free tip": f"{found.ratio:.0f}",
            f"wall [s], {n:,} tips": f"{found.wall:.2f}",
        }

    print_table(itertools.starmap(row, KINDS.items()), words=["load"])


def _volume_table(accuracy: float = 3e-3) -> None:
    print("\n### Exact volume of the reachable set\n")
    loaded, free = trunk(), trunk().replace(loads=None)
    cpu = {}

    def row(name: str, arm: sr.Manipulator) -> Row:
        reachable_set(arm, accuracy=0.05)
        found = reachable_set(arm, accuracy=accuracy)
        cpu[name] = best_time(lambda: reachable_set(arm, accuracy=accuracy), repeat=3).cpu
        return {
            "arm": name,
            "V [L³]": f"{found.volume:.5f}",
            "±": f"{found.volume_error:.1e}",
            "CPU [s]": f"{cpu[name]:.3f}",
            "times the free arm": f"{cpu[name] / cpu['free']:.1f}",
        }

    print_table((row(*each) for each in (("free", free), ("loaded", loaded))), words=["arm"])


def _bundle_table(n: int) -> None:
    print(f"\n### Growth with bundles, {n:,} tips under gravity\n")
    print("With more than four free bundles no grid of equilibria is made to begin from.\n")

    def row(bundles: int, make: Callable[[], sr.Manipulator]) -> Row:
        arm = rubber(make(), 2.5, KINDS["gravity"])
        found = loaded_and_free(arm, n)
        return {
            "bundles": bundles,
            "steps": LoadedRod(arm).steps,
            "CPU [µs a tip]": f"{1e6 * found.cpu:.2f}",
            "times a free tip": f"{found.ratio:.0f}",
        }

    print_table(itertools.starmap(row, ARMS.items()))


def _posture_table(n: int = 2048) -> None:
    print(f"\n### Postures of {n:,} activations with all corners\n")
    print(
        "Steps that the rule chose; error against twice the steps; shares of samples whose posture"
    )
    print(
        "is stable, that are unstable, that snap before, and that were not followed to their end.\n"
    )
    places = itertools.product((0, 2, 3), (0.1, 1, 2.5, 5, 8, 12), BASES)
    print_table((_posture_row(*place, n) for place in places), words=["base"])


def _posture_row(taper: float, load_number: float, base: str, n: int) -> Row:
    arm = trunk(load_number, sr.Loads(gravity=BASES[base]), taper)
    loaded, free = LoadedRod(arm), FreeRod(arm)
    gamma = activations(loaded, n)
    loaded.prepare()  # makes the grid
    cost = best_time(lambda: loaded.equilibria(gamma), repeat=2).cpu
    cost /= best_time(lambda: free.tips(gamma)).cpu
    found = loaded.equilibria(gamma)
    ends = {
        "stable": TipStatus.STABLE,
        "unstable": TipStatus.UNSTABLE,
        "snaps": TipStatus.SNAPS,
        "undecided": TipStatus.UNDECIDED,
    }
    return {
        "φ": f"{taper}°",
        "load number": f"{load_number:g}",
        "base": base,
        "steps": loaded.steps,
        "times a free tip": f"{cost:.0f}",
        **{name: f"{np.mean(found.status == end):.2%}" for name, end in ends.items()},
        "error [L]": f"{_error(loaded, gamma, found):.1e}",
    }


def _error(loaded: LoadedRod, gamma: np.ndarray, found: sr.rod.Equilibria) -> float:
    """Largest tip error [L], where the arm is not about to lose its stability."""
    settled = has_tip(found.status) & (np.abs(found.margin) > MARGIN)
    finer = replace(loaded.solver, steps=2 * loaded.solver.steps).near(
        gamma[settled], found.of(settled)
    )
    apart = np.linalg.norm(finer.tips - found.tips[settled], axis=1)
    return float(np.nanmax(apart)) / loaded.length


def _peer_table(n: int = 6) -> None:
    """The same shapes by SciPy."""
    arm = trunk()
    loaded = LoadedRod(arm)
    gamma = activations(loaded, n + 8)[8:]
    ours = loaded.equilibria(gamma).tips
    each = loaded_and_free(arm, 50_000).cpu
    print(f"\n### The same {n} shapes by SciPy, to 1e-6, on one thread\n")

    def row(name: str, cpu: float, apart: str) -> Row:
        return {
            "method": name,
            "CPU [ms a shape]": f"{1e3 * cpu:.4g}",
            "times ours": f"{cpu / each:,.0f}",
            "largest difference of tips [L]": apart,
        }

    def rows() -> Iterator[Row]:
        yield row("softreach", each, "")
        for name, solve in loads_peers.METHODS.items():
            cpu, tips = _timed(solve, arm, gamma)
            apart = float(np.linalg.norm(tips - ours, axis=1).max()) / arm.length
            yield row(name, cpu, f"{apart:.1e}")

    print_table(rows(), words=["method"])


def _timed(solve: Callable[..., np.ndarray], arm, gamma) -> tuple[float, np.ndarray]:
    """CPU time [s] of each shape, and all tips."""
    start = time.process_time()
    tips = np.array([solve(arm, one) for one in gamma])
    return (time.process_time() - start) / len(gamma), tips


@pytest.mark.parametrize("name", KINDS)
def test_loaded_tips(benchmark, name):
    rod = LoadedRod(trunk(loads=KINDS[name]))
    benchmark(rod.equilibria, activations(rod, 2_000))


@pytest.mark.parametrize("name", loads_peers.METHODS)
def test_peers_find_the_same_shapes(name):
    arm = trunk()
    gamma = activations(LoadedRod(arm), 9)[8:]
    tips = [loads_peers.METHODS[name](arm, one) for one in gamma]
    np.testing.assert_allclose(tips, LoadedRod(arm).tips(gamma), atol=3e-6)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 400_000)
