"""What the first run of each command of the README compiles, and how long that takes.

`python -m benchmarks.bench_cold` runs every command in a process of its own with an empty kernel
cache and prints CPU seconds of compilation by kernel, callees included.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any, NamedTuple

COMMANDS = {
    "cloud": "cloud minimal_trunk --out trunk.zarr",
    "volume": "volume minimal_trunk --alpha 0.05L",
    "reach": "reach minimal_trunk",
    "solve": "solve minimal_trunk --target 0.2,0.1,0.6",
    "demo": "demo --out demo",
}
BUDGETS = {"cloud": 4, "volume": 8, "reach": 6, "solve": 8, "demo": 15}
"""CPU seconds of compilation."""

ROOT = Path(__file__).parent.parent


class Cold(NamedTuple):
    """What one command did in a process of its own."""

    cpu: float
    """CPU seconds of the command, imports and compilation included."""
    seconds: dict[str, float]
    """CPU seconds of compilation by kernel called from Python."""
    compiled: dict[str, int]
    """How often each function was compiled, callees and those of Numba included."""
    used: dict[str, list[str]]
    """The types for which each kernel called from Python was compiled or loaded."""


def measured(name: str, folder: Path, *options: str) -> Cold:
    """Run a command of the README in a new process.

    Args:
        name: Its name.
        folder: Place for the kernel cache and the results.
        options: More of the command's options.
    """
    return recorded([*COMMANDS[name].split(), *options], folder)


def recorded(arguments: list[str], folder: Path, *, own_cache: bool = True) -> Cold:
    """Run the command line in a new process.

    Args:
        arguments: Of the command line.
        folder: Place for the results.
        own_cache: Keep kernels in that folder too, and not where they always are.
    """
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    cache = {"NUMBA_CACHE_DIR": str(folder / "cache")} if own_cache else {}
    environment = os.environ | cache | {"PYTHONPATH": path}
    record = folder / "cold.json"
    run = [sys.executable, "-m", "benchmarks.bench_cold", str(record), *arguments]
    done = subprocess.run(run, env=environment, cwd=folder, capture_output=True, text=True)
    if done.returncode:
        raise RuntimeError(f"softreach {' '.join(arguments)}: {done.stderr}")
    return Cold(**json.loads(record.read_text(encoding="utf-8")))


def main() -> None:
    """Print the table of all commands."""
    print("## The first run of each command: CPU seconds of compilation\n")
    print("An empty kernel cache, a process of its own; a kernel's time includes what it calls.\n")
    print("| command | compilation, s | budget, s | share of the CPU time | longest kernels, s |")
    print("|---|--:|--:|--:|---|")
    for name in COMMANDS:
        with tempfile.TemporaryDirectory() as folder:
            print(_row(name, measured(name, Path(folder))))


def _row(name: str, cold: Cold) -> str:
    total = sum(cold.seconds.values())
    kernels = sorted(cold.seconds.items(), key=lambda item: -item[1])
    longest = ", ".join(f"`{kernel}` {seconds:.1f}" for kernel, seconds in kernels[:5])
    return f"| `{name}` | {total:.1f} | {BUDGETS[name]} | {total / cold.cpu:.0%} | {longest} |"


def _record(arguments: list[str]) -> Cold:
    """Run the command line in this process."""
    from numba.core import event

    class Compilation(event.Listener):
        """Times compilations; those that others cause count for these."""

        def __init__(self) -> None:
            self.seconds: defaultdict[str, float] = defaultdict(float)
            self.compiled: Counter[str] = Counter()
            self.thread = threading.local()

        def on_start(self, event: Any) -> None:
            running = self.thread.__dict__.setdefault("running", [])
            running.append(time.thread_time())

        def on_end(self, event: Any) -> None:
            seconds = time.thread_time() - self.thread.running.pop()
            name = _name(event.data["dispatcher"].py_func)
            self.compiled[name] += 1
            if not self.thread.running:
                self.seconds[name] += seconds

    compilation = Compilation()
    event.register("numba:compile", compilation)
    from softreach.cli.app import run

    code = run(arguments)
    if code:
        sys.exit(code)
    return Cold(time.process_time(), compilation.seconds, compilation.compiled, _used())


def _used() -> dict[str, list[str]]:
    """Every kernel that was called from Python, and for what types."""
    from numba.core.dispatcher import Dispatcher

    modules = [module for name, module in sys.modules.items() if "softreach.kernels." in name]
    functions = {id(f): f for module in modules for f in vars(module).values()}.values()
    kernels = [f for f in functions if isinstance(f, Dispatcher) and f.overloads]
    return {_name(f.py_func): sorted(map(str, f.overloads)) for f in kernels}


def _name(function: Any) -> str:
    module = function.__module__
    file = module.rsplit(".", 1)[1] if module.startswith("softreach.kernels.") else module
    return f"{file}.{function.__name__}"


if __name__ == "__main__":
    if len(sys.argv) > 1:
        Path(sys.argv[1]).write_text(json.dumps(_record(sys.argv[2:])._asdict()), encoding="utf-8")
    else:
        main()
