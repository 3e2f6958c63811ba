"""What a designer varies: fields of the parts of an arm, with symbol, meaning and range."""

from __future__ import annotations

from typing import NamedTuple

from softreach.support.errors import Range

__all__ = ["Variable"]


class Variable(NamedTuple):
    """A field of a profile, a section or an actuator that is a number."""

    field: str
    """What the part calls it."""
    symbol: str
    """What formulas call it."""
    meaning: str
    """What it is, in a few words."""
    allowed: Range
    """Unit, limits, and whether it is a whole number."""
