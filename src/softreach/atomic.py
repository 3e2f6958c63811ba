"""Files appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from softreach.interruption import as_a_whole
from softreach.scratch import REPLACED, scratch_folder

__all__ = ["replacing"]


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path beside `path` to write to (a file or a folder), which takes its place on success.

    After an error or Ctrl-C nothing is left behind and an older `path` is as it was.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    with scratch_folder(target.parent) as scratch:
        # The suffix stays, because writers choose their format by it.
        partial = scratch / target.name
        yield partial
        with as_a_whole():
            _take_place(partial, target, scratch / REPLACED)


def _take_place(partial: Path, target: Path, replaced: Path) -> None:
    """Put the new file or folder where the older one is, or keep that one."""
    if not target.is_dir():
        partial.replace(target)
        return
    target.rename(replaced)
    try:
        partial.rename(target)
    except BaseException:
        replaced.rename(target)
        raise
