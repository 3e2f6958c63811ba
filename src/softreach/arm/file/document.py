"""From the text of a design file to its tables."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from os import PathLike
from typing import Any, NamedTuple

from softreach.arm.actuators import Actuator
from softreach.arm.file.degrees import Written
from softreach.arm.loads import Loads
from softreach.arm.profile import Profile
from softreach.arm.section import Section
from softreach.support.errors import Fault, InvalidDesign
from softreach.support.files.kinds import FileKind, Formats, text_with
from softreach.support.files.text import read_text

__all__ = ["DESIGN_FILE", "LONGEST", "Parts", "document_of", "text_of"]

LONGEST = 250_000
"""Bytes, or characters, that a design file may have: thousands of times as many as designs take."""


_DEEPEST = 64  # dotted parts of a key: the time that tomllib takes grows with their square


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
        InvalidInput: No file that can be read, one too large to be a design, or no text in UTF-8.
    """
    return read_text("design", path, LONGEST)


def longest_key(text: str) -> int:
    """Points in the longest stretch of a text that may be a dotted key."""
    return max(one.count(".") for one in re.split(r"[^\w.\-\"' \t]", text))


def document_of(text: str, source: str, number: Callable[[str], Any] = Written) -> dict[str, Any]:
    """The tables of TOML text; numbers with a point or an exponent remember how they were written.

    Args:
        text: The text of a design file.
        source: What errors call it.
        number: What makes a value of a number with a point or an exponent.

    Raises:
        InvalidDesign: Text that is no TOML, or too long or too deeply nested to be a design.
    """
    if len(text) > LONGEST:
        allowed = f"must be at most {LONGEST:,} characters long, and has {len(text):,}"
        raise InvalidDesign([Fault("TOML", None, allowed)], source)
    if longest_key(text) > _DEEPEST:
        allowed = f"must have keys of {_DEEPEST} parts at most, such as a.b.c of three"
        raise InvalidDesign([Fault("TOML", None, allowed)], source)
    try:
        return tomllib.loads(text, parse_float=number)
    except RecursionError:
        trouble = "tables or lists in each other, hundreds deep"
    except ValueError as error:  # beside faults of syntax, numbers of thousands of digits
        trouble = str(error)
    raise InvalidDesign([Fault("TOML", trouble, "must be valid TOML")], source)
