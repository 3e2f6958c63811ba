"""Julia expressions of numbers and constructors, worked out without running anything.

What is read: literal numbers with `+ - * / ^` and parentheses, `pi` and `π`, names that were
assigned before, a few elementary functions, vectors, tuples, and calls of known constructors.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from softreach.exchange.activefilaments.tokens import Token, refused
from softreach.support.errors import InvalidInput

__all__ = ["CONSTRUCTORS", "Call", "Unreadable", "value_of"]

CONSTRUCTORS = (
    "MechanicalProperties",
    "Geometry",
    "FiberArchitecture",
    "PiecewiseStructure",
    "Ring",
    "InnerTube",
    "AFilament",
    "ActivationPiecewiseGamma",
)
_FUNCTIONS: Mapping[str, Callable[[float], float]] = {
    "sqrt": math.sqrt,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "asin": math.asin,
    "acos": math.acos,
    "atan": math.atan,
    "deg2rad": math.radians,
    "rad2deg": math.degrees,
    "abs": abs,
    "Float64": float,
}
_CONSTANTS = {"pi": math.pi, "π": math.pi}
_VECTORS = {"Float64", *CONSTRUCTORS}  # as in Float64[1.0, 2.0]
_DEEPEST = 50  # levels of brackets
_READ = "a number, a name assigned before, or a constructor of ActiveFilaments.jl"


@dataclass(frozen=True)
class Call:
    """A constructor with its arguments."""

    name: str
    line: int
    values: tuple[Any, ...]
    options: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Unreadable:
    """What a name stands for that was assigned something else than numbers and constructors."""

    error: InvalidInput
    names: frozenset[str]
    """What it was made from."""


def value_of(source: str, tokens: Sequence[Token], known: Mapping[str, Any]) -> Any:
    """The value of an expression.

    Args:
        source: What errors call the text.
        tokens: The expression.
        known: What names stand for.

    Raises:
        InvalidInput: Anything else than what this module reads.
    """
    reader = _Reader(source, tokens, known)
    value = reader.sum()
    if (rest := reader.peek()) is not None:
        raise refused(source, rest, "the end of the statement, or an operator + - * / ^")
    return value


class _Reader:
    """Recursive descent, one method for each level of precedence."""

    def __init__(self, source: str, tokens: Sequence[Token], known: Mapping[str, Any]) -> None:
        self.source, self.tokens, self.known = source, tokens, known
        self.place = self.depth = 0

    def peek(self) -> Token | None:
        return self.tokens[self.place] if self.place < len(self.tokens) else None

    def next_is(self, *signs: str) -> bool:
        token = self.peek()
        return token is not None and token.kind == "sign" and token.text in signs

    def take(self) -> Token:
        token = self.peek()
        if token is None:
            raise refused(self.source, self.tokens[-1], f"followed by {_READ}")
        self.place += 1
        return token

    def expect(self, sign: str) -> None:
        token = self.take()
        if token.kind != "sign" or token.text != sign:
            raise refused(self.source, token, f"{sign!r}")

    def sum(self) -> Any:
        value = self.product()
        while self.next_is("+", "-"):
            sign = self.take()
            other = self.product()
            value = self.combined(sign, value, other)
        return value

    def product(self) -> Any:
        value = self.signed()
        while self.next_is("*", "/"):
            sign = self.take()
            value = self.combined(sign, value, self.signed())
        return value

    def signed(self) -> Any:
        if self.next_is("-", "+"):
            sign = self.take()
            value = self.deeper(self.signed)
            return self.combined(sign, 0.0, value) if value != 0 else value
        return self.power()

    def power(self) -> Any:
        base = self.atom()
        if not self.next_is("^"):
            return base
        sign = self.take()
        return self.combined(sign, base, self.deeper(self.signed))

    def atom(self) -> Any:
        token = self.take()
        if token.kind == "number":
            number = self.worked_out(token, lambda: float(token.text.replace("_", "")))
            return self.multiple(number)
        if token.kind == "name":
            return self.named(token)
        if token.kind == "sign" and token.text == "(":
            return self.tuple_or_group()
        if token.kind == "sign" and token.text == "[":
            return self.deeper(lambda: self.listed("]"))
        raise refused(self.source, token, _READ)

    def multiple(self, number: float) -> float:
        """A number right before a name or a parenthesis multiplies it, as in 2π."""
        token = self.peek()
        if token is None or not token.touches:
            return number
        if token.kind == "name" or (token.kind == "sign" and token.text == "("):
            sign = Token("sign", "*", token.line, True)
            return self.combined(sign, number, self.deeper(self.power))
        return number

    def tuple_or_group(self) -> Any:
        values = self.deeper(lambda: self.listed(")"))
        one = len(values) == 1 and self.tokens[self.place - 2].text != ","
        return values[0] if one else tuple(values)

    def listed(self, end: str) -> list[Any]:
        """Values up to the closing bracket."""
        values = []
        while not self.next_is(end):
            values.append(self.sum())
            if not self.next_is(end):
                self.expect(",")
        self.take()
        return values

    def named(self, token: Token) -> Any:
        after = self.peek()
        if after is not None and after.touches and after.kind == "sign":
            if after.text == "(":
                return self.called(token)
            if after.text == "[" and token.text in _VECTORS:
                return self.atom()
        if token.text in self.known:
            value = self.known[token.text]
            if isinstance(value, Unreadable):
                raise value.error
            return value
        if token.text in _CONSTANTS:
            return _CONSTANTS[token.text]
        raise refused(self.source, token, _READ)

    def called(self, token: Token) -> Any:
        if token.text not in CONSTRUCTORS and token.text not in _FUNCTIONS:
            hint = "functions of one's own are not run: write the number"
            raise refused(self.source, token, _READ, hint)
        self.take()
        values, options = self.deeper(self.arguments)
        if token.text in CONSTRUCTORS:
            return Call(token.text, token.line, tuple(values), options)
        if len(values) != 1 or options or not isinstance(values[0], float):
            raise refused(self.source, token, "a function of one number")
        return self.worked_out(token, lambda: _FUNCTIONS[token.text](values[0]))

    def arguments(self) -> tuple[list[Any], dict[str, Any]]:
        """Positional arguments and options up to the closing parenthesis."""
        values: list[Any] = []
        options: dict[str, Any] = {}
        while not self.next_is(")"):
            named = self.place + 1 < len(self.tokens) and self.tokens[self.place + 1].text == "="
            if named:
                name = self.take().text
                self.take()
                options[name] = self.sum()
            elif self.tokens[self.place - 1].text == ";" or options:
                token = self.take()  # `f(; L)` stands for `f(; L = L)`
                options[token.text] = self.named(token)
            else:
                values.append(self.sum())
            if not self.next_is(")", ";"):
                self.expect(",")
            elif self.next_is(";"):
                self.take()
        self.take()
        return values, options

    def combined(self, sign: Token, one: Any, other: Any) -> float:
        if not isinstance(one, float) or not isinstance(other, float):
            raise refused(self.source, sign, "between two numbers")
        operations: dict[str, Callable[[], Any]] = {
            "+": lambda: one + other,
            "-": lambda: one - other,
            "*": lambda: one * other,
            "/": lambda: one / other,
            "^": lambda: one**other,
        }
        return self.worked_out(sign, operations[sign.text])

    def worked_out(self, token: Token, operation: Callable[[], Any]) -> float:
        try:
            value = operation()
        except (ArithmeticError, ValueError):
            value = math.nan
        if not isinstance(value, float) or not math.isfinite(value):
            raise refused(self.source, token, "an operation with a finite result")
        return value

    def deeper(self, read: Callable[[], Any]) -> Any:
        self.depth += 1
        if self.depth > _DEEPEST:
            raise refused(self.source, self.tokens[self.place - 1], f"within {_DEEPEST} levels")
        value = read()
        self.depth -= 1
        return value
