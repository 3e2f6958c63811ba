"""Files appear whole or not at all."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["replacing"]


@contextmanager
def replacing(path: str | os.PathLike[str]) -> Iterator[Path]:
    """A path beside `path` to write to (a file or a folder), which takes its place on success.

    After an error or Ctrl-C nothing is left behind and an older `path` is as it was.
    """
    target = Path(path)
    target.parent.mkdir(parents=True, exist_ok=True)
    scratch = Path(tempfile.mkdtemp(prefix=f".{target.name}.", dir=target.parent))
    try:
        # The suffix stays, because writers choose their format by it.
        partial = scratch / target.name
        yield partial
        if target.is_dir():
            target.rename(scratch / "replaced")
        partial.replace(target)
    finally:
        shutil.rmtree(scratch, ignore_errors=True)
