"""Tips of activations inside the box, solved back: none may be missed, none changes too much.

`python -m benchmarks.adversarial_inverse [n] [designs]` draws designs of three to twelve bundles,
after five that were found hard, and for each n tips of activations inside the box, on faces and on
edges, and n corners or all there are. It prints how many targets were not reached, how many
activations of least change exceed the one drawn, and the time; the activations that were missed go
to the error stream, to the last bit.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from itertools import chain, product

import numpy as np

PLACES = ("interior", "faces", "edges", "corners")


def random_design(bundles: int, seed: int):
    """An arm of so many bundles in architectures of one to three."""
    import softreach as sr

    rng, fibers, left = np.random.default_rng(seed), [], bundles
    while left:
        count = min(left, int(rng.integers(1, 4)))
        extent = rng.uniform(0.2, min(0.9, 1.8 * np.pi / bundles))
        fiber = sr.FiberArchitecture(
            revolution=rng.uniform(-2.0, 2.0),
            offset=rng.uniform(0.0, 2 * np.pi),
            extent=extent,
            bundles=count,
        )
        fibers.append(fiber)
        left -= count
    radius = rng.uniform(0.05, 0.08)
    return sr.Manipulator.tapered(
        length=1.0,
        outer_radius=radius,
        inner_radius=radius * rng.uniform(0.3, 0.8),
        taper=np.radians(rng.uniform(0.0, 2.0)),
        poisson_ratio=rng.uniform(0.3, 0.5),
        actuators=tuple(fibers),
        activation_bounds=(-rng.uniform(0.4, 1.2), rng.uniform(0.0, 0.2)),
    )


def hard_designs() -> Iterator:
    """Arms whose tips were missed once: they curl past a full circle or have many bundles."""
    import softreach as sr
    from benchmarks.tasks import family_arm

    yield sr.Manipulator.tapered(
        length=1.0,
        outer_radius=0.05,
        inner_radius=0.02,
        poisson_ratio=0.5,
        actuators=(
            sr.FiberArchitecture(
                revolution=0.0, extent=np.radians(80), offset=np.radians(10), bundles=3
            ),
        ),
        activation_bounds=(-1.2, 0.6),
    )
    yield sr.designs.redundant_trunk()
    yield from map(family_arm, ("five", "six", "twelve"))


def activations(arm, n: int, place: str, seed: int = 0) -> np.ndarray:
    """Random activations inside the box, on faces of any dimension, on edges or at corners."""
    rng, m = np.random.default_rng(seed), arm.bundles
    if place == "corners" and 1 << m <= n:
        return np.array(list(product(*arm.bounds)))
    inside, corner = rng.uniform(*arm.bounds.T, (n, m)), rng.integers(0, 2, (n, m))
    free = {
        "interior": np.full(n, m),
        "faces": rng.integers(min(2, m - 1), m, n),
        "edges": np.ones(n, int),
        "corners": np.zeros(n, int),
    }[place]
    order = rng.random((n, m)).argsort(axis=1).argsort(axis=1)
    return np.where(order < free[:, None], inside, np.take_along_axis(arm.bounds.T, corner, 0))


def row(arm, n: int, place: str) -> str:
    """What was missed of the tips from one part of the box."""
    from softreach.inverse import Status, prepared_map, solve_inverse

    prepared = prepared_map(arm)
    gamma = activations(arm, n, place)
    targets = prepared.rod.tips(gamma)
    solve_inverse(prepared, targets[:2])
    begin, cpu = time.perf_counter(), time.process_time()
    found = solve_inverse(prepared, targets)
    wall, cpu = time.perf_counter() - begin, time.process_time() - cpu
    hit = np.flatnonzero(found.statuses == Status.REACHED)
    for missed in gamma[found.statuses != Status.REACHED]:
        print(f"{arm!r}: missed {missed.tolist()}", file=sys.stderr, flush=True)
    counts = np.bincount(found.statuses, minlength=len(Status))
    size = np.linalg.norm(found.activations, axis=1)
    least = np.minimum.reduceat(size, found.offsets[hit]) if len(hit) else np.empty(0)
    own = np.linalg.norm(gamma[hit], axis=1)
    larger = int((least > own * (1 + 1e-6) + 1e-9).sum()) if arm.bundles > 3 else 0
    gap = found.gaps.max() / arm.length
    n, unreachable, lost = len(gamma), counts[Status.UNREACHABLE], counts[Status.NOT_FOUND]
    return (
        f"| {arm.bundles} | {place} | {n} | {unreachable} | {lost} | {gap:.0e} | "
        f"{larger} | {1e6 * cpu / n:,.0f} | {n / wall:,.0f} |"
    )


def main() -> None:
    """Print the table."""
    numbers = [int(a) for a in sys.argv[1:]]
    n, count = [*numbers, *(1000, 20)[len(numbers) :]][:2]
    names = ("bundles", "activations", "tips", "unreachable", "not found", "gap, L")
    names += ("larger than drawn", "CPU µs/target", "targets/s")
    print(f"| {' | '.join(names)} |\n|--:|---|{'--:|' * (len(names) - 2)}")
    for arm in chain(hard_designs(), (random_design(3 + k % 10, k) for k in range(count))):
        for place in PLACES:
            print(row(arm, n, place), flush=True)


if __name__ == "__main__":
    main()
