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
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.tasks import PARTS, Results, Task

ROOT = Path(__file__).parent.parent


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
