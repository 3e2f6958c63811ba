"""Whether kernels are being compiled, which only the first use on a machine has to wait for."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from numba.core import event

__all__ = ["CompilationWatch"]

_KIND = "numba:compile"


class CompilationWatch(event.Listener):
    """Calls back when compilation begins and when all of it has ended, on a compiling thread."""

    def __init__(self, changed: Callable[[bool], None]) -> None:
        """Watch from now on, until `close`."""
        self._changed, self._running, self._lock = changed, 0, threading.Lock()
        event.register(_KIND, self)

    @property
    def running(self) -> bool:
        """Whether anything is being compiled."""
        return self._running > 0

    def close(self) -> None:
        """Watch no longer."""
        event.unregister(_KIND, self)

    def on_start(self, event: Any) -> None:
        """Something is being compiled."""
        del event
        self._count(1)

    def on_end(self, event: Any) -> None:
        """It is compiled; or that failed."""
        del event
        self._count(-1)

    def _count(self, change: int) -> None:
        with self._lock:
            before, self._running = self._running, self._running + change
            now = self._running
        if bool(before) != bool(now):
            self._changed(bool(now))
