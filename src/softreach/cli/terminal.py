"""What a terminal cannot show is spelled out, and nobody minds that it is gone."""

from __future__ import annotations

import codecs
import os
import shutil
import sys
import unicodedata
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from io import TextIOWrapper

from softreach.support.errors import NotWritten

__all__ = [
    "discard_output",
    "flush_output",
    "open_missing_streams",
    "readable_width",
    "spelling_out",
]

_HANDLER = "softreach.spelled_out"

_SPELLED = {
    "²": "^2", "³": "^3", "⁻": "^-", "¹": "^1", "°": " deg", "±": "+-", "×": "x", "·": "*",
    "−": "-", "–": "-", "—": "-", "…": "...", "→": "->", "←": "<-", "≤": "<=", "≥": ">=",
    "≈": "~", "√": "sqrt", "∂": "d", "∫": "integral", "∞": "inf", "µ": "u", "’": "'", "‘": "'",
    "“": '"', "”": '"', "•": "*", "━": "-", "─": "-", "│": "|", "╸": "-", "╺": "-", "ß": "ss",
}  # fmt: skip


def spelled(character: str) -> str:
    """A character in ASCII: γ is gamma, ³ is ^3, é is e, and what has no such name its code."""
    if character in _SPELLED:
        return _SPELLED[character]
    name = unicodedata.name(character, "")
    if name.startswith("GREEK") and " LETTER " in name:
        letter = name.partition(" LETTER ")[2].partition(" ")[0].lower()
        return letter.capitalize() if "CAPITAL" in name else letter
    plain = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return plain or character.encode("ascii", "backslashreplace").decode()


def _spelled_out(error: UnicodeError) -> tuple[str | bytes, int]:
    """Replace what cannot be encoded; bytes of file names that are no text stay what they are."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    bad = error.object[error.start : error.end]
    first = bad[0]
    if "\udc80" <= first <= "\udcff":
        return bytes([ord(first) - 0xDC00]), error.start + 1
    return spelled(first), error.start + 1


codecs.register_error(_HANDLER, _spelled_out)


@contextmanager
def spelling_out() -> Iterator[None]:
    """Let standard output and standard error spell out what they cannot show, in the block."""
    before = [(stream, stream.errors) for stream in _streams()]
    for stream, _ in before:
        stream.reconfigure(errors=_HANDLER)
    try:
        yield
    finally:
        for stream, errors in before:
            with suppress(ValueError, OSError):  # closed, or full
                stream.reconfigure(errors=errors)


def _streams() -> list[TextIOWrapper]:
    return [one for one in (sys.stdout, sys.stderr) if isinstance(one, TextIOWrapper)]


_NARROWEST = 60  # columns; tables of options lose words below, and lines that wrap do not


@contextmanager
def readable_width() -> Iterator[None]:
    """Let help on a narrow terminal wrap instead of losing its words, in the block."""
    given = os.environ.get("COLUMNS")
    asked = int(given) if given is not None and given.isdecimal() else _NARROWEST
    if min(asked, shutil.get_terminal_size().columns) >= _NARROWEST:
        yield
        return
    os.environ["COLUMNS"] = str(_NARROWEST)
    try:
        yield
    finally:
        if given is None:
            del os.environ["COLUMNS"]
        else:
            os.environ["COLUMNS"] = given


def open_missing_streams() -> None:
    """Give a process that was started without them somewhere to write to.

    Otherwise the next file that is opened would become its standard output.
    """
    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, "r" if name == "stdin" else "w"))  # noqa: SIM115


def flush_output() -> None:
    """Hand over what was printed, so that a full disk is not found out after the last word.

    Raises:
        NotWritten: It cannot be written.
        BrokenPipeError: Whoever read it has gone.
    """
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except OSError as error:
        discard_output()
        reason = error.strerror or str(error)
        raise NotWritten("standard output", error.errno or 0, reason) from None


def discard_output() -> None:
    """Send what was printed and cannot be written nowhere, where Python would complain of it."""
    with suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, sys.stdout.fileno())
        os.close(nowhere)
