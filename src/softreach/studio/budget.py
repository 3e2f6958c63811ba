"""What one computation may use: a share of the memory that is free, and some seconds."""

from __future__ import annotations

import time
from collections.abc import Callable

from softreach.studio.worker import StaleCheck
from softreach.support.memory import free_memory

__all__ = ["Budget", "OverBudget", "memory_share"]

_SHARE = 0.2
"""Of the free memory that one computation may plan with: others hold what they found before."""
_LEFT = 0.4
"""Of the memory that was free in the beginning: with less a computation ends."""
_PAUSE = 0.2  # [s] between looks at the memory


class OverBudget(Exception):
    """A computation would need more than it may have; the text says of what."""


def memory_share() -> float:
    """What a computation that begins now may plan with [bytes]."""
    return _SHARE * free_memory()


class Budget:
    """Limits of one computation, which has to call it as often as it can."""

    def __init__(
        self, check: StaleCheck, seconds: float, report: Callable[[int], None] | None = None
    ) -> None:
        """Begin now.

        Args:
            check: Raises when the computation is no longer wanted.
            seconds: What it may take [s].
            report: Told how many items are done in all, at most some times a second.
        """
        self._check, self._report = check, report
        free = free_memory()
        self.memory = _SHARE * free
        """What it may plan with [bytes]."""
        self._least = _LEFT * free
        self._seconds, self._end = seconds, time.monotonic() + seconds
        self._next, self._done = 0.0, 0

    def __call__(self, done: int = 0) -> None:
        """Go on if that is wanted, and there is time and memory.

        Args:
            done: Items done since the last call.

        Raises:
            OverBudget: There is not.
        """
        self._check()
        self._done += done
        now = time.monotonic()
        if now > self._end:
            raise OverBudget(f"more than {self._seconds:g} s")
        if now >= self._next:
            self._next = now + _PAUSE
            self._look()

    def _look(self) -> None:
        if free_memory() < self._least:
            raise OverBudget("more memory than is free")
        if self._report is not None:
            self._report(self._done)
