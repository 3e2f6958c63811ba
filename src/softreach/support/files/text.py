"""Text that others wrote, read up to a limit that is checked before anything is read."""

from __future__ import annotations

import os
import stat
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from softreach.support.errors import InvalidInput

__all__ = ["MEGABYTE", "read_text", "tables_of"]

MEGABYTE = 1_000_000


def read_text(name: str, path: str | os.PathLike[str], most: int) -> str:
    """The text of a file in UTF-8, its lines ended by line feeds whatever ended them.

    Folders, pipes and devices are refused: some never end.

    Args:
        name: What errors call the file.
        path: Where it is.
        most: Bytes that it may have.

    Raises:
        InvalidInput: No such file, another kind of file, too large a one, or no text in UTF-8.
    """
    content = _bytes_of(name, path, most)
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise _no_text(name, path, f"byte {error.start} is none") from None
    if (place := text.find("\0")) >= 0:
        raise _no_text(name, path, f"character {place} is NUL")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def tables_of(text: str, number: Callable[[str], Any] = float) -> dict[str, Any]:
    """The tables of TOML text.

    Args:
        text: TOML.
        number: Maker of the value of a number with a point or an exponent.

    Raises:
        ValueError: No TOML, whole numbers of more than 64 bits, or tables nested without end.
    """
    try:
        tables = tomllib.loads(text, parse_float=number)
        if not _fit_64_bits(tables):
            raise OverflowError
    except tomllib.TOMLDecodeError:
        raise
    except (ValueError, OverflowError):  # of thousands of digits, which Python refuses itself
        raise ValueError("a whole number has more than 64 bits") from None
    except RecursionError:
        raise ValueError("lists or tables are nested too deep") from None
    return tables


def _fit_64_bits(value: Any) -> bool:
    if isinstance(value, dict | list):
        return all(map(_fit_64_bits, value.values() if isinstance(value, dict) else value))
    return not isinstance(value, int) or -(2**63) <= value < 2**63


def _bytes_of(name: str, path: str | os.PathLike[str], most: int) -> bytes:
    shown = os.fspath(path)
    try:
        status = os.stat(path)
        if not stat.S_ISREG(status.st_mode):
            raise InvalidInput(name, shown, "a file, not a folder, a pipe or a device")
        if status.st_size > most:
            raise _too_large(name, shown, status.st_size, most)
        with Path(path).open("rb") as stream:
            content = stream.read(most + 1)
    except FileNotFoundError:
        raise InvalidInput(name, shown, "a file that exists") from None
    except OSError as error:
        raise InvalidInput(name, shown, f"a file that can be read; {error.strerror}") from None
    if len(content) > most:  # such as those of /proc, which tell no size
        raise _too_large(name, shown, len(content), most)
    return content


def _too_large(name: str, shown: str, size: int, most: int) -> InvalidInput:
    file = f"{shown}, of {size / MEGABYTE:,.3g} MB"
    return InvalidInput(name, file, f"at most {most / MEGABYTE:,.3g} MB large")


def _no_text(name: str, path: str | os.PathLike[str], why: str) -> InvalidInput:
    allowed = f"text in UTF-8, but {why}: save it in that encoding"
    return InvalidInput(name, os.fspath(path), allowed)
