"""All branches of the inverse problem, beside SciPy from the nearest point of a cloud.

`python -m benchmarks.bench_inverse [n]` prints a Markdown table with the share of the original
activations that each finds; under pytest-benchmark the same work runs on few targets.
"""

from __future__ import annotations

import sys
import time
from functools import lru_cache, partial

import numpy as np
import pytest

from benchmarks.table import FOR_DEVELOPERS

DESIGNS = [(108, 2), (75, 3), (36, 3), (0, 0)]
FEW = 300  # targets for SciPy, whose time for one does not depend on their number


def trunk(revolution: float, taper: float):
    import softreach as sr

    return sr.designs.minimal_trunk(np.radians(revolution), np.radians(taper))


@lru_cache(maxsize=1)
def prepared(arm):
    """Solver and cloud: neither's preparation is timed with the targets."""
    from scipy.spatial import KDTree

    from softreach.inverse import prepared_map, solve_inverse
    from softreach.rod.kinematics import tip_positions

    solver = partial(solve_inverse, prepared_map(arm))
    solver(targets_of(arm, 5_000)[1])  # few are searched by other kernels than many
    cloud = np.random.default_rng(9).uniform(*arm.bounds.T, (100_000, 3))
    return solver, cloud, KDTree(tip_positions(arm, cloud))


def targets_of(arm, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Random activations and their tips."""
    from softreach.rod.kinematics import tip_positions

    gamma = np.random.default_rng(0).uniform(*arm.bounds.T, (n, 3))
    return gamma, tip_positions(arm, gamma)


def by_scipy(arm, targets: np.ndarray) -> np.ndarray:
    """One solution for each target: least_squares with the exact Jacobian."""
    from scipy.optimize import least_squares

    from softreach.rod import as_tip_map

    rod = as_tip_map(arm)
    _, cloud, tree = prepared(arm)
    starts = cloud[tree.query(targets)[1]]
    found = np.empty_like(starts)
    for i, (start, target) in enumerate(zip(starts, targets, strict=True)):
        found[i] = least_squares(
            lambda x, target=target: rod.tips_and_slopes(x[None])[0][0] - target,
            start,
            jac=lambda x: rod.tips_and_slopes(x[None])[1][0],
            bounds=arm.bounds.T,
            xtol=1e-12,
            ftol=1e-12,
            gtol=1e-12,
        ).x
    return found


def timed(work) -> tuple[object, float, float]:
    """Result, wall and CPU time."""
    wall, cpu = time.perf_counter(), time.process_time()
    result = work()
    return result, time.perf_counter() - wall, time.process_time() - cpu


def row(revolution: float, taper: float, n: int) -> str:
    """One design's line of the table."""
    arm = trunk(revolution, taper)
    solver, *_ = prepared(arm)
    gamma, targets = targets_of(arm, n)
    solutions, wall, cpu = timed(lambda: solver(targets))
    target = np.repeat(np.arange(n), solutions.counts)
    apart = np.full(n, np.inf)
    np.minimum.at(apart, target, np.abs(solutions.activations - gamma[target]).max(axis=1))
    theirs, _, their_cpu = timed(lambda: by_scipy(arm, targets[:FEW]))
    hit = (np.abs(theirs - gamma[:FEW]).max(axis=1) < 1e-6).mean()
    return (
        f"| {revolution}°, {taper}° | {n / wall:,.0f} | {1e6 * cpu / n:.1f} | "
        f"{int((apart > 1e-6).sum())} of {n} | {1e6 * their_cpu / FEW:,.0f} | {1 - hit:.1%} |"
    )


HEAD = """## Inverse: every branch, beside least_squares of SciPy from the nearest of 100,000 tips

| Ω, φ | targets/s | CPU [µs/target] | missed | SciPy, CPU [µs/target] | missed |
|---|--:|--:|--:|--:|--:|"""


REDUNDANT = [
    ("least change", {}),
    ("pose of a known activation", {"direction": "known"}),
    ("family of three", {"family": 3}),
]


def redundant_row(name: str, options: dict, n: int) -> str:
    """One question asked of four bundles."""
    import softreach as sr
    from softreach.inverse import prepared_map, solve_inverse

    arm = sr.designs.redundant_trunk()
    gamma = np.random.default_rng(0).uniform(*arm.bounds.T, (n, 4))
    targets = sr.tip_positions(arm, gamma)
    if options.get("direction") == "known":
        options = {"direction": sr.rod.as_tip_map(arm).tip_directions(gamma)}
    solver = partial(solve_inverse, prepared_map(arm), **options)
    solver(targets)
    solutions, wall, cpu = timed(lambda: solver(targets))
    return (
        f"| {name} | {1e3 * cpu / n:.2f} | {1e3 * wall / n:.2f} | {solutions.counts.mean():.2f} | "
        f"{solutions.residuals.max() / arm.length:.0e} |"
    )


REDUNDANT_HEAD = """
### Inverse: four bundles

| question | CPU ms/target | wall ms/target | activations | residual, L |
|---|--:|--:|--:|--:|"""


MANY_HEAD = """
## Inverse: many bundles, random tips and random places within 1.2 L

| bundles | CPU [µs/target] | targets/s | out of reach | proved | CPU [ms/place] |
|--:|--:|--:|--:|--:|--:|"""


def many_row(bundles: int, n: int) -> str:
    """Least change of so many bundles, and proofs that places are out of reach."""
    from benchmarks.adversarial_inverse import random_design
    from softreach.inverse import Status, prepared_map, solve_inverse

    solver = partial(solve_inverse, prepared_map(random_design(bundles, bundles - 3)))
    prepared, rng = solver.args[0], np.random.default_rng(0)
    box = prepared.whole.box
    targets = prepared.whole.tips(rng.uniform(box.low, box.high, (n, bundles)))
    places = rng.uniform(-1.2, 1.2, (n // 10, 3))
    solver(places[:2])
    _, wall, cpu = timed(lambda: solver(targets))
    away, _, long = timed(lambda: solver(places))
    out = away.statuses != Status.REACHED
    return (
        f"| {bundles} | {1e6 * cpu / n:,.0f} | {n / wall:,.0f} | "
        f"{out.sum()} | "
        f"{(away.statuses == Status.UNREACHABLE).sum()} | {1e3 * long / len(places):.2f} |"
    )


def main() -> None:
    """Print the tables."""
    n = int(sys.argv[1]) if len(sys.argv) > 1 and sys.argv[1].isdigit() else 100_000
    print(HEAD)
    for revolution, taper in DESIGNS:
        print(row(revolution, taper, n), flush=True)
    print(MANY_HEAD)
    for bundles in (4, 5, 6, 12):
        print(many_row(bundles, min(n, 2000)), flush=True)
    print(FOR_DEVELOPERS)
    print(REDUNDANT_HEAD)
    for name, options in REDUNDANT:
        print(redundant_row(name, options, min(n, 1000)), flush=True)


@pytest.mark.benchmark(group="inverse")
def test_every_branch(benchmark):
    arm = trunk(108, 2)
    solver, *_ = prepared(arm)
    targets = targets_of(arm, 2000)[1]
    assert (benchmark(solver, targets).counts >= 1).all()


@pytest.mark.benchmark(group="inverse")
def test_least_change_with_a_direction(benchmark):
    import softreach as sr

    arm = sr.designs.redundant_trunk()
    tip_map = sr.rod.as_tip_map(arm)
    known = np.random.default_rng(0).uniform(*arm.bounds.T, (20, 4))
    pose = {"direction": tip_map.tip_directions(known)}
    assert (benchmark(sr.solve_inverse, arm, tip_map.tips(known), **pose).counts == 1).all()


@pytest.mark.benchmark(group="inverse")
def test_least_squares_from_the_nearest_cloud_point(benchmark):
    arm = trunk(108, 2)
    prepared(arm)
    targets = targets_of(arm, 10)[1]
    assert benchmark(by_scipy, arm, targets).shape == (10, 3)


if __name__ == "__main__":
    main()
