"""Free memory, and the refusal of what needs more."""

from __future__ import annotations

import ctypes
import gc
import os
import sys
from contextlib import suppress
from pathlib import Path

from softreach.support.errors import NotPossible

_UNKNOWN = 4e9  # where the system does not say
_NOTICED = 1e8  # bytes; below, the system is not asked
_CONTROL_GROUP = Path("/sys/fs/cgroup")
_CONTROL_GROUPS = (
    ("memory.max", "memory.current", "memory.stat", "inactive_file"),
    (
        "memory/memory.limit_in_bytes",
        "memory/memory.usage_in_bytes",
        "memory/memory.stat",
        "total_inactive_file",
    ),
)
"""Files of versions 2 and 1: limit, use, and the name and place of the cache that gives way."""


def free_memory() -> float:
    """Memory that can be had without swapping [bytes], or 4e9 where the system does not say."""
    return min([_system(), *_control_groups()])


def _system() -> float:
    with suppress(OSError, StopIteration, ValueError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(1024.0 * int(line.split()[1]) for line in lines if "MemAvailable" in line)
    with suppress(AttributeError, OSError, ValueError):
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")) / 2.0
    return _UNKNOWN


def _control_groups() -> list[float]:
    """Memory that a container leaves of its limit, with the files that it keeps only to read."""
    found = []
    for limit, used, stat, kept in _CONTROL_GROUPS:
        with suppress(OSError, ValueError):  # no such group, or its limit is "max"
            lines = map(str.split, (_CONTROL_GROUP / stat).read_text().splitlines())
            cache = next((float(value) for name, value in lines if name == kept), 0.0)
            free = float((_CONTROL_GROUP / limit).read_text())
            found.append(free - float((_CONTROL_GROUP / used).read_text()) + cache)
    return found


def return_memory() -> None:
    """Return to the system what has been freed: glibc keeps it, in an arena for each thread."""
    gc.collect()
    if arrow := sys.modules.get("pyarrow"):  # whose pool is another
        arrow.default_memory_pool().release_unused()
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
        trim(0)


def check_memory(name: str, value: object, needed: float) -> None:
    """Refuse what takes more memory than is free [bytes]: Linux would grant it, then kill.

    Raises:
        NotPossible: What has this name and value needs too much.
    """
    if needed > _NOTICED and needed > (free := free_memory()):
        taken = f"{needed / 1e9:,.1f} GB of memory, of which {free / 1e9:,.1f} GB are free"
        raise NotPossible(f"{name} = {value} needs {taken}")
