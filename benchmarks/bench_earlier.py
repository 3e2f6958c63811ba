"""Old and new figures side by side: the same work by an earlier commit and by this one, in turns.

`python -m benchmarks.bench_earlier [COMMIT]` prints the tables. Both versions run in one
go, each in a process of its own; kernels are compiled before anything is timed, but for the cold
starts, of which compilation is all.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path

from benchmarks.bench_cold import BUDGETS, COMMANDS
from benchmarks.paired import ROOT, Comparison, both, compared

EARLIER = "a42e55b"
"""The commit before the work on speed that the page shows."""
PARTS = ("workspace", "inverse", "redundancy", "atlas", "pictures", "studio")


def main(commit: str = EARLIER, turns: int = 3) -> None:
    """Print the tables."""
    with source_of(commit) as source:
        print(f"## Beside the earlier commit {commit}: medians of {turns} turns\n")
        print("| what | CPU before [s] | CPU now [s] | ratio | wall before [s] | wall now [s] |")
        print("|---|--:|--:|--:|--:|--:|")
        with both(source) as versions:
            for part in PARTS:
                for found in compared(*versions, part, turns):
                    print(row(found), flush=True)
        print_cold(source)


@contextmanager
def source_of(commit: str) -> Iterator[Path]:
    """The folder src of a commit, in a place of its own."""
    packed = subprocess.run(
        ["git", "archive", commit, "src"], cwd=ROOT, check=True, capture_output=True
    ).stdout
    with tempfile.TemporaryDirectory() as folder, tarfile.open(fileobj=BytesIO(packed)) as files:
        files.extractall(folder, filter="data")
        yield Path(folder) / "src"


def row(found: Comparison) -> str:
    """One line of the table; results that differ by more than rounding say so."""
    differs = f", results differ by {found.apart:.0e}" if found.apart > 1e-9 else ""
    cpu = f"{found.other_cpu:.3f} | {found.cpu:.3f} | {found.ratio:.2f}"
    return f"| {found.task}{differs} | {cpu} | {found.other_wall:.3f} | {found.wall:.3f} |"


def print_cold(source: Path) -> None:
    """CPU seconds of compilation of each command, with an empty cache of kernels."""
    print("\nCPU seconds of compilation in the first run of each command:\n")
    print("| command | before | now | ratio | budget |\n|---|--:|--:|--:|--:|")
    for name, budget in BUDGETS.items():
        before, now = (compilation(name, path) for path in (source, ROOT / "src"))
        print(
            f"| `{name}` | {before:.1f} | {now:.1f} | {now / before:.2f} | {budget} |", flush=True
        )


def compilation(name: str, source: Path) -> float:
    """CPU seconds of compilation of a command, by the version in a folder."""
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "cold.json"
        path = os.pathsep.join([str(source), str(ROOT)])
        environment = os.environ | {"PYTHONPATH": path, "NUMBA_CACHE_DIR": f"{folder}/cache"}
        run = [sys.executable, "-m", "benchmarks.bench_cold", str(result), *COMMANDS[name].split()]
        subprocess.run(run, env=environment, cwd=folder, check=True, capture_output=True)
        return sum(json.loads(result.read_text(encoding="utf-8"))["seconds"].values())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("commit", nargs="?", default=EARLIER)
    parser.add_argument("--turns", type=int, default=3)
    asked = parser.parse_args()
    main(asked.commit, asked.turns)
