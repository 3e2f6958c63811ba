"""Files appear whole or not at all, and take the place of nothing but their own kind."""

from __future__ import annotations

import errno
import io
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

from softreach.support.errors import InvalidInput, NotWritten
from softreach.support.files.interruption import as_a_whole, undoing
from softreach.support.files.kinds import FileKind

try:
    import fcntl
except ModuleNotFoundError:  # no such locks on Windows: what a kill leaves there stays
    fcntl = None


REPLACED = ".replaced"
"""Name in a scratch folder of the older folder that gives way to the new one."""

_PREFIX = ".softreach-unfinished-"
_PATIENCE = 1.0  # [s]

StrPath = str | os.PathLike[str]
_NO_ROOM = "free some space, or choose another disk"
_NO_RIGHT = "choose a place that you may write to"
_REMEDIES = {
    errno.ENOSPC: _NO_ROOM,
    errno.EDQUOT: _NO_ROOM,
    errno.EFBIG: "choose another disk, or raise the limit on the size of files",
    errno.EACCES: _NO_RIGHT,
    errno.EPERM: _NO_RIGHT,
    errno.EROFS: _NO_RIGHT,
    errno.ENAMETOOLONG: "choose another name",
    errno.ELOOP: "choose another name",
    errno.ENOTDIR: "a part of its path is a file: choose another folder",
}


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


def check_place(
    path: StrPath,
    kind: FileKind,
    *,
    overwrite: bool = False,
    name: str = "path",
) -> Path:
    """Place where a file or folder of that kind can be written, found by trying it.

    Args:
        path: The place.
        kind: What will be written: it may replace nothing, an empty file or folder, and its kind.
        overwrite: Whether it may replace any file, and any store of softreach. A folder with
            anything else in it is never replaced.
        name: What errors call the path.

    Returns:
        The place, absolute and without links.

    Raises:
        InvalidInput: Something else is there.
        NotWritten: Nothing can be written there.
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
    return target


@contextmanager
def replacing(
    path: StrPath,
    kind: FileKind,
    *,
    overwrite: bool = False,
    durable: bool = True,
    name: str = "path",
) -> Iterator[Path]:
    """A path beside `path` to write to (a file or a folder), which takes its place on success.

    After an error or Ctrl-C nothing is left behind and an older `path` is as it was.

    Args:
        path: The place.
        kind: What will be written.
        overwrite: As for `check_place`.
        durable: Whether what was written is on the disk before it takes its place.
        name: What errors call the path.

    Raises:
        InvalidInput: What is there is not of that kind; see `check_place`.
        NotWritten: It cannot be written.
    """
    target = check_place(path, kind, overwrite=overwrite, name=name)
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


@contextmanager
def writing(
    path: StrPath,
    kind: FileKind,
    *,
    overwrite: bool = False,
    name: str = "path",
) -> Iterator[io.BufferedWriter]:
    """A file to write to, which takes the place of `path` on success; as `replacing`.

    The file is ours and not the library's that fills it, so that no error of writing, flushing or
    closing can get lost.
    """
    with (
        replacing(path, kind, overwrite=overwrite, name=name) as partial,
        _WatchedFile(io.FileIO(partial, "xb")) as file,
    ):
        yield file
        if file.failure is not None:
            raise file.failure


def _sync(path: Path) -> None:
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


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


def _resolved(path: StrPath, name: str) -> Path:
    text = os.fspath(path)
    if not text or "\0" in text:
        raise InvalidInput(name, repr(text), "the name of a file")
    return Path(os.path.realpath(text))


def _refusal(
    target: Path, mode: int, kind: FileKind, overwrite: bool
) -> tuple[str, str] | tuple[str] | None:
    """Reason why what is there may not be replaced: what is allowed, and what to do."""
    if stat.S_ISDIR(mode):
        foreign = kind.foreign(target)
        if foreign or Path.cwd().is_relative_to(target):
            allowed = "a new name; a folder with other things is there, which is never replaced"
            hint = f"{foreign} is not as softreach wrote it: move it away, or choose another name"
            return (allowed, hint) if foreign else (allowed,)
        free = not any(target.iterdir())
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
        raise NotWritten(os.fspath(path), number, reason, _REMEDIES.get(number, "")) from error
