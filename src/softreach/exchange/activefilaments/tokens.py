"""Julia source cut into tokens, and these into statements."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from softreach.support.errors import InvalidInput

__all__ = ["Token", "refused", "statements"]

_PATTERN = re.compile(
    r"""
    (?P<space>[ \t\r\f]+)
  | (?P<comment>\#=.*?=\#|\#(?!=)[^\n]*)
  | (?P<newline>\n)
  | (?P<text>\"\"\".*?\"\"\"|"(?:\\.|[^"\\\n])*")
  | (?P<number>(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
  | (?P<name>[^\W\d]\w*(?:!(?!=))?)
  | (?P<sign>[=<>!]=|[=-]>|[-+*/^]=|\.[-+*/^]?=|.)
    """,
    re.VERBOSE | re.DOTALL,
)
_PAIRS = {"(": ")", "[": "]", "{": "}"}
_ENDLESS = {'"': "a quotation mark in the same line", "#": "the end of the comment, =#"}
_CONTINUES = {"+", "-", "*", "/", "^", "=", ","}  # a line that ends so goes on in the next


class Token(NamedTuple):
    """A piece of source."""

    kind: str
    """name, number, text, sign or newline."""
    text: str
    line: int
    """From 1 on."""
    touches: bool
    """Whether it follows the token before it without a space."""


def statements(source: str, text: str) -> Iterator[list[Token]]:
    """The tokens of each statement.

    One is a line, the part of a line before ";", or several lines that brackets or operators hold
    together.

    Args:
        source: What errors call the text.
        text: Julia source.

    Raises:
        InvalidInput: A bracket, a quotation mark or a comment without its end.
    """
    held: list[Token] = []
    brackets: list[Token] = []
    for token in _tokens(source, text):
        _match_brackets(source, token, brackets)
        if brackets or not _ends(token, held):
            held += [token] if token.kind != "newline" else []
        else:
            yield from [held] if held else []
            held = []
    if brackets:
        raise refused(source, brackets[-1], "followed by the bracket that closes it")
    yield from [held] if held else []


def refused(source: str, token: Token, allowed: str, hint: str = "") -> InvalidInput:
    """The error that a token is not what it must be, with its line."""
    shown = token.text if len(token.text) < 40 else f"{token.text[:36]} ..."
    return InvalidInput(f"{source}, line {token.line}", repr(shown), allowed, hint)


def _match_brackets(source: str, token: Token, brackets: list[Token]) -> None:
    """Keep the brackets that are open."""
    if token.kind != "sign":
        return
    if token.text in _PAIRS:
        brackets.append(token)
    elif token.text in _PAIRS.values() and _PAIRS.get(_last(brackets)) != token.text:
        raise refused(source, token, "a bracket that was opened before it")


def _last(brackets: list[Token]) -> str:
    """The bracket opened last, which is closed now."""
    return brackets.pop().text if brackets else ""


def _ends(token: Token, held: list[Token]) -> bool:
    """Whether a token outside of brackets ends the statement before it."""
    if token.kind == "newline":
        return not (held and held[-1].text in _CONTINUES)
    return token.kind == "sign" and token.text == ";"


def _tokens(source: str, text: str) -> Iterator[Token]:
    place, line, touches = 0, 1, False
    while place < len(text):
        match = _PATTERN.match(text, place)
        assert match is not None  # the last alternative takes any character
        kind = match.lastgroup or ""
        if kind in ("space", "comment"):
            touches = False
        else:
            token = Token(kind, match[0], line, touches)
            if token.text in _ENDLESS:
                raise refused(source, token, f"followed by {_ENDLESS[token.text]}")
            yield token
            touches = kind != "newline"
        place, line = match.end(), line + match[0].count("\n")
