"""Files appear whole or not at all, and take the place of nothing but their own kind."""

from __future__ import annotations

import errno
import io
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from softreach.durable import sync_file, sync_folder, sync_tree
from softreach.errors import InvalidInput, NotWritten
from softreach.file_kinds import FileKind
from softreach.interruption import as_a_whole
from softreach.memory import check_disk
from softreach.scratch import REPLACED, scratch_folder

__all__ = ["check_place", "replacing", "writing"]

StrPath = str | os.PathLike[str]


def check_place(
    path: StrPath,
    kind: FileKind,
    *,
    takes: float = 0.0,
    overwrite: bool = False,
    name: str = "path",
) -> Path:
    """Where a file or folder of that kind can be written, by trying it.

    Args:
        path: The place.
        kind: What will be written: it may replace nothing, an empty file or folder, and its kind.
        takes: What it will take of the disk, if that may be much [bytes].
        overwrite: Whether it may replace any file, and a Zarr store of any kind.
        name: What errors call the path.

    Returns:
        The place, absolute and without links.

    Raises:
        InvalidInput: Something else is there, or the disk cannot hold it.
        NotWritten: Nothing can be written there.

    Warns:
        SoftreachWarning: It takes more than half of what is free.
    """
    with _one_line(path):
        target = _resolved(path, name)
        try:
            mode = target.stat().st_mode
        except FileNotFoundError:
            pass
        else:
            if refusal := _refusal(target, mode, kind, overwrite):
                raise InvalidInput(name, os.fspath(path), *refusal)
            if not os.access(target, os.W_OK):
                raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        with as_a_whole():
            os.rmdir(tempfile.mkdtemp(prefix=".softreach-", dir=_nearest_folder(target)))
    check_disk(name, os.fspath(path), takes, target)
    return target


@contextmanager
def replacing(
    path: StrPath,
    kind: FileKind,
    *,
    takes: float = 0.0,
    overwrite: bool = False,
    durable: bool = True,
    name: str = "path",
) -> Iterator[Path]:
    """A path beside `path` to write to (a file or a folder), which takes its place on success.

    After an error or Ctrl-C nothing is left behind and an older `path` is as it was.

    Args:
        path: The place.
        kind: What will be written.
        takes: As for `check_place`.
        overwrite: As for `check_place`.
        durable: Whether what was written is on the disk before it takes its place.
        name: What errors call the path.

    Raises:
        InvalidInput: What is there is not of that kind; see `check_place`.
        NotWritten: It cannot be written.
    """
    target = check_place(path, kind, takes=takes, overwrite=overwrite, name=name)
    with _one_line(path), _with_parents(target), scratch_folder(target.parent) as scratch:
        # The suffix stays, because writers choose their format by it.
        partial = scratch / target.name
        yield partial
        if durable:
            sync_tree(partial) if partial.is_dir() else sync_file(partial)
        with as_a_whole():
            _take_place(partial, target, scratch / REPLACED)
        if durable:
            sync_folder(target.parent)


class _WatchedFile(io.BufferedWriter):
    """A file that remembers the first error of writing, whatever the library did about it.

    Nobody writes behind its back: libraries that take the descriptor of a file lose what a full
    disk takes only a part of.
    """

    failure: OSError | None = None

    def fileno(self) -> int:
        raise io.UnsupportedOperation("fileno")

    def write(self, data: Any, /) -> int:
        try:
            return super().write(data)
        except OSError as error:
            self.failure = self.failure or error
            raise


@contextmanager
def writing(
    path: StrPath,
    kind: FileKind,
    *,
    takes: float = 0.0,
    overwrite: bool = False,
    name: str = "path",
) -> Iterator[io.BufferedWriter]:
    """A file to write to, which takes the place of `path` on success; as `replacing`.

    The file is ours and not the library's that fills it, so that no error of writing, flushing or
    closing can get lost.
    """
    with (
        replacing(path, kind, takes=takes, overwrite=overwrite, name=name) as partial,
        _WatchedFile(io.FileIO(partial, "xb")) as file,
    ):
        yield file
        if file.failure is not None:
            raise file.failure


def _resolved(path: StrPath, name: str) -> Path:
    text = os.fspath(path)
    if not text or "\0" in text:
        raise InvalidInput(name, repr(text), "the name of a file")
    return Path(os.path.realpath(text))


def _refusal(
    target: Path, mode: int, kind: FileKind, overwrite: bool
) -> tuple[str, str] | tuple[str] | None:
    """Why what is there may not be replaced: what is allowed, and what to do."""
    if stat.S_ISDIR(mode):
        content = {entry.name for entry in os.scandir(target)}
        if Path.cwd().is_relative_to(target) or (content and "zarr.json" not in content):
            return ("a new name; a folder with other things is there, which is never replaced",)
        free = not content
    elif stat.S_ISREG(mode):
        free = target.stat().st_size == 0
    else:
        return ("a file or a new name, not a device or a pipe",)
    if free or overwrite or kind.recognizes(target):
        return None
    allowed = f"a new name, or {kind.name}, which it would replace; something else is there"
    return allowed, "choose another name, or pass --overwrite (in Python overwrite=True)"


def _nearest_folder(target: Path) -> Path:
    """The folder, of those that exist, in which the first new name will appear."""
    return next(folder for folder in target.parents if os.path.lexists(folder))


@contextmanager
def _with_parents(target: Path) -> Iterator[None]:
    """Make the folders above a file, and remove those that were made if it does not get there."""
    missing = [folder for folder in target.parents if not folder.exists()]
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield
    except BaseException:
        for folder in missing:
            with suppress(OSError):
                folder.rmdir()
        raise


def _take_place(partial: Path, target: Path, replaced: Path) -> None:
    """Put the new file or folder where the old one is, or keep the old one."""
    if not partial.is_dir() and not target.is_dir():
        partial.replace(target)
        return
    if old := target.exists():
        target.rename(replaced)
    try:
        partial.rename(target)
    except BaseException:
        if old:
            replaced.rename(target)
        raise


_WHAT_TO_DO = {
    errno.ENOSPC: "free some space, or choose another disk",
    errno.EDQUOT: "free some space, or choose another disk",
    errno.EFBIG: "choose another disk, or raise the limit on the size of files",
    errno.EACCES: "choose a place that you may write to",
    errno.EPERM: "choose a place that you may write to",
    errno.EROFS: "choose a place that you may write to",
    errno.ENAMETOOLONG: "choose a shorter name",
    errno.ENOTDIR: "a part of its path is a file: choose another folder",
    errno.ELOOP: "its links lead in a circle: choose another name",
}


@contextmanager
def _one_line(path: StrPath) -> Iterator[None]:
    """Turn what the system says into what was wrong, why, and what to do."""
    try:
        yield
    except NotWritten:
        raise
    except OSError as error:
        number = error.errno or 0
        reason = error.strerror or str(error) or type(error).__name__
        raise NotWritten(os.fspath(path), number, reason, _WHAT_TO_DO.get(number, "")) from error
