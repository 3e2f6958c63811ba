"""The one reader of numbers on the command line: decimal digits, and nothing that rounds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from cyclopts import Parameter, Token

from softreach.support.errors import InvalidInput
from softreach.support.quantity import read_number, read_whole_number, shortened

__all__ = ["NUMBER", "WHOLE"]


def _whole(kind: Any, tokens: Sequence[Token]) -> int:
    """A whole number: 400000, 400_000 or 4e5."""
    del kind
    try:
        return read_whole_number(tokens[0].value)
    except ValueError:
        allowed = "a whole number such as 20000 or 2e4"
        raise InvalidInput(*_name_and_value(tokens[0]), allowed) from None


def _number(kind: Any, tokens: Sequence[Token]) -> float:
    """A finite number: 0.5, 1e-6."""
    del kind
    try:
        return read_number(tokens[0].value)
    except ValueError:
        allowed = "a finite number such as 0.5 or 1e-3"
        raise InvalidInput(*_name_and_value(tokens[0]), allowed) from None


WHOLE = Parameter(converter=_whole)
"""Of every option that is an `int`."""

NUMBER = Parameter(converter=_number)
"""Of every option that is a `float`."""


def _name_and_value(token: Token) -> tuple[str, str]:
    name = (token.keyword or "number").lstrip("-").replace("-", "_")
    return name, shortened(token.value) or "''"
