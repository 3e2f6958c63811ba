"""Arms under load: tips, volumes and the ladder to equilibria beside free arms, in one run.

`python -m benchmarks.bench_loads [n]` prints Markdown tables; under pytest-benchmark the same work
runs on few samples.
"""

from __future__ import annotations

import itertools
import math
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

import softreach as sr
from benchmarks import loads_peers
from benchmarks.bench_kernels import best_time, twelve_bundles
from softreach.rod.free import FreeRod
from softreach.rod.loaded.rod import LoadedRod
from softreach.rod.loaded.shooting import Rung
from softreach.rod.tip_map import TipMap, TipStatus
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
WANTED = {"gravity": 40, "gravity and a force across it": 60}


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
    _volume_table()
    _bundle_table(n // 10)
    _ladder_table()
    _peer_table()


def _tip_table(n: int) -> None:
    print("| load | steps | CPU [µs a tip] | times a free tip | wanted | unstable, none |", end="")
    print(f" wall [s], {n:,} tips |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for name, loads in KINDS.items():
        arm = trunk(loads=loads)
        row, steps = loaded_and_free(arm, n), LoadedRod(arm).steps
        wanted = f"≤ {WANTED[name]}" if name in WANTED else ""
        print(
            f"| {name} | {steps} | {1e6 * row.cpu:.2f} | {row.ratio:.0f} | {wanted} "
            f"| {row.shares[1]:.2%}, {row.shares[2]:.2%} | {row.wall:.2f} |",
            flush=True,
        )


def _volume_table(accuracy: float = 3e-3) -> None:
    print("\n### Exact volume of the reachable set\n")
    print("| arm | V [L³] | ± | CPU [s] | times the free arm |")
    print("|---|--:|--:|--:|--:|")
    loaded = trunk()
    free = None
    for name, arm in (("free", loaded.replace(loads=None)), ("loaded", loaded)):
        reachable_set(arm, accuracy=0.05)
        found = reachable_set(arm, accuracy=accuracy)
        cpu = best_time(lambda arm=arm: reachable_set(arm, accuracy=accuracy), repeat=3).cpu
        free = free or cpu
        print(
            f"| {name} | {found.volume:.5f} | {found.volume_error:.1e} | {cpu:.3f} "
            f"| {cpu / free:.1f} |",
            flush=True,
        )


def _bundle_table(n: int) -> None:
    print(f"\n### Growth with bundles, {n:,} tips under gravity\n")
    print("With more than four free bundles no grid of equilibria is made to begin from.\n")
    print("| bundles | steps | CPU [µs a tip] | times a free tip |")
    print("|--:|--:|--:|--:|")
    for bundles, make in ARMS.items():
        arm = rubber(make(), 2.5, KINDS["gravity"])
        row = loaded_and_free(arm, n)
        steps = LoadedRod(arm).steps
        print(f"| {bundles} | {steps} | {1e6 * row.cpu:.2f} | {row.ratio:.0f} |", flush=True)


def _ladder_table(n: int = 2048) -> None:
    print(f"\n### The ladder to an equilibrium, {n:,} activations with all corners\n")
    print("Steps that the rule chose; error against twice the steps; shares of samples that the")
    print("rungs of the ladder found, and of those that are unstable or have no equilibrium.\n")
    print(
        "| φ | load number | base | steps | times a free tip | at once | continued | patient "
        "| unstable | none | error [L] |"
    )
    print("|--:|--:|---|--:|--:|--:|--:|--:|--:|--:|--:|")
    for taper, load_number, base in itertools.product((0, 2, 3), (0.1, 1, 2.5, 5, 8, 12), BASES):
        arm = trunk(load_number, sr.Loads(gravity=BASES[base]), taper)
        print(f"| {taper}° | {load_number:g} | {base} | {_ladder_row(arm, n)} |", flush=True)


def _ladder_row(arm: sr.Manipulator, n: int) -> str:
    loaded, free = LoadedRod(arm), FreeRod(arm)
    gamma = activations(loaded, n)
    loaded.solver  # noqa: B018  makes the grid
    cost = best_time(lambda: loaded.solver.find(gamma), repeat=2).cpu
    cost /= best_time(lambda: free.tips(gamma)).cpu
    found = loaded.solver.find(gamma)
    rungs = np.bincount(found.rung, minlength=len(Rung)) / n
    status = np.bincount(found.status, minlength=len(TipStatus)) / n
    shares = " | ".join(f"{share:.2%}" for share in (*rungs[:3], *status[1:]))
    return f"{loaded.steps} | {cost:.0f} | {shares} | {_error(loaded, gamma, found):.1e}"


def _error(loaded: LoadedRod, gamma: np.ndarray, found: sr.rod.Equilibria) -> float:
    """Largest tip error [L], where the arm is not about to lose its stability."""
    settled = (found.status != TipStatus.NO_EQUILIBRIUM) & (np.abs(found.margin) > MARGIN)
    finer = loaded.solver.halved().near(gamma[settled], found.of(settled))
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
    print("| method | CPU [ms a shape] | times ours | largest difference of tips [L] |")
    print("|---|--:|--:|--:|")
    print(f"| softreach | {1e3 * each:.4f} | 1 | |")
    for name, solve in loads_peers.METHODS.items():
        cpu, tips = _timed(solve, arm, gamma)
        apart = float(np.linalg.norm(tips - ours, axis=1).max()) / arm.length
        print(f"| {name} | {1e3 * cpu:.1f} | {cpu / each:,.0f} | {apart:.1e} |", flush=True)


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
