"""Files and folders appear whole or not at all, and what was there before is never lost.

A file is written beside its place, synced, and renamed over it. No system renames a folder over a
full one, so that a folder takes four steps; each name says how far a killed process came:

    .softreach-1a2b3c4d-NAME   being built: may be half
    NAME.softreach-new         whole: the one that comes to NAME
    NAME.softreach-old         whole: the one that was at NAME
    NAME                       whole, or missing for an instant: then look at the two above

What a killed process leaves under a hidden name stays, as nothing tells it from a slow one.
"""

import errno
import io
import os
import secrets
import shutil
import stat
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from softreach.support.errors import InvalidInput, NotWritten, warn

StrPath = str | os.PathLike[str]
Foreign = Callable[[Path], str]  # The first thing in a folder that is not ours; "" if none is
MARK = ".softreach-"  # Beginning of names of what is being written, and of its two at the end
_PATIENCE = 5.0  # s, in which threads of libraries end that still write there after Ctrl-C


def check_place(
    path: StrPath, *, overwrite: bool = False, foreign: Foreign | None = None, name: str = "path"
) -> Path:
    """The place, absolute and without links, where a file or a folder may be written.

    `foreign` is given for a folder, which is replaced only if it holds nothing foreign.
    """
    shown = os.fspath(path)
    place, mode = Path(os.path.realpath(shown)), None
    with _one_line(path):
        if foreign is not None and (whole := _rename_what_is_whole(place)):
            warn(f"{path}: a killed command left {whole.name}, which was renamed to it")
        with suppress(FileNotFoundError):
            mode = place.stat().st_mode
        nearest = next(folder for folder in place.parents if folder.exists())
        if not os.access(nearest, os.W_OK) or (mode and not os.access(place, os.W_OK)):
            raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))
        if mode is not None and (refusal := _refusal(place, mode, foreign, overwrite)):
            raise InvalidInput(name, shown, *refusal)
    return place


def _refusal(place: Path, mode: int, foreign: Foreign | None, overwrite: bool) -> tuple[str, ...]:
    is_folder = stat.S_ISDIR(mode)
    if not (stat.S_ISREG(mode) or (is_folder and foreign is not None)):
        return ("a new name: a folder, a device or a pipe is there",)
    if is_folder and foreign is not None and (strange := foreign(place)):
        hint = f"softreach did not write {strange} in it: move it away, or choose another name"
        return "a new name: a folder that holds other files is never replaced", hint
    hint = "choose another name, or pass --overwrite (in Python overwrite=True)"
    return () if overwrite else ("a new name, as something is there", hint)


@contextmanager
def writing(path: StrPath, *, overwrite: bool = False) -> Iterator[io.BufferedWriter]:
    """A file beside `path` to write to, which takes its place on success.

    After an error or Ctrl-C an older file is as it was. The file is ours and not the library's that
    fills it, so that no error of writing, flushing or closing can get lost; its name keeps the
    suffix of `path`.
    """
    place = check_place(path, overwrite=overwrite)
    with _one_line(path):
        partial = _beside(place)
        try:
            with _WatchedFile(io.FileIO(partial, "xb")) as file:
                yield file
                if file.failure is not None:
                    raise file.failure
            sync(partial)
            check_place(path, overwrite=overwrite)  # hours may have passed
            os.replace(partial, place)
            sync(place.parent)
        finally:
            partial.unlink(missing_ok=True)


@contextmanager
def replacing_folder(path: StrPath, foreign: Foreign, *, overwrite: bool = False) -> Iterator[Path]:
    """An empty folder beside `path`, which takes its place on success; as `writing`."""
    place = check_place(path, overwrite=overwrite, foreign=foreign)
    new, old = _siblings(place)
    with _one_line(path):
        building = _beside(place)
        building.mkdir()
        try:
            yield building
            for folder, _, names in os.walk(building, topdown=False):
                for name in (*names, ""):  # of the folder last
                    sync(Path(folder, name))
            check_place(path, overwrite=overwrite, foreign=foreign)
            _discard(new)  # of replacements that were killed: NAME is no older
            _discard(old)
            os.rename(building, new)  # from here on it is whole
            if os.path.lexists(place):
                os.rename(place, old)
            os.rename(new, place)
            sync(place.parent)  # before the old one goes
            _discard(old)
        finally:
            deadline = time.monotonic() + _PATIENCE
            while building.exists() and time.monotonic() < deadline:
                shutil.rmtree(building, ignore_errors=True)
            _rename_what_is_whole(place)  # after Ctrl-C between two renames


def place_to_read(path: StrPath) -> str:
    """The place of a folder to be read: its name, or where a killed process left it."""
    if whole := _whole(Path(os.path.realpath(path))):
        warn(f"{path}: a killed command left {whole.name}, which is read")
    return os.fspath(whole or path)


def sync(path: Path) -> None:
    """Wait until the content of a file, or the names in a folder, are on the disk."""
    if os.name != "posix" and path.is_dir():  # folders cannot be opened there, and need not be
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _beside(place: Path) -> Path:
    """A new name, which keeps the suffix, as writers choose their format by it."""
    place.parent.mkdir(parents=True, exist_ok=True)
    return place.with_name(f"{MARK}{secrets.token_hex(4)}-{place.name[-40:]}")


def _siblings(place: Path) -> tuple[Path, Path]:
    return place.with_name(f"{place.name}{MARK}new"), place.with_name(f"{place.name}{MARK}old")


def _whole(place: Path) -> Path | None:
    """What a killed process left whole of a folder that is missing."""
    return next(filter(Path.is_dir, () if os.path.lexists(place) else _siblings(place)), None)


def _rename_what_is_whole(place: Path) -> Path | None:
    if whole := _whole(place):
        os.rename(whole, place)
    return whole


def _discard(whole: Path) -> None:
    """Remove what is there, renamed first: no reader may take half of it for the whole."""
    if os.path.lexists(whole):
        trash = _beside(whole)
        os.rename(whole, trash)
        if trash.is_dir():
            shutil.rmtree(trash, ignore_errors=True)
        else:
            trash.unlink()


@contextmanager
def _one_line(path: StrPath) -> Iterator[None]:
    try:
        yield
    except NotWritten:
        raise
    except OSError as error:
        reason = error.strerror or str(error) or type(error).__name__
        raise NotWritten(os.fspath(path), error.errno or 0, reason) from error


class _WatchedFile(io.BufferedWriter):
    """A file that remembers the first error of writing, also one that a library ignores.

    Libraries that take the descriptor of a file lose what a full disk takes only a part of.
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
