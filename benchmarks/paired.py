"""The same work by two versions of softreach, in turns: are the numbers equal, and which is faster.

`python -m benchmarks.paired OTHER/src [PART ...]` starts one process for this checkout and one for
the other, lets them run each task by turns, and prints the ratio of their CPU times (the median of
the turns, this one over the other) with the largest difference of their results. Nothing else on
the machine can favor one of them. With `--most R` the exit code is 1 if a ratio exceeds R.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

ROOT = Path(__file__).parent.parent
Results = dict[str, np.ndarray]
Task = Callable[[], Results]
REST = np.zeros((1, 3))


def design_tasks() -> dict[str, Task]:
    """What a design costs before its first sample."""
    import softreach as sr
    from softreach.arm.summary import describe
    from softreach.arm.tables import tables
    from softreach.rod.free import FreeRod

    trunks = [_trunk(o, p) for o in (36, 75, 108) for p in (0, 2, 3)]
    stations = np.linspace(0.0, 1.0, 101)

    def described(arm: Any) -> list[float]:
        found = describe(arm)
        return [*found.extension, *found.curvature, *found.revolutions]

    return {
        "tables": lambda: {"U": np.array([tables(one, stations).curvature for one in trunks])},
        "steps": lambda: {"K": np.array([FreeRod(one, 1e-6).steps for one in trunks])},
        "first tip": lambda: {"tip": np.array([FreeRod(one, 1e-6).tips(REST) for one in trunks])},
        "describe": lambda: {"numbers": np.array([described(one) for one in trunks])},
        "designs": lambda: {
            "L": np.array([sr.designs.minimal_trunk(length=k).length for k in range(1, 200)])
        },
    }


def kernel_tasks() -> dict[str, Task]:
    """Tips, Jacobians and shapes."""
    import softreach as sr

    def tips(arm: Any, n: int) -> Task:
        gamma = _activations(arm, n)
        return lambda: {"tips": sr.tip_positions(arm, gamma)}

    minimal, redundant = sr.designs.minimal_trunk(), sr.designs.redundant_trunk()
    few, some = _activations(minimal, 2_000), _activations(minimal, 100_000)
    return {
        "tips, 3 bundles": tips(minimal, 1_000_000),
        "tips, 4 bundles": tips(redundant, 1_000_000),
        "Jacobians": lambda: {"twists": sr.tip_jacobian(minimal, some)},
        "tip directions": lambda: {"d3": _tip_directions(minimal, some)},
        "shapes": lambda: {"r": sr.configuration(minimal, few).position.values},
        "cloud": lambda: {"tip": sr.compute_cloud(minimal, 1_000_000).tip.values},
    }


def workspace_tasks() -> dict[str, Task]:
    """The exact reachable set."""
    from benchmarks.bench_workspace import family_arm
    from softreach.workspace import reachable_set

    def numbers(arm: Any, accuracy: float) -> Task:
        def task() -> Results:
            found = reachable_set(arm, accuracy=accuracy)
            asked = ("volume", "convex_volume")
            return {name: np.array(getattr(found, name)) for name in asked}

        return task

    trunks = {f"{o}°, {p}°": _trunk(o, p) for o, p in ((108, 2), (75, 3), (36, 3))}
    found = {f"reachable set, {name}": numbers(arm, 3e-3) for name, arm in trunks.items()}
    import softreach as sr

    found["reachable set, 4 bundles"] = numbers(sr.designs.redundant_trunk(), 0.02)
    found["reachable set, 4 bundles, 0.3 %"] = numbers(sr.designs.redundant_trunk(), 3e-3)
    found["reachable set, 6 bundles, 0.3 %"] = numbers(family_arm("six"), 3e-3)
    found["reachable set, 12 bundles, 1 %"] = numbers(family_arm("twelve"), 1e-2)
    narrow = sr.designs.minimal_trunk().with_bounds((-0.9, -0.3))
    found["reachable set, one to one"] = numbers(narrow, 3e-3)
    found["reachable surface"] = lambda: {
        "vertices": reachable_set(_trunk(75, 3)).surface().vertices
    }
    return found


def inverse_tasks() -> dict[str, Task]:
    """Every branch, least change, directions, places out of reach."""
    import softreach as sr

    def solve(arm: Any, n: int, **options: Any) -> Task:
        targets = sr.tip_positions(arm, _activations(arm, n))

        def task() -> Results:
            found = sr.solve_inverse(arm, targets, **options)
            # Within a target their order is a matter of rounding.
            keys = found.activations.T[::-1].round(5)
            order = np.lexsort((*keys, np.repeat(np.arange(n), found.counts)))
            return {"counts": found.counts, "activations": found.activations[order]}

        return task

    def away() -> Results:
        targets = 1.3 * np.random.default_rng(3).normal(size=(100, 3))
        return {"gap": np.array([one.gap for one in sr.solve_inverse(_trunk(108, 2), targets)])}

    def track() -> Results:
        arm = _trunk(108, 2)
        path = sr.tip_positions(arm, np.linspace([-0.2] * 3, [-1.2, -0.6, -0.9], 30))
        return {"activation": sr.track_path(arm, path).activation.values}

    designs = ((108, 2), (75, 3), (36, 3), (0, 0))
    found = {f"every branch, {o}°, {p}°": solve(_trunk(o, p), 20_000) for o, p in designs}
    redundant = sr.designs.redundant_trunk()
    return found | {
        "least change, 4 bundles": solve(redundant, 60),
        "direction, 3 bundles": solve(_trunk(108, 2), 60, direction=(0.0, 0.0, 1.0)),
        "out of reach": away,
        "path": track,
    }


def redundancy_tasks() -> dict[str, Task]:
    """Questions asked of a cloud."""
    import softreach as sr
    from softreach.curvature import curvature_statistics
    from softreach.dexterity import dexterity

    cloud = sr.compute_cloud(sr.designs.redundant_trunk(), 200_000)
    large = sr.compute_cloud(sr.designs.minimal_trunk(), 2_000_000)

    def statistics() -> Results:
        found = curvature_statistics(cloud)
        return {name: found[name].values for name in found if not name.endswith("_count")}

    def distance(of: Any, queries: int) -> Task:
        return lambda: {"distance": sr.activation_distance(of, 1 / 60, queries=queries).values}

    return {
        "activation distance": distance(cloud, 10_000),
        "activation distance, 10,000 of 2,000,000": distance(large, 10_000),
        "activation distance, 100 of 2,000,000": distance(large, 100),
        "dexterity": lambda: {"manipulability": dexterity(cloud).manipulability.values},
        "curvature statistics": statistics,
    }


def atlas_tasks() -> dict[str, Task]:
    """A small atlas with every metric."""
    import softreach as sr

    space = sr.DesignSpace.grid(
        sr.designs.minimal_trunk(), revolution=[0.9, 1.8], taper=np.radians([0.0, 2.0]).tolist()
    )
    exact = ("extent", "convex", "exact", "curvature")

    def build(n: int, *metrics: str) -> Task:
        def task() -> Results:
            with tempfile.TemporaryDirectory() as folder:
                atlas = sr.build_atlas(space, f"{folder}/a.zarr", n, metrics=metrics)
                names = ("volume", "convex_volume", "exact_volume", "unreachability", "x_min")
                return {name: atlas[name].values for name in names if name in atlas}

        return task

    return {
        "atlas, 2 x 2 of 100,000": build(100_000, *exact, "concave"),
        "atlas, 2 x 2 of 400,000": build(400_000, *exact, "concave"),
        "atlas, 2 x 2 of 400,000, without α-shapes": build(400_000, *exact),
    }


def picture_tasks() -> dict[str, Task]:
    """Pictures of clouds and hulls, and the demo from the start of its process to its end."""
    import softreach as sr
    from softreach import plot
    from softreach.plot.style import pyplot

    arm = sr.designs.minimal_trunk()
    clouds = {n: sr.compute_cloud(arm, n) for n in (400_000, 2_000_000)}
    hull = sr.concave_hull(clouds[400_000].tip, 0.05 * arm.length)

    def drawn(draw: Callable[[], object]) -> Task:
        def task() -> Results:
            draw()
            pyplot().close("all")
            return {}

        return task

    def demo() -> Results:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, "-m", "softreach", "demo", "--json", "--out", folder]
            subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return {}

    views = {
        f"four views of {n:,} points and the arm": drawn(partial(plot.plot_views, cloud, arm))
        for n, cloud in clouds.items()
    }
    return {**views, "picture of a hull": drawn(lambda: plot.plot_hull(hull)), "demo": demo}


def studio_tasks() -> dict[str, Task]:
    """From a moved slider to the fine result."""
    import softreach as sr
    from softreach.studio.reach import Quality, stages

    def fine(arm: Any) -> Task:
        def task() -> Results:
            *_, last = stages(arm, 17, Quality(), lambda: None)
            return {"volume": np.array(last.volume)}

        return task

    return {
        "studio's fine result": fine(_trunk(108, 2)),
        "studio's fine result, 4 bundles": fine(sr.designs.redundant_trunk()),
    }


PARTS: dict[str, Callable[[], dict[str, Task]]] = {
    "design": design_tasks,
    "kernels": kernel_tasks,
    "workspace": workspace_tasks,
    "inverse": inverse_tasks,
    "redundancy": redundancy_tasks,
    "atlas": atlas_tasks,
    "pictures": picture_tasks,
    "studio": studio_tasks,
}


def _trunk(revolution: float, taper: float) -> Any:
    import softreach as sr

    return sr.designs.minimal_trunk(np.radians(revolution), np.radians(taper))


def _activations(arm: Any, n: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(*arm.bounds.T, (n, arm.bundles))


def _tip_directions(arm: Any, gamma: np.ndarray) -> np.ndarray:
    import softreach as sr

    return sr.configuration(arm, gamma, [arm.length]).directors.values[:, 0, 2]


def serve() -> None:
    """Run the tasks that arrive as lines; this is what the processes of both versions do."""
    import warnings

    warnings.simplefilter("ignore")
    tasks: dict[str, Task] = {}
    for line in sys.stdin:
        asked = json.loads(line)
        if asked["part"]:
            tasks = PARTS[asked["part"]]()
            answer: dict[str, Any] = {"tasks": list(tasks)}
        else:
            wall, cpu = time.perf_counter(), _cpu_seconds()
            results = tasks[asked["task"]]()
            answer = {"wall": time.perf_counter() - wall, "cpu": _cpu_seconds() - cpu}
            np.savez(asked["out"], **results)  # type: ignore[arg-type]
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()


def _cpu_seconds() -> float:
    """Of this process and of those that it has waited for."""
    waited_for = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + waited_for.ru_utime + waited_for.ru_stime


class Version:
    """One version of softreach in a process of its own."""

    def __init__(self, source: Path, out: Path) -> None:
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(source), str(ROOT)])}
        self.out = out
        self.process = subprocess.Popen(
            [sys.executable, "-m", "benchmarks.paired", "--serve"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )

    def ask(self, **question: str) -> dict[str, Any]:
        """The answer to a question, when it comes."""
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        whole = {"part": "", "task": "", "out": str(self.out), **question}
        self.process.stdin.write(json.dumps(whole) + "\n")
        self.process.stdin.flush()
        if not (line := self.process.stdout.readline()):
            raise SystemExit(f"the process of {self.out.stem} ended at {question}")
        return json.loads(line)

    def results(self) -> Results:
        """What the last task found."""
        with np.load(self.out) as stored:
            return dict(stored)

    def end(self) -> None:
        """End the process."""
        self.process.kill()


def difference(ours: Results, theirs: Results) -> float:
    """Largest difference of two results, relative to the largest number of each array."""
    worst = 0.0
    for name, mine in ours.items():
        other = theirs[name]
        if mine.shape != other.shape:
            return float("inf")
        scale = np.nanmax(np.abs(other), initial=0.0) or 1.0
        apart = np.abs(mine.astype(float) - other.astype(float))
        if (np.isnan(mine.astype(float)) != np.isnan(other.astype(float))).any():
            return float("inf")
        worst = max(worst, float(np.nanmax(apart, initial=0.0)) / float(scale))
    return worst


class Comparison(NamedTuple):
    """One task by both versions: medians of the turns."""

    task: str
    cpu: float
    """CPU time of this version [s]."""
    wall: float
    """Its wall time [s]."""
    other_cpu: float
    """CPU time of the other version [s]."""
    other_wall: float
    """Its wall time [s]."""
    ratio: float
    """Of the CPU times of a turn, this version over the other."""
    apart: float
    """Largest relative difference of the results."""


def compared(ours: Version, theirs: Version, part: str, turns: int) -> Iterator[Comparison]:
    """Every task of a part by both versions in turns."""
    names = ours.ask(part=part)["tasks"]
    theirs.ask(part=part)
    for name in names:
        for version in (ours, theirs):  # compiled, loaded
            version.ask(task=name)
        apart = difference(ours.results(), theirs.results())
        took: dict[Version, list[tuple[float, float]]] = {ours: [], theirs: []}
        for turn in range(turns):
            for version in (ours, theirs) if turn % 2 else (theirs, ours):
                answer = version.ask(task=name)
                took[version].append((answer["cpu"], answer["wall"]))
        mine, other = np.array(took[ours]), np.array(took[theirs])
        ratio = float(np.median(mine[:, 0] / other[:, 0]))
        (cpu, wall), (other_cpu, other_wall) = (
            np.median(each, 0).tolist() for each in (mine, other)
        )
        yield Comparison(name, cpu, wall, other_cpu, other_wall, ratio, apart)


@contextmanager
def both(source: Path) -> Iterator[tuple[Version, Version]]:
    """This version and that of another folder src, each in a process of its own."""
    with tempfile.TemporaryDirectory() as folder:
        versions = [
            Version(ROOT / "src", Path(folder) / "ours.npz"),
            Version(source.resolve(), Path(folder) / "theirs.npz"),
        ]
        try:
            yield versions[0], versions[1]
        finally:
            for version in versions:
                version.end()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("source", type=Path, help="the folder src of the other checkout")
    parser.add_argument("parts", nargs="*", default=list(PARTS), help=", ".join(PARTS))
    parser.add_argument("--turns", type=int, default=9)
    parser.add_argument("--most", type=float, default=float("inf"))
    asked = parser.parse_args()
    if not (asked.source / "softreach").is_dir():
        parser.error(f"source = {asked.source}: must hold the package softreach")
    worst = 0.0
    print("| task | CPU of the other [s] | ratio of CPU times | largest relative difference |")
    print("|---|--:|--:|--:|")
    with both(asked.source) as (ours, theirs):
        for part in asked.parts:
            for found in compared(ours, theirs, part, asked.turns):
                worst = max(worst, found.ratio)
                numbers = f"{found.other_cpu:.3f} | {found.ratio:.3f} | {found.apart:.1e}"
                print(f"| {found.task} | {numbers} |", flush=True)
    sys.exit(worst > asked.most)


if __name__ == "__main__":
    serve() if "--serve" in sys.argv else main()
