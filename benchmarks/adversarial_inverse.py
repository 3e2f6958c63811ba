"""Tips of activations inside the box, solved back: none may be missed, none changes too much.

`python -m benchmarks.adversarial_inverse [n] [designs]` draws designs of three to twelve bundles,
after five that were found hard, and for each n tips of activations inside the box, on faces and on
edges, and n corners or all there are. It prints how many targets were not reached, how many
activations of least change exceed the one drawn, and the time; the activations that were missed go
to the error stream, to the last bit.

`python -m benchmarks.adversarial_inverse boundary [n]` solves tips of faces, edges and corners that
were computed a hundred times as exactly as by the map that solves them, for tolerances from 1e-3 to
1e-9, free and hanging with a payload, with bounds of both signs: n tips for each of these.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from dataclasses import replace
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


def bounded_design(bundles: int, seed: int, *, loaded: bool):
    """A random design whose bundles only contract, only extend, or do both; hanging if loaded."""
    import softreach as sr

    rng, arm = np.random.default_rng(seed), random_design(bundles, seed)
    low, width = rng.choice([-0.9, -0.4, 0.1], bundles), rng.uniform(0.2, 0.7, bundles)
    arm = arm.with_bounds(np.stack([low, low + width], axis=1))
    if not loaded:
        return arm
    rubber = sr.Material(young_modulus=1e6, density=1000.0, poisson_ratio=0.45)
    rings = tuple(replace(ring, material=rubber) for ring in arm.section.rings)
    payload = rng.uniform(0.05, 1.0) * (arm.profile.radius(1.0) / 0.06) ** 4
    loads = sr.Loads(gravity=(0.0, 0.0, 9.81), payload=float(payload))
    return arm.replace(section=replace(arm.section, rings=rings), loads=loads)


def boundary_tips(arm, n: int, tol: float, seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Activations on faces, edges and corners, and their tips, a hundredth of `tol` exact."""
    import softreach as sr

    parts = [activations(arm, -(-n // 3), place, seed) for place in PLACES[1:]]
    gamma = np.concatenate(parts)[:n]
    tips = sr.tip_positions(arm, gamma, tol=tol / 100)
    known = np.isfinite(tips[:, 0])
    return gamma[known], tips[known]


def boundary_row(bundles: int, tol: float, n: int, seed: int, *, loaded: bool) -> str:
    """What was refused of tips on the boundary of the box."""
    from softreach.inverse import Status, solve_inverse

    arm = bounded_design(bundles, seed, loaded=loaded)
    gamma, targets = boundary_tips(arm, n, tol, seed)
    begin = time.process_time()
    found = solve_inverse(arm, targets, tol=tol)
    cpu = time.process_time() - begin
    for missed in gamma[found.statuses != Status.REACHED]:
        print(f"{arm!r}, tol {tol:g}: missed {missed.tolist()}", file=sys.stderr, flush=True)
    counts = np.bincount(found.statuses, minlength=len(Status))
    unreachable, lost = counts[Status.UNREACHABLE], counts[Status.NOT_FOUND]
    worst = found.gaps.max(initial=0.0) / (tol * arm.length)
    return (
        f"| {bundles} | {'hanging' if loaded else 'free'} | {tol:.0e} | {len(gamma)} | "
        f"{unreachable} | {lost} | {worst:.2f} | {1e3 * cpu / max(len(gamma), 1):,.1f} |"
    )


def row(arm, n: int, place: str) -> str:
    """What was missed of the tips from one part of the box."""
    from softreach.inverse import Status, prepared_map, solve_inverse

    prepared = prepared_map(arm)
    gamma = activations(arm, n, place)
    targets = prepared.whole.tips(gamma)
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


def print_boundary(n: int) -> None:
    """Print the table of tips on the boundary of the box."""
    names = ("bundles", "arm", "tol", "tips", "unreachable", "not found", "gap, tol")
    names += ("CPU ms/target",)
    print(f"| {' | '.join(names)} |\n|--:|---|{'--:|' * (len(names) - 2)}")
    cases = product((False, True), (3, 4, 5, 6, 7, 8), (1e-3, 1e-5, 1e-6, 1e-7, 1e-9))
    for seed, (loaded, bundles, tol) in enumerate(cases):
        print(boundary_row(bundles, tol, n, seed, loaded=loaded), flush=True)


def main() -> None:
    """Print the table."""
    if sys.argv[1:2] == ["boundary"]:
        print_boundary(int((sys.argv[2:] or ["50"])[0]))
        return
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
