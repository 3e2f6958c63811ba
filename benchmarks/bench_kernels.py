"""Tips: our kernel beside the processor's multiply-add rate and a compiled Tsit5, in one run."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest

import softreach as sr
from benchmarks import tsit5
from benchmarks.table import FOR_DEVELOPERS
from softreach import designs
from softreach.kernels.compiler import FAST
from softreach.rod.free import FreeRod
from softreach.support import parallel

_WIDTH = 64


def _fma_kernel():
    """Ten independent chains of multiply-adds, which fill two pipelines of four cycles each."""
    from numba import njit

    flags = FAST - {"reassoc"}
    inline = njit(forceinline=True, nogil=True, fastmath=flags)

    @inline
    def one(v, x, y):
        a, b, c, d, e, f, g, h, i, j = v
        low = a * x + y, b * x + y, c * x + y, d * x + y, e * x + y
        return (*low, f * x + y, g * x + y, h * x + y, i * x + y, j * x + y)

    @inline
    def four(v, x, y):
        return one(one(one(one(v, x, y), x, y), x, y), x, y)

    @inline
    def sixteen(v, x, y):
        return four(four(four(four(v, x, y), x, y), x, y), x, y)

    @njit(nogil=True, fastmath=flags)
    def chains(values, rounds, x, y):
        for _ in range(rounds):
            for i in range(_WIDTH):
                v = (
                    values[i],
                    values[_WIDTH + i],
                    values[2 * _WIDTH + i],
                    values[3 * _WIDTH + i],
                    values[4 * _WIDTH + i],
                    values[5 * _WIDTH + i],
                    values[6 * _WIDTH + i],
                    values[7 * _WIDTH + i],
                    values[8 * _WIDTH + i],
                    values[9 * _WIDTH + i],
                )
                v = sixteen(sixteen(v, x, y), x, y)
                total = (v[0] + v[1]) + (v[2] + v[3]) + (v[4] + v[5]) + (v[6] + v[7])
                values[i] = total + (v[8] + v[9])

    return chains


def fma_rate(rounds: int = 20_000) -> float:
    """Double-precision operations per second of one core, two for each multiply-add."""
    chains = _fma_kernel()
    chains(np.ones(10 * _WIDTH), 1, 0.999, 1e-3)

    def run() -> None:
        lanes = [np.ones(10 * _WIDTH) for _ in range(parallel.thread_count())]
        parallel.run(partial(chains, values, rounds, 0.999, 1e-3) for values in lanes)

    return 2 * 32 * 10 * _WIDTH * rounds * parallel.thread_count() / best_time(run).cpu


class Times(NamedTuple):
    """What the fastest of some runs took: the machine left alone, as far as it is."""

    wall: float
    """[s]"""
    cpu: float
    """Core-seconds over all threads: waiting for other programs' turns does not count."""


def best_time(run: Callable[[], object], repeat: int = 5) -> Times:
    """The fastest of some runs."""
    times = []
    for _ in range(repeat):
        wall, cpu = time.perf_counter(), time.process_time()
        run()
        times.append((time.perf_counter() - wall, time.process_time() - cpu))
    return Times(*np.min(times, axis=0).tolist())


def flops(bundles: int) -> int:
    """Operations of one step of one arm, counted in a process without the compiler."""
    command = [sys.executable, "-m", "benchmarks.flops", str(bundles)]
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    return int(done.stdout)


def tsit5_tips(arm, gamma):
    """Tips by the opponent."""
    table, measure = tsit5.tables(arm)
    out = np.empty((len(gamma), 3))
    parallel.run(
        partial(tsit5.tips, table, measure, tsit5.WEIGHTS, tsit5.FINAL, gamma[b], out[b])
        for b in parallel.blocks(len(gamma), 16_384)
    )
    return out


def activations(arm, n: int):
    cube = np.random.default_rng(0).random((n, arm.bundles))
    return FreeRod(arm).box.from_cube(cube)


def twelve_bundles():
    """The minimal trunk with four narrow bundles in each architecture."""
    arm = designs.minimal_trunk()
    return arm.replace(actuators=tuple(f.replace(bundles=4, extent=0.2) for f in arm.fibers))


ARMS = {3: designs.minimal_trunk, 4: designs.redundant_trunk, 12: twelve_bundles}


def main(n: int = 2_000_000) -> None:
    """Print the tables."""
    rate = fma_rate()
    threads = parallel.thread_count()
    print(f"## Tips of {n:,} samples, float64, {threads} threads\n")
    print("| bundles | tol [L] | steps | wall [s] | tips/s | max error [L] |")
    print("|--:|--:|--:|--:|--:|--:|")
    speeds = [_tip_row(make(), n, 1e-6) for make in ARMS.values()]
    speeds.append(_tip_row(designs.minimal_trunk(), n, 1e-9))
    _tsit5_table(n)
    print(FOR_DEVELOPERS)
    print(
        f"A core's registers-only multiply-add rate: {rate / 1e9:.1f} GFLOP/s. Of it, by row above"
    )
    print("and over CPU time:", ", ".join(f"{speed / rate:.0%}" for speed in speeds))
    _cloud_table(n)


def _tip_row(arm, n: int, tol: float) -> float:
    """Print one row; operations a second of CPU time."""
    gamma = activations(arm, n)
    steps = FreeRod(arm, tol).steps
    seconds = best_time(lambda: sr.tip_positions(arm, gamma, tol))
    print(
        f"| {arm.bundles} | {tol:g} | {steps} | {seconds.wall:.3f} | {n / seconds.wall:,.0f} "
        f"| {max_error(arm, gamma, tol):.1e} |"
    )
    return n * steps * flops(arm.bundles) / seconds.cpu


def max_error(arm, gamma, tol: float) -> float:
    """Largest tip error over 20,000 samples, against a run at tol = 1e-12 [L]."""
    few = gamma[:20_000]
    exact = sr.tip_positions(arm, few, tol=1e-12)
    return float(np.linalg.norm(sr.tip_positions(arm, few, tol) - exact, axis=1).max() / arm.length)


def _tsit5_table(n: int) -> None:
    arm = designs.minimal_trunk()
    gamma = activations(arm, n)
    ours = best_time(lambda: sr.tip_positions(arm, gamma))
    few = gamma[: n // 10]
    theirs = best_time(lambda: tsit5_tips(arm, few), repeat=3)
    exact = sr.tip_positions(arm, few[:20_000], tol=1e-12)
    error = np.linalg.norm(tsit5_tips(arm, few[:20_000]) - exact, axis=1).max()
    print("\n## Beside Tsit5 with 100 fixed steps, compiled with the same flags and threads\n")
    print("| method | CPU [s] a million tips | times slower | max error [L] |")
    print("|---|--:|--:|--:|")
    a, b = ours.cpu * 1e6 / n, theirs.cpu * 1e6 / len(few)
    print(f"| softreach, tol = 1e-6 | {a:.3f} | 1 | {max_error(arm, gamma, 1e-6):.1e} |")
    print(f"| Tsit5, 100 steps | {b:.3f} | {b / a:.1f} | {error:.1e} |")


def _cloud_table(n: int) -> None:
    arm = designs.minimal_trunk()
    gamma = activations(arm, n)
    tips = best_time(lambda: sr.tip_positions(arm, gamma)).cpu / n
    print("\n## Whole clouds: sampling, tips and dataset together, minimal trunk\n")
    print("| sampler | samples | wall [s] | CPU [s] | of it the kernel |")
    print("|---|--:|--:|--:|--:|")
    side = int(np.cbrt(n))
    sizes = {"uniform": n, "boundary": n, "sobol": 1 << (n.bit_length() - 1), "grid": side**3}
    for sampler, size in sizes.items():
        run = partial(sr.compute_cloud, arm, size, sampler=sampler, progress=lambda _: None)
        seconds = best_time(run, repeat=3)
        share = tips * size / seconds.cpu
        print(f"| {sampler} | {size:,} | {seconds.wall:.3f} | {seconds.cpu:.3f} | {share:.0%} |")


@pytest.mark.parametrize("bundles", ARMS)
def test_tips(benchmark, bundles):
    arm = ARMS[bundles]()
    gamma = activations(arm, 20_000)
    benchmark(sr.tip_positions, arm, gamma)


def test_jacobians(benchmark):
    arm = designs.minimal_trunk()
    benchmark(sr.tip_jacobian, arm, activations(arm, 2_000))


def test_tsit5_solves_the_same_problem():
    arm = designs.minimal_trunk()
    gamma = activations(arm, 200)
    exact = sr.tip_positions(arm, gamma, tol=1e-10)
    np.testing.assert_allclose(tsit5_tips(arm, gamma), exact, atol=1e-6)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 2_000_000)
