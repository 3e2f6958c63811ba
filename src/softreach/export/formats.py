"""Tables of formats by suffix: name, content, writer, and the library that it needs."""

from __future__ import annotations

import errno
import importlib
import os
from collections.abc import Callable
from io import BufferedWriter
from os import PathLike
from typing import Any

from softreach.support.errors import MissingExtra
from softreach.support.files.atomic import writing
from softreach.support.files.kinds import FileKind, Formats, Recognizes, format_of

__all__ = ["format_file", "load_library", "write_by_suffix", "write_vtk", "write_vtu"]


def format_file(
    name: str,
    recognizes: Recognizes,
    write: Callable[[Any, BufferedWriter], None],
    library: str = "",
) -> FileKind:
    """A row of a table of formats: name, content, writer, and the library that it needs."""
    return FileKind(f"{name} file", recognizes, (library,) if library else (), "export", write)


def write_by_suffix(
    path: str | PathLike[str], formats: Formats, content: Any, *, overwrite: bool, takes: float
) -> None:
    """Write the content whole, or leave what was there.

    Args:
        path: The file.
        formats: What can be written, by suffix.
        content: What their writers take.
        overwrite: Whether it may replace anything.
        takes: What the file will take of the disk, roughly [bytes].

    Raises:
        InvalidInput: No writer for the suffix (the error lists those there are), or something else
            is there.
        MissingExtra: The format needs a library that is not installed.
        NotWritten: It cannot be written.
    """
    kind = format_of(path, formats)
    assert kind.write is not None
    with writing(path, kind, takes=takes, overwrite=overwrite) as file:
        kind.write(content, file)


def write_vtu(mesh: Any, file: BufferedWriter, **options: Any) -> None:
    """Write a mesh of meshio, which for this format opens what it is given itself."""
    load_library("meshio").vtu.write(os.fspath(file.name), mesh, **options)


def write_vtk(mesh: Any, file: BufferedWriter) -> None:
    """Write a mesh of meshio, and read it back.

    The function that it writes arrays with does not notice when a full disk takes only a part of
    the last bytes.
    """
    vtk, path = load_library("meshio").vtk, os.fspath(file.name)
    vtk.write(path, mesh)
    try:
        whole = vtk.read(path).points.shape == mesh.points.shape
    except Exception:  # whatever reading half a file may raise
        whole = False
    if not whole:
        raise OSError(errno.EIO, "the file is cut off; is the disk full?")


def load_library(module: str) -> Any:
    """An optional library, loaded at first use.

    Raises:
        MissingExtra: It is not installed.
    """
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        library = module.partition(".")[0]
        if error.name is None or error.name.partition(".")[0] != library:
            raise
        raise MissingExtra(library, "export") from error
