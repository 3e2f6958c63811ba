"""Search of designs: the paper's problem, its question set free, and five places to reach.

`python -m benchmarks.bench_search [paper | free | places]` prints Markdown tables; under
pytest-benchmark one small search runs. All of it takes twenty minutes.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import optuna
from scipy.ndimage import binary_dilation

import softreach as sr
from softreach.arm.parameters import changed
from softreach.optimization import Search
from softreach.optimization.free_parameters import free_parameters
from softreach.optimization.problem import Candidate
from softreach.optimization.search_file import read_search
from softreach.support import parallel
from softreach.support.errors import no_warnings

EXAMPLES = Path(__file__).parent.parent / "examples"
TURN = np.radians(360.0)
PAPER = {"revolution": (0.0, np.radians(108.0)), "taper": (0.0, np.radians(3.0))}
NAMES = ("left", "right", "longitudinal")
OPEN = {
    **{f"{name}.revolution": (-TURN, TURN) for name in NAMES},
    "left.offset": (0.0, TURN),
    "right.offset": (0.0, TURN),
    "taper": (0.0, np.radians(3.2)),
}
EXTENTS = {f"{name}.extent": (np.radians(20.0), np.radians(110.0)) for name in NAMES}
BOUNDS = {f"{name}.lower": (-5.0 / 3.0, -0.5) for name in NAMES}


def trunk() -> sr.Manipulator:
    """The paper's arm of three fibers."""
    return sr.designs.minimal_trunk(revolution=np.radians(54.0), taper=np.radians(2.0))


def paper(cells: int = 200) -> Iterator[str]:
    """The paper's two parameters against a grid of exact sets."""
    yield "| objective | best of the grid | found | share of it | designs | CPU |"
    yield "|---|---|---|---|---|---|"
    volume, unreachability = grid(cells)
    known = {"exact_volume": np.nanmax(volume), "exact_unreachability": np.nanmin(unreachability)}
    for name, best in known.items():
        sense = "maximize" if name == "exact_volume" else "minimize"
        found, cpu = timed(trunk(), PAPER, designs=40, **{sense: name})
        value = found.best.objectives[0]
        yield (
            f"| {name} | {best:.5f} | {value.value:.5f} ± {value.error:.0e} | "
            f"{100 * value.value / best:.2f} % | {found.designs} | {cpu:.1f} s |"
        )


@no_warnings()
def grid(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Volume and unreachability of the designs of a grid, each to 1 %.

    Every fourth design along both axes, then all around those within 3 % of the best of either: no
    other can be better, as neighbors differ by less. NaN where nothing was computed.
    """
    base = trunk()
    axes = [np.linspace(*PAPER[name], cells) for name in PAPER]
    values = np.full((cells, cells, 2), np.nan)

    def of(place: tuple[int, int]) -> None:
        at = (float(axis[k]) for axis, k in zip(axes, place, strict=True))
        with parallel.undivided():
            arm = changed(base, dict(zip(PAPER, at, strict=True)))
            solid = sr.reachable_set(arm, accuracy=1e-2)
        values[place] = solid.volume, solid.unreachability

    rough = np.arange(0, cells, 4)
    parallel.run(partial(of, (i, j)) for i in rough for j in rough)
    near = values[..., 0] > 0.97 * np.nanmax(values[..., 0])
    near |= values[..., 1] < 1.03 * np.nanmin(values[..., 1])
    around = binary_dilation(near, iterations=4, structure=np.ones((3, 3)))
    left = np.argwhere(around & np.isnan(values[..., 0]))
    parallel.run(partial(of, (int(i), int(j))) for i, j in left)
    return values[..., 0], values[..., 1]


def timed(base: Any, free: Mapping[str, Any], **options: Any) -> tuple[Search, float]:
    """A search and its CPU time [s]."""
    cpu = time.process_time()
    found = sr.search(base, free, **options)
    return found, time.process_time() - cpu


def freed(seeds: int = 10) -> Iterator[str]:
    """The paper's question with more and more numbers free."""
    yield "| free numbers | seeds | volume, median (least, largest) | designs | CPU |"
    yield "|---|---|---|---|---|"
    ratio = {"radius_ratio": (0.5, 0.9)}
    rows = [
        ("three revolutions, two offsets, taper", OPEN, 160, seeds),
        ("and extents", OPEN | EXTENTS, 300, 3),
        ("and the radius ratio and the bounds", OPEN | EXTENTS | ratio | BOUNDS, 400, 3),
    ]
    for label, free, designs, count in rows:
        runs = [
            timed(trunk(), free, maximize="exact_volume", designs=designs, seed=seed)
            for seed in range(count)
        ]
        values = np.array([found.best.objectives[0].value for found, _ in runs])
        cpu = np.median([seconds for _, seconds in runs])
        spent = int(np.median([found.designs for found, _ in runs]))
        yield (
            f"| {label} | {count} | {np.median(values):.4f} ({values.min():.4f}, "
            f"{values.max():.4f}) L³ | {spent} | {cpu:.0f} s |"
        )


METHODS: Mapping[str, Mapping[str, Any]] = {
    "softreach": {},
    "Optuna alone, CMA-ES": {"polish": False, "sampler": "cma"},
    "random": {"polish": False, "sampler": "random"},
}


def places(seeds: int = 10) -> Iterator[str]:
    """Five places with 30 g in a box: least effort of three fibers, method by method."""
    text = (EXAMPLES / "five_places.toml").read_text()
    asked = read_search(text, EXAMPLES, lambda name: sr.Manipulator.load(EXAMPLES / name))
    runs: dict[str, list[tuple[list[Candidate], float]]] = {}
    for method, options in METHODS.items():
        for seed in range(seeds):
            log: list[Candidate] = []
            cpu = time.process_time()
            found = sr.search(
                changed_bundles(asked["base"]),
                asked["free"],
                asked["requirements"].replace(payloads=(0.03,)),
                minimize="worst_effort",
                designs=100,
                seed=seed,
                follow=log.append,
                **options,
            )
            left = found.designs - sum(each.designs for each in log)
            log.append(replace(found.best, designs=left))
            runs.setdefault(method, []).append((log, time.process_time() - cpu))
    best = min(least(log)[-1] for each in runs.values() for log, _ in each)
    yield "| method | least effort, median | designs to 1 % of the best | CPU |"
    yield "|---|---|---|---|"
    for method, each in runs.items():
        ends = np.median([least(log)[-1] for log, _ in each])
        counts = [designs_to(log, 1.01 * best) for log, _ in each]
        median = float(np.median(counts))
        count = f"{median:.0f}" if np.isfinite(median) else "more than 100"
        reached = sum(np.isfinite(counts))
        cpu = np.median([seconds for _, seconds in each])
        yield f"| {method} | {ends:.4f} | {count} ({reached} of {len(each)} seeds) | {cpu:.0f} s |"


def changed_bundles(base: Any) -> sr.Manipulator:
    """The arm of the example with three alike fibers."""
    parameters = free_parameters(base, {"taper": (0.0, 0.01)}, {"bundles": [3]})
    return parameters.arm({"taper": float(base.profile.taper), "bundles": 3})


def least(log: Sequence[Candidate]) -> np.ndarray:
    """Least effort of feasible designs so far; infinite without one."""
    values = [each.objectives[0].value if each.is_feasible else np.inf for each in log]
    return np.minimum.accumulate(values)


def designs_to(log: Sequence[Candidate], value: float) -> float:
    """Designs looked at until the least effort is as small."""
    counts = np.cumsum([each.designs for each in log])
    small = np.flatnonzero(least(log) <= value)
    return float(counts[small[0]]) if len(small) else np.inf


TABLES = {
    "paper": ("the paper's problem, Ω and φ, against a grid of 200 × 200 exact sets", paper),
    "free": ("the paper's question set free: largest volume of three fibers", freed),
    "places": ("five places with 30 g, a box and a lamp: least effort of three fibers", places),
}


def main() -> None:
    """Print the tables, or those named on the command line."""
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    for name in sys.argv[1:] if Path(sys.argv[0]).stem == "bench_search" else TABLES:
        title, table = TABLES[name]
        print(f"\n## Search: {title}\n", flush=True)
        for row in table():
            print(row, flush=True)


def test_search(benchmark: Any) -> None:
    """A small search of the paper's problem."""
    options = {"maximize": "exact_volume", "designs": 12, "accuracy": 0.05}
    benchmark(lambda: sr.search(trunk(), PAPER, **options))


if __name__ == "__main__":
    main()
