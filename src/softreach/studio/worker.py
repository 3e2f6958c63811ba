"""Background work: the latest order wins, stale work is dropped, heavy work takes turns."""

from __future__ import annotations

import threading
from collections.abc import Callable

__all__ = ["Dropped", "Latest", "StaleCheck", "all_cores"]

StaleCheck = Callable[[], None]
"""Raises `Dropped` if what is being done is no longer wanted."""

all_cores = threading.Lock()
"""Held by whoever uses every core, so that tabs take turns and do not slow each other down."""


class Dropped(Exception):
    """The work in hand is no longer wanted."""


class Latest:
    """Does one piece of work at a time, and of those that wait only the last.

    The thread lives while there is work. Work is called with a check that it should make between
    its stages, and as often as it can within them.
    """

    def __init__(self, failed: Callable[[Exception], None]) -> None:
        """Start with nothing to do.

        Args:
            failed: Called with an exception other than `Dropped`.
        """
        self._failed = failed
        self._waiting: Callable[[StaleCheck], None] | None = None
        self._busy = self._closed = False
        self._changed = threading.Condition()

    def submit(self, work: Callable[[StaleCheck], None]) -> None:
        """Do this next, instead of whatever was to be next."""
        with self._changed:
            if self._closed:
                return
            self._waiting = work
            if not self._busy:
                self._busy = True
                threading.Thread(target=self._run, daemon=True).start()

    def close(self) -> None:
        """Drop everything, for good."""
        with self._changed:
            self._closed, self._waiting = True, None

    def join(self, timeout: float | None = None) -> bool:
        """Wait until there is nothing left to do; return whether that is so."""
        with self._changed:
            return self._changed.wait_for(lambda: not self._busy, timeout)

    def _run(self) -> None:
        while (work := self._next()) is not None:
            try:
                work(self._check)
            except Dropped:
                continue
            except Exception as error:  # shown to the reader; a thread has nobody to raise to
                if not self._closed:  # else the reader is gone
                    self._failed(error)

    def _next(self) -> Callable[[StaleCheck], None] | None:
        with self._changed:
            work, self._waiting = self._waiting, None
            if work is None:
                self._busy = False
                self._changed.notify_all()
            return work

    def _check(self) -> None:
        if self._closed or self._waiting is not None:
            raise Dropped
