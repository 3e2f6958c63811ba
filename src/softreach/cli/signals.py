"""Signals that end a command: Ctrl-C, a request to terminate, a terminal that is closed."""

from __future__ import annotations

import os
import signal
import threading

from softreach.support.files.interruption import end_process, stop_here

__all__ = ["INTERRUPTED", "end_on_signals"]

INTERRUPTED = "interrupted: nothing half-written was left behind"
_SAID = {
    "SIGINT": INTERRUPTED,
    "SIGTERM": INTERRUPTED.replace("interrupted", "terminated"),
    "SIGHUP": INTERRUPTED.replace("interrupted", "hung up"),
}


def end_on_signals() -> None:
    """End this process on these signals at once, whatever it does, with 128 + their number.

    What ignores a signal goes on ignoring it, as under `nohup` or in the background of a script.
    """
    numbers = {getattr(signal, name): said for name, said in _SAID.items() if hasattr(signal, name)}
    heeded = {n: said for n, said in numbers.items() if signal.getsignal(n) is not signal.SIG_IGN}
    arrivals, wakeup = os.pipe()
    os.set_blocking(wakeup, False)
    threading.Thread(target=_wait, args=(arrivals, heeded), daemon=True, name="signals").start()
    # Python would call a handler once the main thread is back from compiled code; it writes here
    # at once.
    signal.set_wakeup_fd(wakeup, warn_on_full_buffer=False)
    for number in heeded:
        signal.signal(number, stop_here)


def _wait(arrivals: int, heeded: dict[int, str]) -> None:
    """End the process on the first of the signals; others have handlers elsewhere."""
    while (number := os.read(arrivals, 1)[0]) not in heeded:
        pass
    end_process(128 + number, heeded[number])
