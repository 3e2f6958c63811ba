"""Worker processes on this machine, which end with the process that started them."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing.connection import Connection, wait
from typing import Any

from softreach.support.arguments import as_integer

__all__ = ["WORKERS", "LocalProcesses", "Workers", "worker_processes"]

WORKERS = 1, 1_024
"""Smallest and largest number of processes of one machine."""

Workers = Callable[[], Executor]
"""Starts a pool; called again when a dead worker has broken the one before."""


def worker_processes(count: int) -> Workers:
    """Worker processes on this machine, restarted if one dies.

    They end with this process, whatever ends it.

    Args:
        count: Number of processes; each uses one thread.

    Raises:
        InvalidInput: Not a whole number from 1 to 1,024.
    """
    count = as_integer("count", count, *WORKERS)
    return lambda: LocalProcesses(count)


_PATIENCE = 1.0  # [s] for workers to end
_QUIET = "ignore::UserWarning:multiprocessing.resource_tracker"


class LocalProcesses(ProcessPoolExecutor):
    """A pool whose workers live as long as a pipe of which only their parent has the other end."""

    def __init__(self, count: int) -> None:
        """Start none before the first task.

        Args:
            count: Number of processes.
        """
        context = multiprocessing.get_context("spawn")  # threads and forks do not mix
        _start_quiet_tracker()
        other_end, self._lifeline = context.Pipe(duplex=False)
        first: Any = {"initializer": _live_with_parent, "initargs": (other_end,)}
        super().__init__(count, mp_context=context, **first)

    def submit(self, *call: Any, **options: Any) -> Future[Any]:
        """Hand a call to a worker."""
        with _no_interrupts():  # a worker may start now
            return super().submit(*call, **options)

    def abandon(self) -> None:
        """End all workers without waiting for what they compute."""
        processes = list((self._processes or {}).values())
        self._lifeline.close()
        for process in processes:
            if not wait([process.sentinel], _PATIENCE):
                process.kill()


def _start_quiet_tracker() -> None:
    """Let Python clean up after processes that were killed without a warning that it does."""
    if sys.platform == "win32":  # where there is nothing to clean up
        return
    from multiprocessing import resource_tracker

    sys.warnoptions.append(_QUIET)
    try:
        resource_tracker.ensure_running()
    finally:
        sys.warnoptions.remove(_QUIET)


@contextlib.contextmanager
def _no_interrupts() -> Iterator[None]:
    """Keep Ctrl-C from this thread and from processes that it starts meanwhile."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _live_with_parent(lifeline: Connection) -> None:
    """Leave Ctrl-C to the parent and end when it has ended."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})
    threading.Thread(target=_outlive, args=(lifeline,), daemon=True, name="lifeline").start()


def _outlive(lifeline: Connection) -> None:
    try:
        lifeline.recv_bytes()
    except (EOFError, OSError):
        os._exit(1)
