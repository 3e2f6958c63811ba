"""Signals that end a command: Ctrl-C, a request to terminate, a terminal that is closed."""

from __future__ import annotations

import atexit
import os
import signal
import threading
from collections.abc import Iterable

from softreach.support.files.interruption import end_process, stop_here

INTERRUPTED = "interrupted: nothing half-written was left behind"
_LAST_WORDS = {
    "SIGINT": INTERRUPTED,
    "SIGTERM": INTERRUPTED.replace("interrupted", "terminated"),
    "SIGHUP": INTERRUPTED.replace("interrupted", "hung up"),
}


def end_on_signals() -> None:
    """End this process at once on SIGINT, SIGTERM and SIGHUP, with 128 + their number.

    What ignores a signal goes on ignoring it, as under `nohup` or in the background of a script.
    """
    words = {
        getattr(signal, name): text for name, text in _LAST_WORDS.items() if name in dir(signal)
    }
    heeded = {n: text for n, text in words.items() if signal.getsignal(n) is not signal.SIG_IGN}
    arrivals, wakeup = os.pipe()
    os.set_blocking(wakeup, False)
    threading.Thread(target=_wait, args=(arrivals, heeded), daemon=True, name="signals").start()
    # Python would call a handler once the main thread is back from compiled code; it writes here
    # at once.
    signal.set_wakeup_fd(wakeup, warn_on_full_buffer=False)
    for number in heeded:
        signal.signal(number, stop_here)
    atexit.register(_ignore, heeded)  # the first registered is the last called


def _ignore(numbers: Iterable[int]) -> None:
    """A command that is done has the exit code of its work, also if a signal comes this late."""
    for number in numbers:
        signal.signal(number, signal.SIG_IGN)


def _wait(arrivals: int, heeded: dict[int, str]) -> None:
    """End the process on the first of the signals; others have handlers elsewhere."""
    while (number := os.read(arrivals, 1)[0]) not in heeded:
        pass
    end_process(128 + number, heeded[number])
