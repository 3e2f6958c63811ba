"""What makes a worker process end with its parent, whatever ended that.

Here and not beside what workers compute, as it must be imported at once and before all else.
"""

from __future__ import annotations

import signal
import threading
from multiprocessing.connection import Connection

from softreach.interruption import end_process

__all__ = ["live_with_parent"]


def live_with_parent(lifeline: Connection) -> None:
    """Leave Ctrl-C to the parent and end when it has ended; a worker calls this first.

    Args:
        lifeline: A pipe of which only the parent has the other end, and into which it sends
            nothing.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_outlive, args=(lifeline,), daemon=True, name="lifeline").start()


def _outlive(lifeline: Connection) -> None:
    try:
        lifeline.recv_bytes()
    except (EOFError, OSError):
        end_process(1)
