"""Degrees in files and radians in designs, without a lost digit either way."""

from __future__ import annotations

import math
from decimal import Decimal, InvalidOperation
from typing import Any

__all__ = ["Written", "degrees_text", "radians"]

_PI = Decimal("3.14159265358979323846264338327950288420")
_LONG = 17  # digits from which a number of degrees is read exactly


class Written(float):
    """A number that remembers how it was written, so that degrees convert without a lost digit."""

    def __new__(cls, text: str) -> Written:
        """The number of a text."""
        number = super().__new__(cls, text)
        number.text = text
        return number

    text: str


def radians(degrees: Any) -> float:
    """Degrees as people write them convert like `math.radians`; longer ones by exact decimals.

    Floating-point degrees miss one angle in ten by a unit in the last place; twenty digits do not.
    """
    return _radians(getattr(degrees, "text", repr(degrees)).replace("_", ""))


def degrees_text(angle: float) -> str:
    """The shortest number of degrees that converts to exactly this angle [rad]."""
    if angle == 0:
        return repr(float(angle))
    degrees = Decimal(angle) * 180 / _PI
    texts = (_decimal_text(f"{degrees:.{digits}g}") for digits in range(1, 26))
    return next((text for text in texts if _radians(text) == angle), repr(math.degrees(angle)))


def _radians(text: str) -> float:
    digits = text.lower().partition("e")[0].lstrip("+-0.").replace(".", "")
    short = len(digits) < _LONG and math.isfinite(float(text))
    try:
        if short or not Decimal(text).is_finite():
            return math.radians(float(text))
        return float(Decimal(text) * _PI / 180)
    except InvalidOperation:  # an exponent beyond all numbers
        return math.radians(float(text))


def _decimal_text(number: str) -> str:
    """A TOML float, without an exponent unless it is far from 1."""
    plain = -6 < Decimal(number).adjusted() < 16
    text = f"{Decimal(number):f}" if plain else number
    return text if "." in text or "e" in text else f"{text}.0"
