"""A signal ends a command at any moment: in one line, with its exit code, and nothing half-done."""

import os
import pty
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from softreach.support.interruption import INTERRUPTED

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks into /proc")

EXAMPLES = Path(__file__).parents[2] / "examples"
COMMANDS = {
    "computes": "cloud minimal_trunk --n 4000000",
    "writes": "cloud minimal_trunk --n 150000",
    "maps": "reach minimal_trunk --accuracy 3e-4 --out reach.stl --out reach.png",
    "sweeps": "atlas build a.zarr --vary taper_deg=0:3:9 --n 20000",
    "searches": f"search {EXAMPLES / 'five_places.toml'}",
    "compiles": "warmup --only free",
    "serves": "studio minimal_trunk --no-open",
}
OFTEN = "writes", "compiles", "serves"
"""Those of every run; a sweep loses its terminal below."""


def started(command: list[str], folder: Path, stderr: int) -> subprocess.Popen[bytes]:
    """A process in a session of its own, once it heeds signals."""
    for number in (signal.SIGINT, signal.SIGHUP):  # in the background some are ignored
        signal.signal(number, signal.default_int_handler)
    process = subprocess.Popen(
        command,
        cwd=folder,
        env=os.environ | ({"NUMBA_CACHE_DIR": str(folder)} if "warmup" in command else {}),
        stdout=subprocess.DEVNULL,
        stderr=stderr,
        start_new_session=True,
    )
    while process.poll() is None and not _catches(process.pid, signal.SIGTERM):
        time.sleep(0.005)
    return process


def _catches(pid: int, number: int) -> bool:
    caught = re.search(r"SigCgt:\s*(\w+)", Path(f"/proc/{pid}/status").read_text())
    return caught is not None and bool(int(caught[1], 16) >> (number - 1) & 1)


def processes_of(session: int) -> list[str]:
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, its_session = entry.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue
        if int(its_session) == session and state != "Z":
            found.append(entry.parent.name)
    return found


@pytest.mark.parametrize(
    "name",
    [name if name in OFTEN else pytest.param(name, marks=pytest.mark.large) for name in COMMANDS],
)
def test_a_signal_at_any_moment_ends_a_command_in_one_line_with_nothing_left(name, tmp_path):
    draw = random.Random(name)
    number = draw.choice([signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
    said = tmp_path / "said"
    with said.open("wb") as stderr:
        command = [sys.executable, "-m", "softreach", *COMMANDS[name].split()]
        process = started(command, tmp_path, stderr.fileno())
    time.sleep(draw.uniform(0.0, 2.5))
    process.send_signal(number)
    assert process.wait(600) in (0, 128 + number)
    assert process.returncode == 0 or said.read_text().splitlines()[-1] == INTERRUPTED
    assert "Traceback" not in said.read_text()
    assert processes_of(process.pid) == []
    assert [*tmp_path.rglob(".softreach-*")] == []


SWALLOWED = """
import os, signal, sys
from softreach.support import interruption, parallel

class Last:
    def __del__(self):
        try:
            os.kill(os.getpid(), signal.SIGTERM)
        except KeyboardInterrupt:
            self.handle  # as llvmlite does, whose objects are half-made then

def run():
    Last()
    WORK
    return 0

sys.exit(interruption.run_stoppable(run))
"""

GOES_ON = 'parallel.run([lambda: print("went on")])'


@pytest.mark.parametrize("work", [GOES_ON, "interruption.wait_for_signal()"])
def test_a_signal_that_python_swallows_ends_the_work_at_the_next_item(work):
    command = [sys.executable, "-c", SWALLOWED.replace("WORK", work)]
    process = subprocess.run(command, capture_output=True, text=True)
    assert (process.returncode, process.stdout) == (143, "")
    assert process.stderr == f"{INTERRUPTED}\n"


def test_what_ignores_a_signal_goes_on_ignoring_it():
    script = SWALLOWED.replace("WORK", GOES_ON)
    script = script.replace("class", "signal.signal(signal.SIGTERM, signal.SIG_IGN)\n\nclass")
    process = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert (process.returncode, process.stdout, process.stderr) == (0, "went on\n", "")


def test_a_terminal_that_is_gone_ends_a_command(tmp_path):
    leader, follower = pty.openpty()
    command = [sys.executable, "-m", "softreach", *COMMANDS["sweeps"].split()]
    process = started(command, tmp_path, follower)
    os.close(follower)
    shown = b""
    while b"designs" not in shown:  # of the progress bar
        shown += os.read(leader, 4096)
    os.close(leader)
    process.send_signal(signal.SIGHUP)
    assert process.wait(600) == 129
