"""Commands ended by signals at random moments: how they end, and what they leave behind.

`python -m benchmarks.bench_interruption MINUTES` goes on for that long; the table says how many
rounds there were and how long the slowest took.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

COMMANDS = {
    "cloud": "cloud minimal_trunk --n 4000000 --out cloud.zarr",
    "cloud, while it writes": "cloud minimal_trunk --n 150000 --out cloud.zarr",
    "volume": "volume minimal_trunk --n 400000 --out hull.ply",
    "reach": "reach minimal_trunk --accuracy 3e-4 --out reach.stl --out reach.png",
    "solve": "solve redundant_trunk --targets targets.csv --family 5 --prove-least",
    "track": "track redundant_trunk path.csv --out activations.csv",
    "equilibria": "equilibria lce_arm --payload 30g --gravity up --out equilibria.png",
    "payload": "payload lce_arm --gravity up --out payload.png",
    "gradient": "gradient lce_arm taper upper --accuracy 3e-4",
    "calibrate": "calibrate tentacle.toml tentacle.csv --free pose --free rings*modulus "
    "--report report.html --table missed.csv --out bench.toml",
    "check": "check three_fibers.toml five_places.toml --accuracy 1e-3 --out check.png",
    "search": "search five_places.toml --out best",
    "atlas": "atlas build a.zarr --vary taper_deg=0:3:9 --n 20000",
    "paper": "paper --out paper --quick",
    "demo": "demo --out demo",
    "warmup": "warmup",
    "warmup, empty cache": "warmup --no-loads",
    "studio": "studio minimal_trunk --no-open",
}
SAID = {
    signal.SIGINT: "interrupted: nothing half-written was left behind",
    signal.SIGTERM: "terminated: nothing half-written was left behind",
    signal.SIGHUP: "hung up: nothing half-written was left behind",
}
UNFINISHED = ".softreach-unfinished-*"
"""What is being written, or was when its process was killed."""

LIMIT = 2.0
"""How long a command may go on after a signal [s]."""

_PATIENCE = 30.0  # seconds after which a command counts as deaf
_ORPHANED = 5.0  # seconds in which workers must have noticed that their parent is gone


class Ending(NamedTuple):
    """How a command ended."""

    code: int
    """Its exit code; negative for a signal that cannot be caught."""
    said: str
    """Standard error."""
    seconds: float
    """From the signal to its end."""
    survivors: int
    """Processes that it started and that did not end with it."""
    broken: list[str]
    """Files that are neither whole nor absent."""

    def faults(self, number: signal.Signals) -> list[str]:
        """What is not as promised after that signal."""
        if self.code == 0:  # it was done before
            return []
        killed = number == signal.SIGKILL
        faults = {
            f"exit code {self.code}": self.code != (-9 if killed else 128 + number),
            f"said {self.said!r}": not killed and SAID.get(number, "") not in self.said,
            f"traceback {self.said!r}": "Traceback" in self.said or "rror" in self.said,
            f"{self.seconds:.1f} s": self.seconds > LIMIT,
            f"{self.survivors} processes left": self.survivors > 0,
            f"left {self.broken}": bool(self.broken),
        }
        return [what for what, found in faults.items() if found]


def prepare(folder: Path) -> None:
    """Write the files that the commands read."""
    targets = ["0.2,0.1,0.6", "0.1,0.2,0.65", "-0.2,0.1,0.6", "0.15,-0.1,0.7"]
    (folder / "targets.csv").write_text("\n".join(50 * targets))
    path = [f"0.2,{0.1 + 2e-5 * k},0.6" for k in range(5_000)]
    (folder / "path.csv").write_text("\n".join(path))
    examples = Path(__file__).parent.parent / "examples"
    for pattern in ("tentacle.*", "five_places.toml", "three_fibers.toml"):
        for file in examples.glob(pattern):
            shutil.copy(file, folder)


def started(name: str, folder: Path) -> subprocess.Popen[bytes]:
    """A command in a session of its own, which now heeds signals."""
    environment = os.environ | {"SOFTREACH_NUM_THREADS": "2"}
    if name.endswith("empty cache"):
        environment["NUMBA_CACHE_DIR"] = str(folder / ".cache")
    run = [sys.executable, "-m", "softreach", *COMMANDS[name].split()]
    for number in SAID:  # a command started in the background would go on ignoring some
        signal.signal(number, signal.default_int_handler)
    with (folder / ".said").open("wb") as said:
        process = subprocess.Popen(
            run,
            cwd=folder,
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=said,
            start_new_session=True,
        )
    while process.poll() is None and not _catches(process.pid, signal.SIGTERM):
        time.sleep(0.005)
    while name.endswith("writes") and process.poll() is None and not list(folder.glob(UNFINISHED)):
        time.sleep(0.001)
    return process


def ended_by(
    number: signal.Signals, process: subprocess.Popen[bytes], folder: Path, after: float
) -> Ending:
    """Send a signal after some seconds, as a terminal sends it to all processes or `kill` to one.

    Args:
        number: The signal.
        process: A command that was `started` in `folder`.
        folder: What it may write to.
        after: Seconds from now.
    """
    try:
        process.wait(after)
    except subprocess.TimeoutExpired:
        by_terminal = number in (signal.SIGINT, signal.SIGHUP)
        (os.killpg if by_terminal else os.kill)(process.pid, number)
    sent = time.perf_counter()
    try:
        code = process.wait(_PATIENCE)
    except subprocess.TimeoutExpired:
        process.kill()
        code = process.wait()
    seconds = time.perf_counter() - sent
    survivors = survivors_of(process.pid)
    said = (folder / ".said").read_text()
    return Ending(code, said, seconds, survivors, sorted(broken_files(folder, number)))


def broken_files(folder: Path, number: signal.Signals = signal.SIGINT) -> Iterable[str]:
    """Files that cannot be read, and unfinished ones but for those that a kill may leave."""
    for path in folder.rglob("*"):
        name = str(path.relative_to(folder))
        if name.startswith((".cache", ".said")):
            continue
        if any(mark in name for mark in (UNFINISHED[:-1], ".partial")):
            if number != signal.SIGKILL:
                yield name
        elif (read := _READERS.get(path.suffix)) is not None:
            try:
                read(path)
            except Exception as error:
                yield f"{name}: {error}"


def _read_store(path: Path) -> None:
    """Read a cloud, or an atlas as far as it got."""
    from softreach.atlas import atlas_status
    from softreach.cloud.clouds import open_cloud

    if path.name == "cloud.zarr":
        open_cloud(path).load()
    elif (path / "status").exists():
        atlas_status(path)


def _read_image(path: Path) -> None:
    from PIL import Image

    with Image.open(path) as image:
        image.load()


def _read_json(path: Path) -> None:
    json.loads(path.read_text())


_READERS: dict[str, Callable[[Path], None]] = {
    ".zarr": _read_store,
    ".json": _read_json,
    ".png": _read_image,
}


def _catches(pid: int, number: signal.Signals) -> bool:
    try:
        lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    except OSError:
        return False
    caught = next((int(line.split()[1], 16) for line in lines if line.startswith("SigCgt")), 0)
    return bool(caught >> (number - 1) & 1)


def survivors_of(session: int) -> int:
    """How many processes of a session do not end soon."""
    deadline = time.monotonic() + _ORPHANED
    while (left := _processes_of(session)) and time.monotonic() < deadline:
        time.sleep(0.05)
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    return len(left)


def _processes_of(session: int) -> list[int]:
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            state, _, _, its_session = (entry / "stat").read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(its_session) == session and state != "Z":
            found.append(int(entry.name))
    return found


def _round(name: str, number: signal.Signals, after: float) -> Ending:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        prepare(folder)
        return ended_by(number, started(name, folder), folder, after)


def main() -> None:
    """Print the table."""
    minutes = float(sys.argv[1]) if sys.argv[0].endswith("bench_interruption.py") else 5.0
    draw, deadline = random.Random(time.time_ns()), time.monotonic() + 60.0 * minutes
    endings: dict[str, list[Ending]] = defaultdict(list)
    faults = []
    while time.monotonic() < deadline:
        for name in COMMANDS:
            number = draw.choice([*SAID, signal.SIGKILL])
            longest = 0.2 if name.endswith("writes") else draw.choice([1.0, 12.0])
            after = draw.uniform(0.0, longest)
            ending = _round(name, number, after)
            endings[name].append(ending)
            found = [
                f"{name}, {number.name} after {after:.2f} s: {f}" for f in ending.faults(number)
            ]
            print("\n".join(found), file=sys.stderr, end="\n" if found else "")
            faults += found
    _print_table(endings, faults)


def _print_table(endings: dict[str, list[Ending]], faults: list[str]) -> None:
    print("## Commands ended by signals\n")
    print(
        "SIGINT, SIGTERM, SIGHUP and SIGKILL at random moments of the first 12 s of each command."
    )
    print("Ends are counted from the signal; rounds that were done before it do not count.\n")
    print("| command | rounds | median end, s | slowest end, s |")
    print("|---|--:|--:|--:|")
    total, slowest = 0, 0.0
    for name, all_of_it in endings.items():
        seconds = sorted(ending.seconds for ending in all_of_it if ending.code)
        if seconds:
            total, slowest = total + len(seconds), max(slowest, seconds[-1])
            middle = seconds[len(seconds) // 2]
            print(f"| {name} | {len(seconds)} | {middle:.2f} | {seconds[-1]:.2f} |")
    print(f"\n{total} rounds, slowest end {slowest:.2f} s, {len(faults)} not as promised.\n")
    for fault in faults:
        print(f"- {fault}")


if __name__ == "__main__":
    main()
