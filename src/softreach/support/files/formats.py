"""Formats of files: their suffix, and what writing them needs."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Mapping
from io import BufferedWriter
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from softreach.support.errors import InvalidInput, MissingExtra
from softreach.support.files.atomic import Foreign

_PACKAGES = {"skimage": "scikit-image"}
"""Packages by the name of their module, where that is another."""


class FileFormat(NamedTuple):
    """A format of files, or of folders, that is written."""

    libraries: tuple[str, ...] = ()
    """Libraries that are imported to write it."""
    extra: str = ""
    """The extra of softreach that brings these."""
    write: Callable[[Any, BufferedWriter], None] | None = None
    """Writes a content to a file, where several formats take the same content."""
    foreign: Foreign | None = None
    """Given for a folder: the first thing in it for which it is never replaced."""


Formats = Mapping[str, FileFormat]
"""Suffix, in lower case, -> format."""


def format_of(path: str | PathLike[str], formats: Formats, name: str = "path") -> FileFormat:
    """The format that a path names by its suffix.

    Args:
        path: The path.
        formats: What can be written there.
        name: What errors call the path.

    Raises:
        InvalidInput: Another suffix; the error lists those there are.
        MissingExtra: The format needs a library that is not installed.
    """
    known = formats.get(Path(path).suffix.lower())
    if known is None:
        raise InvalidInput(name, fspath(path), "a file name ending in " + ", ".join(formats))
    check_installed(*((library, known.extra) for library in known.libraries))
    return known


def check_installed(*needed: tuple[str, str]) -> None:
    """Say which libraries are missing, all at once, without the time that importing them takes.

    Args:
        needed: The name under which a library is imported, and the extra that brings it.

    Raises:
        MissingExtra: Some are not installed.
    """
    if missing := [pair for pair in needed if importlib.util.find_spec(pair[0]) is None]:
        raise MissingExtra(*((_PACKAGES.get(name, name), extra) for name, extra in missing))


PICTURES: Formats = dict.fromkeys(
    (".png", ".pdf", ".svg", ".eps", ".jpg", ".jpeg", ".tif", ".tiff", ".webp"),
    FileFormat(("matplotlib",), "plot"),
)
"""Formats of figures."""

PAGES: Formats = {".html": FileFormat()}
"""Formats of figures that turn in a browser."""

TABLES: Formats = {".csv": FileFormat()}
"""Formats of tables."""
