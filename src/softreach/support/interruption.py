"""End of a command by a signal: Ctrl-C, a request to terminate, a terminal that is closed."""

import os
import signal
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

INTERRUPTED = "interrupted: nothing half-written was left behind"

_LOST = 0.5  # seconds after which a lost signal is found
_came: list[int] = []  # signals to end this process


def check_stopped() -> None:
    """Raise KeyboardInterrupt after a signal to end; called once an item.

    Python loses an exception that a handler of signals raises while a finalizer runs.
    """
    if _came:
        raise KeyboardInterrupt


def wait_for_signal() -> None:
    """Wait for a signal to end, also one whose exception Python has lost."""
    while True:
        check_stopped()
        time.sleep(_LOST)


def run_stoppable(run: Callable[[], int]) -> int:
    """The exit code of a command that SIGTERM and SIGHUP end as Ctrl-C does, with one line.

    They raise KeyboardInterrupt on the main thread once the kernel or the compilation that runs
    there has ended; the process then ends here with 128 + the number of the signal. What ignores a
    signal goes on ignoring it, as under `nohup`.
    """
    numbers = [getattr(signal, name, None) for name in ("SIGINT", "SIGTERM", "SIGHUP")]
    heeded = [n for n in numbers if n is not None and signal.getsignal(n) is not signal.SIG_IGN]
    code = -1
    try:
        for number in heeded:
            signal.signal(number, _stop)
        sys.unraisablehook = _unraisable
        code = run()
    except BaseException:  # if the terminal is gone, it may be an error of writing there
        if not _came:
            raise
    for number in heeded:  # a command that is done has the exit code of its work
        signal.signal(number, signal.SIG_IGN)
    if not _came or code == 0:
        return code
    with suppress(OSError):
        sys.stdout.flush()
    with suppress(OSError):
        os.write(2, f"{INTERRUPTED}\n".encode())
    os._exit(128 + _came[0])  # else asyncio prints what Zarr had begun


def _stop(number: int, _: object) -> None:
    _came.append(number)
    raise KeyboardInterrupt


def _unraisable(lost: Any) -> None:
    if not _came:  # `check_stopped` raises a lost one again; half-made objects cannot be closed
        sys.__unraisablehook__(lost)
