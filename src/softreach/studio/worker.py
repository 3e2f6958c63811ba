"""Background work: the latest order wins, stale work is dropped, heavy work takes turns."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextvars import ContextVar

__all__ = ["Dropped", "Latest", "StaleCheck", "all_cores", "check_wanted"]

StaleCheck = Callable[[], None]
"""Raises `Dropped` if what is being done is no longer wanted."""

_PATIENCE = 0.1  # [s], after which whoever waits for a turn looks whether it is still wanted


class Dropped(Exception):
    """The work in hand is no longer wanted."""


def _always_wanted() -> None:
    """What is done outside of a worker is always wanted."""


_check: ContextVar[StaleCheck] = ContextVar("check", default=_always_wanted)


def check_wanted() -> None:
    """Raise `Dropped` if what this thread is working on is no longer wanted."""
    _check.get()()


class _Turns:
    """A lock; whoever waits for it and is no longer wanted stops waiting."""

    def __init__(self) -> None:
        self._lock = threading.Lock()

    def __enter__(self) -> None:
        while not self._lock.acquire(timeout=_PATIENCE):
            check_wanted()

    def __exit__(self, *_: object) -> None:
        self._lock.release()


all_cores = _Turns()
"""Held by whoever uses every core, so that tabs take turns and do not slow each other down."""


class Latest:
    """Does one piece of work at a time, and of those that wait only the last.

    The thread lives while there is work. Work is called with a check that it should make between
    its stages, and as often as it can within them.
    """

    def __init__(
        self, failed: Callable[[Exception], None], idle: Callable[[], None] = _always_wanted
    ) -> None:
        """Start with nothing to do.

        Args:
            failed: Called with an exception other than `Dropped`.
            idle: Called when there is nothing left to do.
        """
        self._failed, self._idle = failed, idle
        self._waiting: Callable[[StaleCheck], None] | None = None
        self._busy = self._closed = self._canceled = False
        self._changed = threading.Condition()

    @property
    def busy(self) -> bool:
        """Whether there is something to do."""
        return self._busy

    def submit(self, work: Callable[[StaleCheck], None]) -> None:
        """Do this next, instead of whatever was to be next."""
        with self._changed:
            if self._closed:
                return
            self._waiting = work
            if not self._busy:
                self._busy = True
                threading.Thread(target=self._run, daemon=True).start()

    def cancel(self) -> bool:
        """Drop what is being done and what waits; return whether there was anything."""
        with self._changed:
            self._waiting, self._canceled = None, self._busy
            return self._busy

    def close(self) -> None:
        """Drop everything, for good."""
        with self._changed:
            self._closed, self._waiting = True, None

    def join(self, timeout: float | None = None) -> bool:
        """Wait until there is nothing left to do; return whether that is so."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._busy, timeout)

    def _run(self) -> None:
        _check.set(self._check)
        while (work := self._next()) is not None:
            try:
                work(self._check)
            except Dropped:
                continue
            except Exception as error:  # shown to the reader; a thread has nobody to raise to
                if not self._closed:  # else the reader is gone
                    self._failed(error)
        if not self._closed:
            self._idle()

    def _next(self) -> Callable[[StaleCheck], None] | None:
        with self._changed:
            work, self._waiting, self._canceled = self._waiting, None, False
            if work is None:
                self._busy = False
                self._changed.notify_all()
            return work

    def _check(self) -> None:
        if self._closed or self._canceled or self._waiting is not None:
            raise Dropped
