"""Free memory, and the refusal of what needs more."""

import ctypes
import gc
import math
import os
import re
import sys
from contextlib import suppress
from pathlib import Path

from softreach.support.errors import NotPossible

_UNKNOWN = 4e9  # where the system does not say
_NOTICED = 1e8  # bytes; below, the system is not asked
_CONTROL_GROUP = Path("/sys/fs/cgroup")  # of version 2


def free_memory() -> float:
    """Memory that can be had without swapping [bytes], or 4e9 where the system does not say."""
    left = math.inf
    with suppress(OSError, ValueError):  # no container, or its limit is "max"
        names = ("memory.max", "memory.current", "memory.stat")
        limit, used, stat = ((_CONTROL_GROUP / name).read_text() for name in names)
        cache = re.search(r"^inactive_file (\d+)", stat, re.MULTILINE)  # kept only to be read
        left = float(limit) - float(used) + (float(cache[1]) if cache else 0.0)
    return min(_system(), left)


def _system() -> float:
    with suppress(OSError, StopIteration, ValueError):
        lines = Path("/proc/meminfo").read_text().splitlines()
        return next(1024.0 * int(line.split()[1]) for line in lines if "MemAvailable" in line)
    with suppress(AttributeError, OSError, ValueError):
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")) / 2.0
    return _UNKNOWN


def return_memory() -> None:
    """Return to the system what has been freed: glibc keeps it, in an arena for each thread."""
    gc.collect()
    if arrow := sys.modules.get("pyarrow"):  # whose pool is another
        arrow.default_memory_pool().release_unused()
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
        trim(0)


def check_memory(name: str, value: object, needed: float) -> None:
    """Refuse what takes more memory than is free [bytes]: Linux would grant it, then kill."""
    if needed > _NOTICED and needed > (free := free_memory()):
        taken = f"{needed / 1e9:,.1f} GB of memory, of which {free / 1e9:,.1f} GB are free"
        raise NotPossible(f"{name} = {value} needs {taken}")
