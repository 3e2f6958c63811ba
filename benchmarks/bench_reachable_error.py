"""Whether the stated errors of reachable volumes cover: random designs against finer searches.

`python -m benchmarks.bench_reachable_error [designs]` writes a table into the documentation. The
true volume is that of a far finer run, plus what an independent membership finds beyond it: places
within half a cell outside that another method, Levenberg's and Marquardt's in angles whose squared
sines are the activations, reaches after all from many starts.
"""

from __future__ import annotations

import sys
import time
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import softreach as sr
from benchmarks.table import VALIDATION, put_between_marks
from softreach.arm import FiberArchitecture, Manipulator
from softreach.workspace import ReachableSet, reachable_set

Array = NDArray[np.float64]

ACCURACIES = (5e-2, 2e-2, 1e-2)
FINE = {3: 1e-3, 4: 3e-3, 5: 3e-3, 6: 3e-3}
PLACES, STARTS = 1500, 6


class Row(NamedTuple):
    """One run against the truth, relative to it."""

    bundles: int
    accuracy: float
    error: float
    stated: float
    seconds: float


def random_arm(bundles: int, rng: np.random.Generator) -> Manipulator:
    """A design with two families of fibers, drawn from wide ranges."""
    first = int(rng.integers(1, bundles))
    fibers = tuple(
        FiberArchitecture(
            revolution=np.radians(rng.choice([0.0, rng.uniform(-150, 150)])),
            offset=rng.uniform(0.0, 2.0 * np.pi),
            extent=np.radians(rng.uniform(15.0, 300.0 / bundles)),
            bundles=count,
        )
        for count in (first, bundles - first)
    )
    outer = rng.uniform(0.045, 0.07)
    return Manipulator.tapered(
        length=1.0,
        outer_radius=outer,
        inner_radius=outer * rng.uniform(0.3, 0.85),
        taper=np.radians(rng.uniform(0.0, 2.0)),
        poisson_ratio=rng.uniform(0.3, 0.5),
        actuators=fibers,
        activation_bounds=(-rng.uniform(0.6, 1.6), rng.choice([0.0, 0.2])),
    )


def missed_volume(found: ReachableSet, rng: np.random.Generator) -> float:
    """Volume within half a cell outside that is reached after all [m³]."""
    grid, cell = found.grid, found.grid.attrs["cell"]
    low = np.array([float(grid[a][0]) for a in "xyz"])
    high = np.array([float(grid[a][-1]) for a in "xyz"])
    drawn, kept = 0, np.empty((0, 3))
    while len(kept) < PLACES:
        places = rng.uniform(low, high, (20_000, 3))
        drawn += len(places)
        kept = np.concatenate([kept, places[~found.contains(places)]])
        if drawn >= 40_000:
            break
    distance = found.distance(kept)
    near = kept[distance < 0.5 * cell]
    reached = reachable(found, near[:PLACES], rng).mean() if len(near) else 0.0
    return float(np.prod(high - low) * len(near) / drawn * reached)


def reachable(found: ReachableSet, places: Array, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Whether a search from some of many starts ends on each place."""
    from scipy.spatial import KDTree

    rod, box = found.tip_map, found.tip_map.box
    gamma = box.from_cube(rng.random((1 << 17, box.bundles)))
    near = np.asarray(KDTree(rod.tips(gamma)).query(places, k=8 * STARTS)[1])
    best = np.full(len(places), np.inf)
    for start in range(STARTS):
        best = np.minimum(best, least_distance(found, places, gamma[near[:, 8 * start]]))
    return best < 1e-3 * found.grid.attrs["cell"]


def least_distance(found: ReachableSet, places: Array, start: Array) -> Array:
    """Distances [m] after 40 damped steps in angles t, activations being low + width sin² t."""
    rod, box = found.tip_map, found.tip_map.box
    angle = np.arcsin(np.sqrt(np.clip(box.to_cube(start), 1e-4, 1.0 - 1e-4)))
    damping, best = np.full(len(places), 1e-3), np.full(len(places), np.inf)
    trial, residual = angle, np.zeros_like(places)
    kept = np.zeros((len(places), 3, box.bundles))
    for _ in range(40):
        tips, slopes = rod.tips_and_slopes(box.from_cube(np.sin(trial) ** 2))
        distance = np.linalg.norm(tips - places, axis=1)
        better = distance < best
        damping = np.where(better, 0.2, 5.0) * damping
        kept = np.where(better[:, None, None], slopes, kept)
        residual = np.where(better[:, None], tips - places, residual)
        angle, best = np.where(better[:, None], trial, angle), np.minimum(best, distance)
        columns = kept * (box.widths * np.sin(2.0 * angle))[:, None]
        square = columns @ np.swapaxes(columns, 1, 2)
        square += (damping[:, None, None] * 0.1 + 1e-14) * np.eye(3)
        pull = np.linalg.solve(square, residual[:, :, None])[:, :, 0]
        trial = angle - np.einsum("nij,ni->nj", columns, pull)
    return best


def measured(bundles: int, seed: int) -> list[Row]:
    """All accuracies of one design against the truth."""
    rng = np.random.default_rng([bundles, seed])
    arm, rows = random_arm(bundles, rng), []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sr.errors.SoftreachWarning)
        fine = reachable_set(arm, accuracy=FINE[bundles])
        true = fine.volume + (missed_volume(fine, rng) if bundles > 3 else 0.0)
        for accuracy in ACCURACIES:
            start = time.perf_counter()
            found = reachable_set(arm, accuracy=accuracy)
            spent = time.perf_counter() - start
            off, stated = abs(found.volume - true) / true, found.volume_error / true
            rows.append(Row(bundles, accuracy, off, stated, spent))
            print(
                f"m={bundles} seed={seed} V={true:.5f}±{fine.volume_error:.5f} "
                f"(missed {true - fine.volume:.1e}) {accuracy:g}: off {off:.2e}, "
                f"stated {stated:.2e}{'' if off <= stated else '  NOT COVERED'}, {spent:.1f} s",
                file=sys.stderr,
                flush=True,
            )
    return rows


def table(rows: list[Row]) -> str:
    """Median errors with those stated, and how often these cover."""
    accuracies = " | ".join(f"{accuracy:g}" for accuracy in ACCURACIES)
    lines = [f"| bundles | accuracy {accuracies} | covered |", "|--:|--:|--:|--:|--:|"]
    for m in sorted({row.bundles for row in rows}):
        some = [row for row in rows if row.bundles == m]
        shown = " | ".join(
            f"{_median(some, accuracy, 'error')} ({_median(some, accuracy, 'stated')})"
            for accuracy in ACCURACIES
        )
        lines.append(f"| {m} | {shown} | {sum(map(is_covered, some))} of {len(some)} |")
    covered = np.mean(list(map(is_covered, rows)))
    return "\n".join([*lines, f"\n{covered:.1%} of {len(rows)} runs are covered."])


def is_covered(row: Row) -> bool:
    """Whether the stated error is as large as the error."""
    return row.error <= row.stated


def _median(rows: list[Row], accuracy: float, name: str) -> str:
    return f"{np.median([getattr(row, name) for row in rows if row.accuracy == accuracy]):.1e}"


def main(designs: int = 52) -> None:
    """Print the table and put it into its page."""
    found = table([row for n in range(designs) for row in measured(3 + n % 4, n // 4)])
    print(found)
    put_between_marks(VALIDATION, "errors of reachable sets", found)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
