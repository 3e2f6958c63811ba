"""How much memory there is."""

from __future__ import annotations

import os
from pathlib import Path

from softreach.errors import InvalidInput, in_short

__all__ = ["check_room", "free_memory"]

_UNKNOWN = 4e9  # where the system does not say


def free_memory() -> float:
    """Memory that can be had without swapping [bytes], or 4e9 where the system does not say."""
    free = min(_system(), _control_group())
    return free if free < float("inf") else _UNKNOWN


def check_room(name: str, rows: int, columns: int) -> None:
    """Refuse a number of rows for which there is no memory, before any is asked for.

    Args:
        name: What errors call that number.
        rows: How many.
        columns: Doubles that each row takes.

    Raises:
        InvalidInput: They would take more memory than there is.
    """
    each = 8 * columns
    if (needed := each * rows) > (free := free_memory()):
        text = f"{needed / 1e9:,.3g}" if needed < 1e300 else "endless"
        found = f"{in_short(f'{rows:,}')} ({text} GB)" if rows < 10**30 else "a number beyond 1e30"
        allowed = f"at most {int(free) // each:,}, for which there is memory"
        raise InvalidInput(name, found, f"{allowed} ({free / 1e9:.2g} GB free)")


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
