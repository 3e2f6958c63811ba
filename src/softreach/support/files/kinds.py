"""Kinds of files: what they are called, how one is recognized, and what writing it needs."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Mapping
from io import BufferedWriter
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from softreach.support.errors import InvalidInput, MissingExtra

__all__ = [
    "PAGES",
    "PICTURES",
    "FileKind",
    "Formats",
    "Recognizes",
    "beginning_with",
    "check_installed",
    "first_entry",
    "format_of",
    "text_with",
]

Recognizes = Callable[[Path], bool]
"""True if what is at a path, which exists, is of some kind."""

_PACKAGES = {"skimage": "scikit-image"}
"""Packages by the name of their module, where that is another."""
_HEAD = 4096  # bytes in which a file says what it is


def first_entry(folder: Path) -> str:
    """The first thing in a folder; empty if there is none."""
    return min((entry.name for entry in folder.iterdir()), default="")


class FileKind(NamedTuple):
    """A kind of file that a writer writes, and therefore may replace."""

    name: str
    """In a sentence: "a PNG picture"."""
    recognizes: Recognizes
    """True if what exists at a path is of this kind."""
    libraries: tuple[str, ...] = ()
    """Libraries that are imported to write it."""
    extra: str = ""
    """The extra of softreach that brings these."""
    write: Callable[[Any, BufferedWriter], None] | None = None
    """Writes a content to a file, where several formats take the same content."""
    foreign: Callable[[Path], str] = first_entry
    """The first thing in a folder for which it is never replaced; empty if there is none."""


Formats = Mapping[str, FileKind]
"""Suffix, in lower case, -> kind."""


def format_of(path: str | PathLike[str], formats: Formats, name: str = "path") -> FileKind:
    """The kind of file that a path names by its suffix.

    Args:
        path: The path.
        formats: What can be written there.
        name: What errors call the path.

    Raises:
        InvalidInput: Another suffix; the error lists those there are.
        MissingExtra: The format needs a library that is not installed.
    """
    kind = formats.get(Path(path).suffix.lower())
    if kind is None:
        raise InvalidInput(name, fspath(path), "a file name ending in " + ", ".join(formats))
    check_installed(*((library, kind.extra) for library in kind.libraries))
    return kind


def check_installed(*needed: tuple[str, str]) -> None:
    """Say which libraries are missing, all at once, without the time that importing them takes.

    Args:
        needed: The name under which a library is imported, and the extra that brings it.

    Raises:
        MissingExtra: Some are not installed.
    """
    if missing := [(name, extra) for name, extra in needed if not _is_installed(name)]:
        raise MissingExtra(*((_PACKAGES.get(name, name), extra) for name, extra in missing))


def _is_installed(library: str) -> bool:
    try:
        return importlib.util.find_spec(library) is not None
    except ValueError:  # of modules without a specification
        return sys.modules.get(library) is not None


def beginning_with(*heads: bytes) -> Recognizes:
    """Recognize files that begin with one of these bytes."""
    return lambda path: _head(path).startswith(heads)


def text_with(*parts: str) -> Recognizes:
    """Recognize text that has all of these parts near its beginning."""
    marks = [part.encode() for part in parts]

    def recognizes(path: Path) -> bool:
        head = _head(path)
        return b"\0" not in head and all(part in head for part in marks)

    return recognizes


def _head(path: Path) -> bytes:
    with path.open("rb") as file:
        return file.read(_HEAD)


def _picture(name: str, recognizes: Recognizes) -> FileKind:
    return FileKind(f"{name} picture", recognizes, ("matplotlib",), "plot")


_JPEG = _picture("a JPEG", beginning_with(b"\xff\xd8\xff"))
_TIFF = _picture("a TIFF", beginning_with(b"II*\0", b"MM\0*"))

PICTURES: Formats = {
    ".png": _picture("a PNG", beginning_with(b"\x89PNG\r\n\x1a\n")),
    ".pdf": _picture("a PDF", beginning_with(b"%PDF-")),
    ".svg": _picture("an SVG", text_with("<svg")),
    ".eps": _picture("a PostScript", beginning_with(b"%!PS")),
    ".jpg": _JPEG,
    ".jpeg": _JPEG,
    ".tif": _TIFF,
    ".tiff": _TIFF,
    ".webp": _picture("a WebP", beginning_with(b"RIFF")),
}
"""Formats of figures."""

PAGES: Formats = {
    ".html": FileKind("a figure as a web page", text_with("<!doctype html", "softreach figure")),
}
"""Formats of figures that turn in a browser."""
