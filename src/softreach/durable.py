"""Files that are on the disk, not only on their way there: what a power cut cannot take."""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

__all__ = ["sync_file", "sync_file_in", "sync_folder", "sync_tree"]


def sync_file(path: Path) -> None:
    """Wait until what a file holds is on the disk."""
    _sync(path)


def sync_file_in(path: Path, root: Path) -> None:
    """Wait until a file is on the disk, with its name and those of its folders up to `root`."""
    _sync(path)
    for folder in path.parents:
        sync_folder(folder)
        if folder == root:
            return


def sync_tree(root: Path) -> None:
    """Wait until everything below a folder is on the disk, with all names."""
    walked = list(os.walk(root))
    files = [Path(folder, name) for folder, _, names in walked for name in names]
    with ThreadPoolExecutor(min(8, len(files) or 1)) as threads:  # the disk waits for all at once
        list(threads.map(_sync, files))
    for folder, _, _ in walked:
        sync_folder(Path(folder))


def sync_folder(path: Path) -> None:
    """Wait until the names in a folder are on the disk."""
    if os.name == "posix":  # elsewhere folders cannot be opened, and need not be
        _sync(path)


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
