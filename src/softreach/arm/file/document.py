"""From the text of a design file to its tables."""

from __future__ import annotations

import tomllib
from os import PathLike, fspath
from typing import Any, NamedTuple

from softreach.arm.actuators import Actuator
from softreach.arm.file.degrees import Written
from softreach.arm.loads import Loads
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.errors import Fault, InvalidDesign
from softreach.file_kinds import FileKind, Formats, text_with

__all__ = ["DESIGN_FILE", "LONGEST", "Parts", "document_of", "text_of"]

LONGEST = 1_000_000
"""Characters that a design file may have: thousands of times as many as designs take."""


DESIGN_FILE: Formats = {".toml": FileKind("a design file", text_with("length_m"))}
"""What a design is saved as, and replaces."""


class Parts(NamedTuple):
    """What a file describes."""

    profile: Profile
    section: Section
    actuators: tuple[Actuator, ...]
    bounds: Any = None
    """Activation bounds for all bundles together; None where the actuators hold their own."""
    loads: Loads | None = None


def text_of(path: str | PathLike[str]) -> str:
    """The text of a design file.

    Raises:
        InvalidDesign: Bytes that are no UTF-8, or too many of them to be a design.
        OSError: The file cannot be read.
    """
    with open(path, "rb") as stream:
        content = stream.read(4 * LONGEST + 1)
    if len(content) > 4 * LONGEST:
        raise InvalidDesign([_too_long(f"more than {4 * LONGEST:,} bytes")], fspath(path))
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        allowed = f"must be text in UTF-8, but byte {error.start} is none: save it in that encoding"
        raise InvalidDesign([Fault("TOML", None, allowed)], fspath(path)) from None


def _too_long(length: str) -> Fault:
    return Fault("TOML", None, f"must be at most {LONGEST:,} characters long, and has {length}")


def document_of(text: str, source: str) -> dict[str, Any]:
    """The tables of TOML text; numbers with a point or an exponent remember how they were written.

    Args:
        text: The text of a design file.
        source: What errors call it.

    Raises:
        InvalidDesign: Text that is no TOML, or too long or too deeply nested to be a design.
    """
    if len(text) > LONGEST:
        raise InvalidDesign([_too_long(f"{len(text):,}")], source)
    try:
        return tomllib.loads(text, parse_float=Written)
    except RecursionError:
        trouble = "tables or lists in each other, hundreds deep"
    except ValueError as error:  # beside faults of syntax, numbers of thousands of digits
        trouble = str(error)
    raise InvalidDesign([Fault("TOML", trouble, "must be valid TOML")], source)
