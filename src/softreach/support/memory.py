"""Free memory and disk space, and checks of what is asked of them."""

from __future__ import annotations

import ctypes
import gc
import os
import shutil
import sys
from pathlib import Path

from softreach.support.errors import InvalidInput, warn

__all__ = ["check_disk", "check_memory", "check_room", "free_disk", "free_memory", "return_memory"]

_UNKNOWN = 4e9  # where the system does not say
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
    """Memory that a container leaves of its limit, with the files that it keeps only to read."""
    for limit, used, stat, kept in _CONTROL_GROUPS:
        try:
            lines = map(str.split, (_CONTROL_GROUP / stat).read_text().splitlines())
            cache = next((float(value) for name, value in lines if name == kept), 0.0)
            free = float((_CONTROL_GROUP / limit).read_text())
            return free - float((_CONTROL_GROUP / used).read_text()) + cache
        except (OSError, ValueError):  # no such group, or its limit is "max"
            continue
    return float("inf")


def return_memory() -> None:
    """Return to the system what has been freed: glibc keeps it, in an arena for each thread."""
    gc.collect()
    if arrow := sys.modules.get("pyarrow"):  # whose pool is another
        arrow.default_memory_pool().release_unused()
    if sys.platform == "linux" and (trim := getattr(ctypes.CDLL(None), "malloc_trim", None)):
        trim(0)


def free_disk(path: str | os.PathLike[str]) -> float:
    """Bytes that may be written where `path` is or will be; infinite where nobody knows."""
    place = Path(path).absolute()
    try:
        return float(shutil.disk_usage(next(p for p in (place, *place.parents) if p.exists())).free)
    except (OSError, StopIteration):
        return float("inf")


def check_memory(name: str, value: object, needed: float) -> None:
    """Say what something will take of the memory, before it is taken.

    Args:
        name: The argument that decides.
        value: What it is.
        needed: What follows from it [bytes].

    Raises:
        InvalidInput: It is more than there is.

    Warns:
        SoftreachWarning: It is more than half of what there is.
    """
    if needed > _NOTICED:
        _check(name, value, float(min(needed, 1e300)), free_memory(), "memory")


def check_room(name: str, rows: int, columns: int) -> None:
    """As `check_memory`, for a number of rows, each of so many doubles."""
    if (needed := 8 * columns * rows) > _NOTICED:
        shown = f"{rows:,}" if rows < 10**30 else "a number beyond 1e30"
        check_memory(name, shown, needed)


def check_disk(name: str, value: object, needed: float, path: str | os.PathLike[str]) -> None:
    """Say what something will take of the disk that `path` is on; as `check_memory`."""
    if needed > _NOTICED:
        _check(name, value, needed, free_disk(path), "disk space")


_NOTICED = 1e6  # bytes; below, nobody asks the system


def _check(name: str, value: object, needed: float, free: float, what: str) -> None:
    taken = f"{_size(needed)} of {what}, of which {_size(free)} are free"
    if needed > free:
        raise InvalidInput(name, value, f"smaller: it takes {taken}")
    if needed > free / 2:
        warn(f"{name} = {value} takes {taken}")


def _size(number: float) -> str:
    """A number of bytes with two or three digits."""
    for unit in ("bytes", "kB", "MB", "GB", "TB", "PB"):
        if number < 999.5:
            return f"{number:.3g} {unit}"
        number /= 1000
    return f"{number:.3g} EB"
