"""Background work: the latest order wins, stale work is dropped, budgets and turns are kept."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from contextvars import ContextVar

from softreach.inverse.prepared import forget_prepared
from softreach.support.memory import free_memory, return_memory

StaleCheck = Callable[[], None]  # raises `Dropped` if what is being done is no longer wanted

_PATIENCE = 0.1  # [s], after which work that waits checks whether it is still wanted
_SHARE = 0.2  # of the free memory that one computation may plan with: others hold their results
_LEFT = 0.4  # of the memory that was free in the beginning: with less a computation ends
_GLANCE = 0.2  # [s] between looks at the memory
_REST, LONG_REST = 1.0, 60.0  # [s] without an end of any work, until memory is returned


class Dropped(Exception):
    """The work in hand is no longer wanted."""


_check: ContextVar[StaleCheck] = ContextVar("check", default=lambda: None)


def check_wanted() -> None:
    """Raise `Dropped` if what this thread is working on is no longer wanted."""
    _check.get()()


class _Turns:
    """A lock; work that waits for it and is no longer wanted stops waiting."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.is_taken = self._lock.locked

    def __enter__(self) -> None:
        while not self._lock.acquire(timeout=_PATIENCE):
            check_wanted()

    def __exit__(self, *_: object) -> None:
        self._lock.release()


all_cores = _Turns()
"""Held by work that uses every core, so that tabs take turns and do not slow each other down."""


class Latest:
    """Does one piece of work at a time, and of those that wait only the last.

    The thread lives while there is work. Work is called with a check that it should make between
    its stages, and as often as it can within them.
    """

    def __init__(
        self, failed: Callable[[Exception], None], idle: Callable[[], None] = lambda: None
    ) -> None:
        """Start with nothing to do; `failed` gets exceptions, `idle` follows the last work."""
        self._failed, self._idle = failed, idle
        self._waiting: Callable[[StaleCheck], object] | None = None
        self._closed = self._canceled = self.busy = False
        self._changed = threading.Condition()

    def submit(self, work: Callable[[StaleCheck], object]) -> None:
        """Do this next, instead of whatever was to be next."""
        with self._changed:
            if self._closed:
                return
            self._waiting = work
            if not self.busy:
                self.busy = True
                threading.Thread(target=self._run, daemon=True).start()

    def cancel(self) -> bool:
        """Drop what is being done and what waits; return whether there was anything."""
        with self._changed:
            self._waiting, self._canceled = None, self.busy
            return self.busy

    def close(self) -> None:
        """Drop everything, for good."""
        with self._changed:
            self._closed, self._waiting = True, None

    def join(self, timeout: float | None = None) -> bool:
        """Wait until there is nothing left to do; return whether that is so."""
        with self._changed:
            return self._changed.wait_for(lambda: not self.busy, timeout)

    def _run(self) -> None:
        _check.set(self._stale)
        while (work := self._next()) is not None:
            try:
                work(self._stale)
            except Dropped:
                continue
            except Exception as error:  # shown to the reader; a thread has nobody to raise to
                if not self._closed:  # else the reader is gone
                    self._failed(error)
        if not self._closed:
            self._idle()

    def _next(self) -> Callable[[StaleCheck], object] | None:
        with self._changed:
            work, self._waiting, self._canceled = self._waiting, None, False
            if work is None:
                self.busy = False
                self._changed.notify_all()
            return work

    def _stale(self) -> None:
        if self._closed or self._canceled or self._waiting is not None:
            raise Dropped


def rest(check: StaleCheck, seconds: float) -> None:
    """Wait for some time, as long as what comes after is still wanted."""
    for _ in range(math.ceil(seconds / _PATIENCE)):
        check()
        time.sleep(_PATIENCE)
    check()


_returned = Latest(lambda _: None)


def return_memory_soon() -> None:
    """Return what work has freed in a moment; after a minute also what is only kept to be quick."""

    def work(check: StaleCheck) -> None:
        rest(check, _REST)
        return_memory()
        rest(check, LONG_REST)
        forget_prepared()
        return_memory()

    _returned.submit(work)


class OverBudget(Exception):
    """A computation would need more than it may have; the text says of what."""


class Budget:
    """Limits of one computation, which has to call it as often as it can."""

    def __init__(
        self, check: StaleCheck, seconds: float, report: Callable[[int], None] = lambda _: None
    ) -> None:
        """Begin now, for some seconds [s]; `report` is called at times with the number of items."""
        self._check, self._report, free = check, report, free_memory()
        self.memory, self._least = _SHARE * free, _LEFT * free
        """Memory that it may plan with, and that it leaves [bytes]."""
        self._seconds, self._end = seconds, time.monotonic() + seconds
        self._next, self._done = 0.0, 0

    def __call__(self, done: int = 0) -> None:
        """Go on with so many items done if that is wanted, and there is time and memory."""
        self._check()
        self._done += done
        now = time.monotonic()
        if now > self._end:
            raise OverBudget(f"more than {self._seconds:g} s")
        if now >= self._next:
            self._next = now + _GLANCE
            if free_memory() < self._least:
                raise OverBudget("more memory than is free")
            self._report(self._done)
