"""Mean activation-space distance: ours beside SciPy's KDTree, in one run.

`python -m benchmarks.bench_redundancy [n]` prints a Markdown table of time per query and peak
memory, each row measured in a process of its own; under pytest-benchmark the same work runs on a
small cloud. SciPy's time is that of some queries, as its lists of all neighbors would not fit.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest

from benchmarks.memory import peak_bytes, reset_peak

RADIUS = 1 / 60
QUERIES = 10_000
FEW = 100

Points = np.ndarray


class Cost(NamedTuple):
    """Seconds of preparation, of the queries, and the mean of their results."""

    build: float
    query: float
    queries: int
    mean: float


def arm_cloud(design: str, n: int) -> tuple[Points, Points]:
    """Tips and activations of a named design."""
    import softreach as sr

    cloud = sr.compute_cloud(getattr(sr.designs, design)(), n=n, seed=0, tol=1e-4)
    return cloud.tip.values, cloud.activation.values


def ours(tip: Points, activation: Points, clock: Callable[[], float]) -> Cost:
    """Every point of the cloud, sorting included."""
    return _ours(tip, activation, None, clock)


def ours_some(tip: Points, activation: Points, clock: Callable[[], float]) -> Cost:
    """As many points as SciPy is asked for, sorting included."""
    return _ours(tip, activation, _some(len(tip)), clock)


def ours_few(tip: Points, activation: Points, clock: Callable[[], float]) -> Cost:
    """A hundredth of that; points far from all queries are not sorted."""
    return _ours(tip, activation, _some(len(tip))[:: QUERIES // FEW], clock)


def _ours(tip: Points, activation: Points, queries, clock: Callable[[], float]) -> Cost:
    from softreach.geometry.neighbors import mean_value_distance

    start = clock()
    mean = mean_value_distance(tip, activation, RADIUS, queries)[0]
    return Cost(0.0, clock() - start, len(mean), float(np.nanmean(mean)))


def scipy_pieces(tip: Points, activation: Points, clock: Callable[[], float]) -> Cost:
    """SciPy with its fast flags and all cores, in pieces of queries; means by one reduction."""
    return _scipy(tip, activation, clock, _mean_of_piece)


def scipy_few(tip: Points, activation: Points, clock: Callable[[], float]) -> Cost:
    """SciPy for as few."""
    return _scipy(tip, activation, clock, _mean_of_piece, QUERIES // FEW)


def scipy_loop(tip: Points, activation: Points, clock: Callable[[], float]) -> Cost:
    """The same with a loop over the lists of neighbors."""
    return _scipy(tip, activation, clock, _mean_by_loop)


def _scipy(
    tip: Points, activation: Points, clock: Callable[[], float], mean_of, every: int = 1
) -> Cost:
    from scipy.spatial import KDTree

    start = clock()
    tree = KDTree(tip, balanced_tree=False, compact_nodes=False)
    built, queries = clock(), _some(len(tip))[::every]
    means = []
    for piece in np.array_split(queries, min(20, len(queries))):
        lists = tree.query_ball_point(tip[piece], RADIUS, workers=-1, return_sorted=False)
        means.append(mean_of(lists, activation, piece))
    return Cost(
        built - start, clock() - built, len(queries), float(np.nanmean(np.concatenate(means)))
    )


def _mean_of_piece(lists, activation: Points, piece: Points) -> Points:
    lengths = np.array([len(found) for found in lists])
    flat = np.concatenate([np.asarray(found, np.intp) for found in lists])
    apart = activation[flat] - np.repeat(activation[piece], lengths, axis=0)
    total = np.add.reduceat(np.sqrt(np.einsum("ij,ij->i", apart, apart)), _starts(lengths))
    others = lengths - 1  # the point itself is in its own list
    return np.divide(total, others, out=np.full(len(piece), np.nan), where=others > 0)


def _mean_by_loop(lists, activation: Points, piece: Points) -> Points:
    sums = [
        np.linalg.norm(activation[found] - activation[i], axis=1).sum()
        for found, i in zip(lists, piece, strict=True)
    ]
    others = np.array([len(found) for found in lists]) - 1
    return np.divide(sums, others, out=np.full(len(piece), np.nan), where=others > 0)


def _starts(lengths: Points) -> Points:
    return np.concatenate([[0], np.cumsum(lengths)[:-1]])


def _some(n: int) -> Points:
    return np.arange(min(QUERIES, n)) * (n // min(QUERIES, n))


ROUTES: dict[str, tuple[str, Callable[..., Cost]]] = {
    "scipy": ("SciPy KDTree, lists joined", scipy_pieces),
    "loop": ("SciPy KDTree, loop over lists", scipy_loop),
    "some": ("softreach, as many", ours_some),
    "ours": ("softreach, every point", ours),
    "scipy few": ("SciPy KDTree, a few", scipy_few),
    "few": ("softreach, a few", ours_few),
}
DESIGNS = ("minimal_trunk", "redundant_trunk")


@pytest.mark.parametrize("name", ROUTES)
def test_redundancy(benchmark, name):
    tip, activation = arm_cloud("redundant_trunk", 4000)
    cost = benchmark(ROUTES[name][1], tip, activation, time.process_time)
    same = ours_few if "few" in name else ours_some
    assert cost.mean == pytest.approx(same(tip, activation, time.process_time).mean, rel=1e-9)


def measure(name: str, design: str, n: int) -> dict[str, float]:
    """Time and peak memory of one route, in this process."""
    route = ROUTES[name][1]
    route(*arm_cloud(design, 1000), time.process_time)  # compile or load
    tip, activation = arm_cloud(design, n)
    before, wall = reset_peak(), time.perf_counter()
    cost = route(tip, activation, time.process_time)
    wall = time.perf_counter() - wall
    return {**cost._asdict(), "wall": wall, "memory": peak_bytes() - before}


def measured(name: str, design: str, n: int, repeat: int) -> dict[str, float]:
    """The fastest of some runs, each in a fresh process."""
    command = [
        sys.executable,
        "-m",
        "benchmarks.bench_redundancy",
        str(n),
        "--route",
        name,
        "--design",
        design,
    ]
    runs = [
        json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
        for _ in range(repeat)
    ]
    return min(runs, key=lambda run: run["query"])


def main(n: int = 2_000_000, repeat: int = 2) -> None:
    """Print a table for each design; memory is what comes on top of computing the cloud."""
    for design in DESIGNS:
        print(f"D̄ of {n:,} tips of `{design}`, r = L/60, the best of {repeat}\n")
        print(
            "| route | queries | mean D̄ | build [CPU s] | rest [CPU s] | wall [s] | memory [MB] "
            "| µs of CPU a query | times less a query | times less in all |"
        )
        print("|---|--:|--:|--:|--:|--:|--:|--:|--:|--:|")
        print(*_rows(design, n, repeat), sep="\n", end="\n\n", flush=True)


def _rows(design: str, n: int, repeat: int) -> list[str]:
    runs = {name: measured(name, design, n, repeat) for name in ROUTES}
    theirs = min((runs[name] for name in ("scipy", "loop")), key=_each)
    few = runs["scipy few"]
    return [
        _row(ROUTES[name][0], run, few if "few" in name else theirs) for name, run in runs.items()
    ]


def _each(run: dict[str, float]) -> float:
    return run["query"] / run["queries"]


def _row(title: str, run: dict[str, float], theirs: dict[str, float]) -> str:
    """Ours has no building apart: sorting counts among the rest, in its disfavor a query."""
    total = [r["build"] + r["query"] for r in (theirs, run)]
    same = run["queries"] == theirs["queries"]
    in_all = f"{total[0] / total[1]:.1f}" if same else ""
    times = f"{run['build']:.2f} | {run['query']:.2f} | {run['wall']:.2f}"
    shares = f"{1e6 * _each(run):.2f} | {_each(theirs) / _each(run):.1f} | {in_all}"
    memory = f"{run['memory'] / 1e6:.0f}"
    return f"| {title} | {run['queries']:,} | {run['mean']:.6f} | {times} | {memory} | {shares} |"


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("n", type=int, nargs="?", default=2_000_000)
    parser.add_argument("--route", choices=ROUTES)
    parser.add_argument("--design", choices=DESIGNS, default=DESIGNS[0])
    parser.add_argument("--repeat", type=int, default=2)
    asked = parser.parse_args()
    if asked.route:
        print(json.dumps(measure(asked.route, asked.design, asked.n)))
    else:
        main(asked.n, asked.repeat)
