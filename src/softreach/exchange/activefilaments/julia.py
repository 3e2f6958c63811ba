"""Julia source read by a grammar and never run: the value of each name in it.

Read are literal numbers with `+ - * / ^` and parentheses, `pi` and `π`, names that were assigned
before, a few elementary functions, vectors, tuples, and constructors of ActiveFilaments.jl. A
statement of another kind is passed over, unless the filament depends on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import add, mul, pow, sub, truediv
from typing import Any, NamedTuple

from lark import Lark, Token, Transformer, UnexpectedToken, v_args

from softreach.exchange.activefilaments.constructors import (
    CONSTRUCTORS,
    Unreadable,
    constructed,
)
from softreach.support.errors import InvalidInput

__all__ = ["Julia"]

_NUMBER = r"(?>(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)"
_NAME = r"[^\W\d]\w*(?:!(?!=))?"
_GRAMMAR = rf"""
?sum: product
    | sum (PLUS | MINUS) product -> combined
?product: signed
    | product (STAR | SLASH) signed -> combined
?signed: power
    | (PLUS | MINUS) signed -> negated
?power: atom
    | atom CIRCUMFLEX signed -> combined
    | MULTIPLE power -> multiple
?atom: NUMBER -> number
    | NAME -> named
    | "(" sum ")"
    | "(" ")" -> tuple
    | "(" sum "," _values? ")" -> tuple
    | _VECTOR? "[" _values? "]" -> vector
    | CALL "(" (_arguments [";" _options?] | ";" _options?)? ")" -> called
_values: sum ("," sum)* ","?
_arguments: (sum | option) ("," (sum | option))* ","?
_options: (option | short) ("," (option | short))* ","?
option: NAME EQUAL sum
short: NAME

other: NEWLINE | TEXT | ASSIGN | COMPARE | OTHER  // in statements that are passed over

PLUS: "+"
MINUS: "-"
STAR: "*"
SLASH: "/"
CIRCUMFLEX: "^"
EQUAL: "="
MULTIPLE.4: /{_NUMBER}(?=[^\W\d]|\()/  // as in 2π and 2(a + b)
NUMBER.3: /{_NUMBER}/
_VECTOR.4: /(?:Float64|{"|".join(CONSTRUCTORS)})(?=\[)/  // as in Float64[1.0, 2.0]
CALL.3: /{_NAME}(?=\()/
NAME.2: /{_NAME}/
TEXT.2: /\"\"\".*?\"\"\"|"(?:\\.|[^"\\\n])*"/s
ASSIGN.2: /\.?[-+*\/^]=|\.=/
COMPARE.2: /[=<>!]=|[=-]>/
NEWLINE: /\n/
OTHER.-1: /./s
%ignore /#=.*?=#|#(?!=)[^\n]*/s
%ignore /[ \t\r\f]+/
"""
_PAIRS = {"(": ")", "[": "]", "{": "}"}
_ENDLESS = {'"': "a quotation mark in the same line", "#": "the end of the comment, =#"}
_CONTINUES = {*"+-*/^=,"}  # a line that ends so goes on in the next
_DEEPEST = 50  # levels of brackets
_READ = "a number, a name assigned before, or a constructor of ActiveFilaments.jl"
_FOLLOWS = "the end of the statement, or an operator + - * / ^"
_BLOCKS = {
    "for", "while", "if", "function", "macro", "let", "begin", "struct", "mutable", "try", "do",
    "quote", "module", "baremodule", "end", "else", "elseif", "catch", "finally", "return",
    "abstract", "primitive", "global", "local",
}  # fmt: skip
_PASSED_OVER = {"using", "import", "export", "@"}
_OPERATIONS: Mapping[str, Callable[[float, float], Any]] = {
    "+": add, "-": sub, "*": mul, "/": truediv, "^": pow,
}  # fmt: skip
_FUNCTIONS: Mapping[str, Callable[[float], float]] = {
    **{name: getattr(math, name) for name in ("sqrt", "sin", "cos", "tan", "asin", "acos", "atan")},
    "deg2rad": math.radians,
    "rad2deg": math.degrees,
    "abs": abs,
    "Float64": float,
}
_CONSTANTS = {"pi": math.pi, "π": math.pi}


class Julia:
    """Reader of one file of Julia source.

    Args:
        source: What errors call the file.
    """

    def __init__(self, source: str) -> None:
        self.source = source
        self.known: dict[str, Any] = {}
        """Value of each name: numbers, vectors, tuples, constructors, or `Unreadable`."""
        values: Any = _Values(self)
        self._lark = Lark(
            _GRAMMAR,
            parser="lalr",
            lexer="basic",
            start=["sum", "other"],
            transformer=values,
            maybe_placeholders=False,
        )

    def read(self, text: str) -> dict[str, Any]:
        """Follow all statements of a text, and return what each name stands for at the end.

        Raises:
            InvalidInput: A bracket, a quotation mark or a comment without its end, or a statement
                that may change any name.
        """
        for statement in self._statements(text):
            self._follow(statement)
        return self.known

    def value_of(self, tokens: Sequence[Token]) -> Any:
        """Value of an expression.

        Raises:
            InvalidInput: Anything else than what this module reads.
        """
        parser = self._lark.parse_interactive(start="sum")
        try:
            for token in tokens:
                parser.feed_token(token)
            return parser.feed_eof(tokens[-1])
        except UnexpectedToken as error:
            allowed = _READ if "NUMBER" in error.expected else _FOLLOWS
            if error.token.type == "$END":
                raise self.refused(tokens[-1], f"followed by {allowed}") from None
            raise self.refused(error.token, allowed) from None

    def refused(self, token: Token, allowed: str, hint: str = "") -> InvalidInput:
        """The error that a token is not what it must be, with its line."""
        shown = token if len(token) < 40 else f"{token[:36]} ..."
        return InvalidInput(f"{self.source}, line {token.line}", repr(str(shown)), allowed, hint)

    def _statements(self, text: str) -> Iterator[list[Token]]:
        """Lines, parts of lines before ";", or lines that brackets or operators hold together."""
        statement: list[Token] = []
        brackets: list[Token] = []
        for token in self._lark.lex(text):
            self._match(token, brackets)
            if not brackets and _ends(token, statement):
                yield from [statement] if statement else []
                statement = []
            elif token.type != "NEWLINE":
                statement.append(token)
        if brackets:
            raise self.refused(brackets[-1], "followed by the bracket that closes it")
        yield from [statement] if statement else []

    def _match(self, token: Token, brackets: list[Token]) -> None:
        """Keep the brackets that are open, and refuse what has no end."""
        if token in _ENDLESS:
            raise self.refused(token, f"followed by {_ENDLESS[token]}")
        if token in _PAIRS:
            brackets.append(token)
            if len(brackets) > _DEEPEST:
                raise self.refused(token, f"within {_DEEPEST} levels of brackets")
        elif token in _PAIRS.values() and not (brackets and _PAIRS[brackets.pop()] == token):
            raise self.refused(token, "a bracket that was opened before it")

    def _follow(self, statement: list[Token]) -> None:
        """Keep what a statement assigns, or that it assigns something unreadable."""
        if statement[0] in _PASSED_OVER:
            return
        if statement[0] == "const" and len(statement) > 1:
            statement = statement[1:]
        first = statement[0]
        if first in _BLOCKS:
            hint = "keep only the definition of the filament in the file"
            raise self.refused(first, "a plain assignment", hint)
        signs = list(_assignments(statement))
        changes = any(_is_name(token) and token.endswith("!") for token in statement)
        plain = signs == [1] and statement[1] == "=" and first.type == "NAME"
        if plain and not changes and statement[2:]:
            try:
                self.known[str(first)] = self.value_of(statement[2:])
            except InvalidInput as error:
                self.known[str(first)] = Unreadable(error, _names(statement[2:]))
        elif signs or changes:
            changed = statement if changes else statement[: signs[-1]]
            error = self.refused(first, "a plain assignment such as `R2 = 0.01`")
            unreadable = Unreadable(error, _names(statement))
            self.known.update(dict.fromkeys(_names(changed), unreadable))


class _Option(NamedTuple):
    """Named argument of a call."""

    name: str
    value: Any


@v_args(inline=True)
class _Values(Transformer):
    """Values of the rules of the grammar; each is worked out as soon as it is read."""

    def __init__(self, julia: Julia) -> None:
        super().__init__()
        self._julia = julia

    def number(self, token: Token) -> float:
        return self._result(token, lambda: float(token.replace("_", "")))

    def named(self, token: Token) -> Any:
        known = _CONSTANTS | self._julia.known
        if token not in known:
            raise self._julia.refused(token, _READ)
        value = known[token]
        if isinstance(value, Unreadable):
            raise value.error
        return value

    def combined(self, left: Any, sign: Token, right: Any) -> float:
        if not isinstance(left, float) or not isinstance(right, float):
            raise self._julia.refused(sign, "between two numbers")
        return self._result(sign, lambda: _OPERATIONS[sign](left, right))

    def negated(self, sign: Token, value: Any) -> float:
        return value if value == 0 else self.combined(0.0, sign, value)

    def multiple(self, token: Token, value: Any) -> float:
        return self.combined(self.number(token), token.update(value="*"), value)

    def vector(self, *values: Any) -> list[Any]:
        return list(values)

    def tuple(self, *values: Any) -> tuple[Any, ...]:
        return values

    def option(self, name: Token, _: Token, value: Any) -> _Option:
        return _Option(str(name), value)

    def short(self, name: Token) -> _Option:
        """`f(; L)` stands for `f(; L = L)`."""
        return _Option(str(name), self.named(name))

    def called(self, name: Token, *arguments: Any) -> Any:
        options = [part for part in arguments if isinstance(part, _Option)]
        values = [part for part in arguments if not isinstance(part, _Option)]
        if name in CONSTRUCTORS:
            return constructed(f"{self._julia.source}, line {name.line}", name, values, options)
        if name not in _FUNCTIONS:
            hint = "functions of one's own are not run: write the number"
            raise self._julia.refused(name, _READ, hint)
        if len(values) != 1 or options or not isinstance(values[0], float):
            raise self._julia.refused(name, "a function of one number")
        return self._result(name, lambda: _FUNCTIONS[name](values[0]))

    def _result(self, token: Token, operation: Callable[[], Any]) -> float:
        try:
            value = operation()
        except (ArithmeticError, ValueError):
            value = math.nan
        if not isinstance(value, float) or not math.isfinite(value):
            raise self._julia.refused(token, "an operation with a finite result")
        return value


def _ends(token: Token, statement: Sequence[Token]) -> bool:
    """True if a token outside of brackets ends the statement before it."""
    if token.type == "NEWLINE":
        return not (statement and statement[-1] in _CONTINUES)
    return token == ";"


def _assignments(statement: Sequence[Token]) -> Iterator[int]:
    """Places of each `=`, `*=`, `.=`, ... that does not name an argument of a call."""
    of_calls = [False]
    for place, token in enumerate(statement):
        if token in _PAIRS:
            of_calls.append(token == "(" and statement[place - 1].type == "CALL" and place > 0)
        elif token in _PAIRS.values():
            of_calls.pop()
        elif token.type in ("EQUAL", "ASSIGN") and not of_calls[-1]:
            yield place


def _is_name(token: Token) -> bool:
    return token.type in ("NAME", "CALL", "_VECTOR")


def _names(tokens: Sequence[Token]) -> frozenset[str]:
    return frozenset(str(token) for token in tokens if _is_name(token))
