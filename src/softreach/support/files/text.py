"""Text that others wrote, read up to a limit, and text of ours, written whole or not at all."""

import os
import stat
from pathlib import Path
from typing import Any

from softreach.support.arguments import as_flag, as_path
from softreach.support.errors import InvalidInput
from softreach.support.files.atomic import writing
from softreach.support.files.formats import TABLES, format_of

MEGABYTE = 1_000_000


def read_text(name: str, path: str | os.PathLike[str], most: int) -> str:
    """The text of a file of at most so many bytes in UTF-8; its lines end with a line feed."""
    return text_of(name, os.fspath(path), read_bytes(name, path, most), most)


def read_bytes(name: str, path: str | os.PathLike[str], most: int) -> bytes:
    """The content of a file, or so many bytes of it and one more, which `text_of` refuses."""
    shown = os.fspath(path)
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):  # some never end
            raise InvalidInput(name, shown, "a file, not a folder, a pipe or a device")
        with Path(path).open("rb") as stream:
            return stream.read(most + 1)
    except FileNotFoundError:
        raise InvalidInput(name, shown, "a file that exists") from None
    except OSError as error:
        raise InvalidInput(name, shown, f"a file that can be read; {error.strerror}") from None


def text_of(name: str, shown: str, content: bytes, most: int) -> str:
    """The text that `read_text` makes of the content of a file, which errors show so."""
    if len(content) > most:
        raise InvalidInput(name, shown, f"at most {most / MEGABYTE:,.3g} MB large")
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        allowed = f"text in UTF-8, which byte {error.start} is not: save it in that encoding"
        raise InvalidInput(name, shown, allowed) from None
    if (place := text.find("\0")) >= 0:
        allowed = f"text, but character {place} is NUL: save it as text in UTF-8"
        raise InvalidInput(name, shown, allowed)
    return text.replace("\r\n", "\n").replace("\r", "\n")


def write_text(path: str | os.PathLike[str], text: str, *, overwrite: bool) -> None:
    """Write text in UTF-8, whole or not at all."""
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    with writing(path, overwrite=overwrite) as file:
        file.write(text.encode())


def write_table(path: str | os.PathLike[str], table: Any, *, overwrite: bool) -> None:
    """Write a table of pandas as CSV, as `write_text`."""
    format_of(as_path("path", path), TABLES)
    text = table.to_csv(index=False, float_format="%.9g", lineterminator="\n")
    write_text(path, text, overwrite=overwrite)
