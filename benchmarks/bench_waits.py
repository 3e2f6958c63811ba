"""Waits for everything that a user can call, commands by the examples of their help.

Functions are called as in `tests/abuse/public_calls.py`, whose arguments are small: what they cost
at the sizes that matter is told by the other parts.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.bench_geometry import cpu_seconds
from benchmarks.memory import peak_bytes, reset_peak
from benchmarks.table import FOR_DEVELOPERS
from softreach.support.errors import SoftreachError

ROOT = Path(__file__).parent.parent
CLI = ROOT / "src" / "softreach" / "cli"

_LONG = 1.0, 10.0  # seconds, warm and cold, above which a wait is explained
_TURNS = 2
_GROWN = 1, 4, 16  # times the least n
_KEPT = "arm.toml", "trunk.zarr"  # what commands make for others

FILES = {
    "check": {"arm.toml": "three_fibers.toml", "needs.toml": "five_places.toml"},
    "calibrate": {"arm.toml": "tentacle.toml", "poses.csv": "tentacle.csv"},
    "plan-poses": {"arm.toml": "tentacle.toml"},
}
"""Files of `examples/` that stand for those of a command's example."""

FEWER = {"atlas": ["--n", "20000"], "cloud": ["--overwrite"]}
"""Options that make an example end sooner, or more than once."""

BEFORE = {
    "equilibria": "design lce_arm --payload 1g --out arm.toml",
    "show": "cloud minimal_trunk --out trunk.zarr",
    "volume": "cloud minimal_trunk --out trunk.zarr",
}
"""Commands that make the files of others."""

LEFT_OUT = {
    "import": "reads a file of another program",
    "paper": "computes for minutes: it says so itself",
    "search": "computes for as long as it is given",
    "studio": "serves until it is ended: part `studio`",
    "warmup": "compiles what the others do",
}

WHY = {
    "forces.blocked_force": "the force grows in thirty steps, each solved for equilibria",
    "plot.plot_opposite_sides": "a cloud is drawn four times",
}
"""Reasons of long waits, by function."""


class Wait(NamedTuple):
    """Cost of one call."""

    wall: float
    cpu: float
    """Of all threads and of processes that it waited for [s]."""
    peak: float
    """Largest memory; of functions, beyond that before the call [MB]."""


def main() -> None:
    """Print the tables."""
    print("## Commands, by the example of their help\n")
    print("Wall time; cold with an empty kernel cache.\n")
    print("| command | cold [s] | warm [s] | peak [MB] |")
    print("|---|--:|--:|--:|")
    for name, words in _examples():
        print(_command_row(name, words), flush=True)
    print(FOR_DEVELOPERS)
    print(f"\nLeft out: {'; '.join(f'`{name}` ({why})' for name, why in LEFT_OUT.items())}.\n")
    print("### Functions, on small arguments\n")
    print("The first call of a process with a full kernel cache, and the best of two later ones.\n")
    print("| function | first, wall [s] | warm, wall [s] | CPU [s] | adds [MB] | why |")
    print("|---|--:|--:|--:|--:|---|")
    for line in _function_rows():
        print(line, flush=True)
    print_growth()


def print_growth() -> None:
    """Print how the times of what depends on a size grow with it."""
    print("\n### Growth with n\n")
    print("CPU time, warm. The slope is that of log time over log n.\n")
    print(f"| what | n | {' | '.join(f'{k} n [s]' for k in _GROWN)} | slope |")
    print("|---|--:|--:|--:|--:|--:|")
    for name, least, made in _growths():
        sizes = [least * k for k in _GROWN]
        times = [cpu_seconds(made(n)) for n in sizes]
        slope = np.polyfit(np.log(sizes), np.log(times), 1)[0]
        shown = " | ".join(f"{seconds:.3g}" for seconds in times)
        print(f"| {name} | {least:,} | {shown} | {slope:.2f} |", flush=True)


def _growths() -> Iterator[tuple[str, int, Callable[[int], Callable[[], object]]]]:
    """What is computed, its least n, and what makes the work for any n."""
    import softreach as sr
    from softreach.plot.style import pyplot

    arm = sr.designs.minimal_trunk()

    def tips(n: int) -> np.ndarray:
        return sr.compute_cloud(arm, n).tip.values

    def drawn(n: int) -> Callable[[], object]:
        cloud = sr.compute_cloud(arm, n)
        return lambda: pyplot().close(sr.plot.plot_views(cloud, arm))

    yield "cloud of n tips", 100_000, lambda n: partial(sr.compute_cloud, arm, n)
    yield (
        "α-shape of n tips, α = 3.7 n^(-1/3) L",
        25_000,
        lambda n: partial(sr.concave_hull, tips(n), 3.7 * n ** (-1 / 3)),
    )
    yield (
        "exact set, to an error of 1/n of the volume",
        200,
        lambda n: partial(sr.reachable_set, arm, accuracy=1 / n),
    )
    yield "every branch of n targets", 1_000, lambda n: partial(sr.solve_inverse, arm, tips(n))
    yield (
        "activation distance of 10,000 of n tips, fixed radius",
        50_000,
        lambda n: partial(sr.activation_distance, sr.compute_cloud(arm, n), 1 / 60, queries=10_000),
    )
    yield "four views of n tips", 250_000, drawn


def _examples() -> Iterator[tuple[str, list[str]]]:
    """The first example of every command."""
    seen = set(LEFT_OUT)
    for file in sorted(CLI.glob("*.py")):
        for text in re.findall(r"^ +Example: softreach (.+)$", file.read_text("utf-8"), re.M):
            words = shlex.split(text)
            if words[0] not in seen:
                seen.add(words[0])
                yield words[0], words + FEWER.get(words[0], [])


def _command_row(name: str, words: list[str]) -> str:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        _provide(name, folder)
        cold = _command(words, folder)
        warm = min(_command(words, folder) for _ in range(_TURNS))
    sizes = f"{cold.wall:.1f} | {warm.wall:.2f} | {warm.peak:.0f}"
    return f"| `{shlex.join(words)}` | {sizes} |"


def _provide(name: str, folder: Path) -> None:
    """The files that a command's example reads."""
    for to, source in FILES.get(name, {}).items():
        shutil.copy(ROOT / "examples" / source, folder / to)
    rows = [f"0.2,{0.02 * k:.2f},0.6" for k in range(6)]
    (folder / "path.csv").write_text("\n".join(["x,y,z", *rows, ""]), encoding="utf-8")
    if name in BEFORE:
        _command(BEFORE[name].split(), folder)
        shutil.rmtree(folder / "cache")


def _command(words: list[str], folder: Path) -> Wait:
    """Run the command line in a process of its own; what no other command reads is removed."""
    before = {*folder.iterdir()}
    cache = folder / "cache"
    kept = {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPYCACHEPREFIX": str(cache / "bytecode")}
    kept["NUMBA_CACHE_DIR"] = str(cache)  # an installed package has its bytecode after a first run
    environment = os.environ | {"PYTHONPATH": str(ROOT / "src")} | kept
    start = time.perf_counter()
    with (folder / "said").open("w") as said:
        process = subprocess.Popen(
            [sys.executable, "-m", "softreach", *words],
            cwd=folder,
            env=environment,
            stdout=said,
            stderr=said,
        )
        _, status, used = os.wait4(process.pid, 0)
    if os.waitstatus_to_exitcode(status) not in (0, 1):  # 1: a requirement is missed
        raise RuntimeError(f"softreach {shlex.join(words)}: {(folder / 'said').read_text()}")
    for made in {*folder.iterdir()} - before - {cache, *map(folder.joinpath, _KEPT)}:
        shutil.rmtree(made) if made.is_dir() else made.unlink()
    peak = used.ru_maxrss * (1e-6 if sys.platform == "darwin" else 1e-3)
    return Wait(time.perf_counter() - start, used.ru_utime + used.ru_stime, peak)


def _function_rows() -> Iterator[str]:
    """Every public function, in this process; those that cost next to nothing share a line."""
    from tests.abuse.public_calls import CALLS
    from tests.test_names import FUNCTIONS

    warnings.simplefilter("ignore")
    quick, refused = [], []
    with tempfile.TemporaryDirectory() as place:
        for number, (name, call) in enumerate(CALLS.items()):
            function = call.function or FUNCTIONS[name]
            turns = [Path(place) / f"{number}_{turn}" for turn in range(1 + _TURNS)]
            try:
                first, *later = [_timed(function, dict(call.good()), turn) for turn in turns]
            except (OSError, SoftreachError, TypeError):
                refused.append(f"`{name}`")
                continue
            warm = min(later)
            if first.wall < 0.02 and warm.wall < 0.01:
                quick.append(f"`{name}`")
                continue
            sizes = f"{first.wall:.2f} | {warm.wall:.3f} | {warm.cpu:.3f} | {first.peak:.0f}"
            yield f"| `{name}` | {sizes} | {_why(name, warm.wall, first.wall)} |"
    yield f"\nBelow 10 ms: {', '.join(quick)}."
    yield f"\nNot timed, as their call there names no file that exists: {', '.join(refused)}."


def _timed(function: Callable[..., object], arguments: dict[str, object], place: Path) -> Wait:
    """One call; what it writes goes to a place of its own."""
    for name in ("path", "out", "folder"):
        if isinstance(arguments.get(name), str):
            place.mkdir()
            arguments[name] = place / Path(str(arguments[name])).name
    before, wall, cpu = reset_peak(), time.perf_counter(), time.process_time()
    function(**arguments)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    return Wait(wall, cpu, (peak_bytes() - before) / 1e6)


def _why(name: str, warm: float, cold: float) -> str:
    return WHY.get(name, "**not explained**") if warm > _LONG[0] or cold > _LONG[1] else ""


if __name__ == "__main__":
    main()
