"""Folders for what is being written: gone when the process ends, and after a kill with the next."""

from __future__ import annotations

import os
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path

from softreach.interruption import as_a_whole, undoing

try:
    import fcntl
except ModuleNotFoundError:  # no such locks on Windows: what a kill leaves there stays
    fcntl = None

__all__ = ["REPLACED", "scratch_folder"]

REPLACED = ".replaced"
"""Name in a scratch folder of the older folder that gives way to the new one."""

_PREFIX = ".softreach-unfinished-"
_PATIENCE = 1.0  # [s]


@contextmanager
def scratch_folder(parent: Path) -> Iterator[Path]:
    """An empty hidden folder beside the file to be written, removed at the end of the block.

    Signals that end the process remove it too. What `kill -9` leaves behind is removed by the next
    process that writes into `parent`: the lock of the folder, which died with its process, tells.
    """
    _remove_abandoned(parent)
    with ExitStack() as stack:
        with as_a_whole():
            folder, lock = _locked_folder(parent)
            stack.callback(_release, lock)
            stack.enter_context(undoing(partial(_remove, folder)))
        yield folder


def _locked_folder(parent: Path) -> tuple[Path, int | None]:
    while True:
        folder = Path(tempfile.mkdtemp(prefix=_PREFIX, dir=parent))
        with suppress(BlockingIOError, FileNotFoundError):
            lock = _lock(folder)
            if folder.exists():
                return folder, lock
            _release(lock)  # somebody took it for abandoned before it was locked


def _remove_abandoned(parent: Path) -> None:
    for folder in parent.glob(f"{_PREFIX}*"):
        with suppress(OSError):
            if (lock := _lock(folder)) is not None:
                _put_in_place(folder)
                _remove(folder)
                _release(lock)


def _put_in_place(folder: Path) -> None:
    """Finish a replacement that was killed after it had put the older folder aside."""
    names = {path.name for path in folder.iterdir()}
    if REPLACED in names:
        for name in names - {REPLACED}:
            if not (folder.parent / name).exists():
                (folder / name).rename(folder.parent / name)


def _lock(folder: Path) -> int | None:
    """A lock that ends with this process, or None where there is no such thing.

    Raises:
        BlockingIOError: Another process has it.
    """
    if fcntl is None:
        return None
    lock = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(lock)
        raise
    except OSError:  # a file system without them
        os.close(lock)
        return None
    return lock


def _release(lock: int | None) -> None:
    if lock is not None:
        os.close(lock)


def _remove(folder: Path) -> None:
    """Remove a folder into which other threads of a process that ends may still be writing."""
    deadline = time.monotonic() + _PATIENCE
    shutil.rmtree(folder, ignore_errors=True)
    while folder.exists() and time.monotonic() < deadline:
        time.sleep(0.01)
        shutil.rmtree(folder, ignore_errors=True)
