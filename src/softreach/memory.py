"""How much memory there is."""

from __future__ import annotations

import os
from pathlib import Path

__all__ = ["free_memory"]

_UNKNOWN = 4e9  # where the system does not say


def free_memory() -> float:
    """Memory that can be had without swapping [bytes], or 4e9 where the system does not say."""
    free = min(_system(), _control_group())
    return free if free < float("inf") else _UNKNOWN


def _system() -> float:
    try:
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(1024.0 * int(line.split()[1]) for line in lines if "MemAvailable" in line)
    except (OSError, StopIteration, ValueError):
        pass
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")) / 2.0
    except (AttributeError, OSError, ValueError):
        return float("inf")


def _control_group() -> float:
    """What a container leaves of its limit."""
    folder = Path("/sys/fs/cgroup")
    try:
        limit = float((folder / "memory.max").read_text())
        return limit - float((folder / "memory.current").read_text())
    except (OSError, ValueError):  # no such group, or its limit is "max"
        return float("inf")
