"""A signal ends a command at any moment: in one line, with nothing half-done."""

from __future__ import annotations

import math
import os
import pty
import random
import signal
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from benchmarks import bench_interruption
from benchmarks.bench_interruption import (
    COMMANDS,
    SAID,
    broken_files,
    ended_by,
    prepare,
    started,
)
from softreach.support.files.kinds import PICTURES

from softreach.support.files.atomic import replacing

pytestmark = [
    pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="looks for processes in /proc"),
]

_LONGEST = 2.5  # seconds after which a signal comes at the latest


def _draw(name: str) -> tuple[signal.Signals, float]:
    """A signal and a moment, the same in every run of the tests."""
    draw = random.Random(name)
    longest = 0.1 if name.endswith("writes") else _LONGEST
    return draw.choice(list(SAID)), draw.uniform(0.0, longest)


USUAL = {
    "cloud",
    "cloud, while it writes",
    "search",
    "atlas, 2 workers",
    "warmup, empty cache",
    "studio",
}
"""Commands that compute, write, have workers, compile and serve."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in USUAL else [pytest.mark.large]) for name in COMMANDS],
)
def test_a_signal_at_any_moment_ends_a_command_as_promised(name, tmp_path, monkeypatch):
    monkeypatch.setattr(bench_interruption, "LIMIT", math.inf)  # how soon is for the benchmark
    prepare(tmp_path)
    number, after = _draw(name)
    ending = ended_by(number, started(name, tmp_path), tmp_path, after)
    assert ending.faults(number) == []


def _run(folder: Path, body: str) -> subprocess.Popen[str]:
    """A script in a session of its own."""
    script = folder / "script.py"
    script.write_text(textwrap.dedent(body))
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    command = [sys.executable, str(script)]
    return subprocess.Popen(command, cwd=folder, start_new_session=True, **pipes)


def test_what_a_kill_leaves_of_a_file_goes_with_the_next_file_in_that_folder(tmp_path):
    process = _run(
        tmp_path,
        """
        import os, signal
        from softreach.support.files.atomic import replacing
        from softreach.support.files.kinds import PICTURES

        with replacing("table.csv", PICTURES[".png"]) as partial:
            partial.write_text("half a ta")
            os.kill(os.getpid(), signal.SIGKILL)
        """,
    )
    process.communicate(timeout=600)
    assert [path.name[:12] for path in tmp_path.glob(".*")] == [".softreach-u"]
    with replacing(tmp_path / "other.csv", PICTURES[".png"]) as partial:
        partial.write_text("a table")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["other.csv", "script.py"]


def test_a_folder_killed_while_it_is_replaced_is_put_in_place_by_the_next_file(tmp_path):
    (tmp_path / "cloud.zarr").mkdir()
    process = _run(
        tmp_path,
        """
        import os, signal
        from pathlib import Path
        from softreach.support.files import atomic
        from softreach.support.files.kinds import PICTURES

        def killed(*_):
            os.kill(os.getpid(), signal.SIGKILL)

        with atomic.replacing("cloud.zarr", PICTURES[".png"]) as partial:
            partial.mkdir()
            (partial / "new").touch()
            os.rename("cloud.zarr", partial.parent / atomic.REPLACED)
            killed()
        """,
    )
    process.communicate(timeout=600)
    assert not (tmp_path / "cloud.zarr").exists()
    with replacing(tmp_path / "other.csv", PICTURES[".png"]) as partial:
        partial.write_text("a table")
    assert (tmp_path / "cloud.zarr" / "new").exists()
    assert not list(tmp_path.glob(".*"))


def test_a_file_that_another_process_is_writing_is_left_alone(tmp_path):
    process = _run(
        tmp_path,
        """
        from softreach.support.files.atomic import replacing
        from softreach.support.files.kinds import PICTURES

        with replacing("table.csv", PICTURES[".png"]) as partial:
            partial.write_text("a table")
            print("writing", flush=True)
            input()
        """.replace("input()", "import time; time.sleep(2)"),
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    with replacing(tmp_path / "other.csv", PICTURES[".png"]) as partial:
        partial.write_text("another")
    assert process.communicate(timeout=600) == ("", "")
    assert (tmp_path / "table.csv").read_text() == "a table"


def test_a_block_done_as_a_whole_ends_before_the_process_and_none_begins_after(tmp_path):
    process = _run(
        tmp_path,
        """
        import os, signal, threading, time
        from pathlib import Path
        from softreach.cli.signals import end_on_signals
        from softreach.support.files.interruption import as_a_whole

        end_on_signals()
        with as_a_whole():
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(0.3)
            Path("whole").touch()
        with as_a_whole():
            Path("begun").touch()
        """,
    )
    assert process.communicate(timeout=600) == ("", SAID[signal.SIGTERM] + "\n")
    assert process.returncode == 143
    assert (tmp_path / "whole").exists()
    assert not (tmp_path / "begun").exists()


def test_signals_that_are_ignored_stay_ignored(tmp_path):
    process = _run(
        tmp_path,
        """
        import os, signal
        from softreach.cli.signals import end_on_signals

        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
        end_on_signals()
        os.kill(os.getpid(), signal.SIGHUP)
        print("goes on")
        """,
    )
    assert process.communicate(timeout=600) == ("goes on\n", "")


@pytest.mark.parametrize("closed", [False, True])
def test_a_terminal_is_left_usable_or_may_be_gone(closed, tmp_path):
    leader, follower = pty.openpty()
    command = [sys.executable, "-m", "softreach", "atlas", "build", "a.zarr", "--vary"]
    process = subprocess.Popen(
        [*command, "taper_deg=0:3:9", "--n", "100000"],
        cwd=tmp_path,
        env=os.environ | {"TERM": "xterm"},
        stdin=follower,
        stdout=follower,
        stderr=follower,
        start_new_session=True,
        preexec_fn=_take_terminal,
    )
    os.close(follower)
    shown = b""
    while b"designs" not in shown:  # of the progress bar
        shown += os.read(leader, 4096)
    if closed:
        os.close(leader)
    else:
        os.write(leader, b"\x03")
        shown = _rest(leader)
    assert process.wait(600) == (129 if closed else 130)
    assert list(broken_files(tmp_path)) == []
    if not closed:
        assert shown.endswith(b"\x1b[2K\x1b[?25h" + SAID[signal.SIGINT].encode() + b"\r\n")


def _take_terminal() -> None:
    """Make standard input the terminal of this session, and signals act as in a new one."""
    import fcntl
    import termios

    fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    for number in SAID:
        signal.signal(number, signal.SIG_DFL)


def _rest(leader: int) -> bytes:
    """All that is shown until nothing has the terminal open."""
    shown = b""
    try:
        while more := os.read(leader, 4096):
            shown += more
    except OSError:
        pass
    os.close(leader)
    return shown
