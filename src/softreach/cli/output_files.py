"""Where a command writes: looked at before anything is computed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from softreach.support.files.kinds import Formats

__all__ = ["Overwrite", "check_output", "check_picture", "check_surface"]

Overwrite = Annotated[
    bool,
    Parameter(
        negative="", help="Replace what is in the way, and not only an older output of its kind."
    ),
]


def check_output(
    name: str, path: Path | None, formats: Formats, overwrite: bool, *, takes: float = 0.0
) -> None:
    """Refuse what could not be written in the end; nothing to do for an option that is not given.

    Args:
        name: The option.
        path: Its value.
        formats: What can be written there, by suffix.
        overwrite: Whether it may replace anything else.
        takes: What it will take of the disk, where that is known and may be much [bytes].

    Raises:
        InvalidInput: Another suffix, something else is there, or the disk cannot hold it.
        MissingExtra: A library that writes it is not installed.
        NotWritten: Nothing can be written there.
    """
    from softreach.support.files.atomic import check_place
    from softreach.support.files.kinds import format_of

    if path is not None:
        kind = format_of(path, formats, name)
        check_place(path, kind, takes=takes, overwrite=overwrite, name=name)


def check_picture(name: str, path: Path | None, overwrite: bool) -> None:
    """Refuse a place for a picture, as `check_output`."""
    from softreach.support.files.kinds import PICTURES

    check_output(name, path, PICTURES, overwrite)


def check_surface(name: str, path: Path | None, overwrite: bool) -> None:
    """Refuse a place for a surface, as `check_output`."""
    if path is not None:
        from softreach.export.surfaces import SURFACE_FILES

        check_output(name, path, SURFACE_FILES, overwrite)
