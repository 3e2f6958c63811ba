"""Formats of files: their suffix, and what writing them needs."""

from collections.abc import Callable, Mapping
from io import BufferedWriter
from os import PathLike, fspath
from pathlib import Path
from typing import Any, NamedTuple

from softreach.support.errors import InvalidInput, check_installed
from softreach.support.files.atomic import Foreign


class FileFormat(NamedTuple):
    """A format of files, or of folders, that is written."""

    libraries: tuple[str, ...] = ()  # Modules that are imported to write it
    write: Callable[[Any, BufferedWriter], None] | None = None  # Where several take one content
    foreign: Foreign | None = None  # Of a folder: the first thing for which it is never replaced


Formats = Mapping[str, FileFormat]  # Suffix, in lower case, -> format


def format_of(path: str | PathLike[str], formats: Formats, name: str = "path") -> FileFormat:
    """The format that a path names by its suffix; what writing it needs must be installed."""
    known = formats.get(Path(path).suffix.lower())
    if known is None:
        raise InvalidInput(name, fspath(path), "a file name ending in " + ", ".join(formats))
    check_installed(*known.libraries)
    return known


_FIGURES = (".png", ".pdf", ".svg", ".eps", ".jpg", ".jpeg", ".tif", ".tiff", ".webp")
PICTURES: Formats = dict.fromkeys(_FIGURES, FileFormat(("matplotlib",)))  # Formats of figures
PAGES: Formats = {".html": FileFormat()}  # Formats of figures that turn in a browser
TABLES: Formats = {".csv": FileFormat()}  # Formats of tables
