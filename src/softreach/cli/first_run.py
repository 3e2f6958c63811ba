"""A first run compiles kernels for a minute, and says so that nobody takes it for a hang."""

from __future__ import annotations

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["compilation_announced"]


class _Announcement(logging.Handler):
    """Says once that kernels are being compiled, however many there are."""

    said = False

    def emit(self, record: logging.LogRecord) -> None:
        if not self.said:
            self.said = True
            sys.stderr.write("softreach: compiling kernels (first run only, then cached on disk)\n")


@contextmanager
def compilation_announced() -> Iterator[None]:
    """Announce on standard error, inside the block, that kernels are being compiled."""
    log, announcement = logging.getLogger("softreach.kernels.compiler"), _Announcement()
    level = log.level
    log.addHandler(announcement)
    log.setLevel(logging.INFO)
    try:
        yield
    finally:
        log.setLevel(level)
        log.removeHandler(announcement)
