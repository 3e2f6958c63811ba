"""Keeps the state of the tab, once it rests for a moment."""

from __future__ import annotations

import time

from softreach.studio.jobs.job import Job
from softreach.studio.state import StudioState
from softreach.studio.worker import StaleCheck

__all__ = ["KeepState"]

_REST = 0.5  # [s] without changes


class KeepState(Job):
    """Writes the state to where the next tab or server finds it."""

    @staticmethod
    def depends_on(state: StudioState) -> object:
        """All of it."""
        return state

    def run(self, check: StaleCheck) -> None:
        """Wait until nothing changes, and write."""
        if self.session.work is None or not self.session.is_touched:
            return
        for _ in range(10):
            check()
            time.sleep(_REST / 10)
        check()
        self.session.keep()
