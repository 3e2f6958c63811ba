"""The one place where text becomes markup: nothing that is said to the reader is rendered.

Names, file names and messages may come from a link or a file of someone else. Whoever shows text
makes it here; nobody else escapes, and nobody else writes tags around what is not a constant.
"""

from __future__ import annotations

import html
from typing import Self

__all__ = ["Part", "Strong", "Swatch", "Term", "alert", "inline", "link", "paragraph", "spread"]

_LINE = "font-size:0.85em;line-height:1.45;padding:0 0.8em 0.4em;overflow-wrap:anywhere"
_SMALL = "font-size:0.8em;padding:0 0.8em 0.5em;overflow-wrap:anywhere"
_HELP = "cursor:help;text-decoration:underline dotted"
_ALERT = f"color:#c92a2a;{_SMALL};white-space:pre-line"


class Strong(str):
    """Text in bold."""

    __slots__ = ()


class Term(str):
    """Text in bold that explains itself when pointed at."""

    __slots__ = ("meaning",)
    meaning: str

    def __new__(cls, text: str, meaning: str) -> Self:
        """Text, and what it means."""
        made = super().__new__(cls, text)
        made.meaning = meaning
        return made


class Swatch(tuple[int, int, int]):
    """A little square of a color, RGB from 0 to 255."""

    __slots__ = ()


Part = str | Strong | Term | Swatch


def inline(*parts: Part) -> str:
    """Text, some of it bold, and swatches, as HTML."""
    return "".join(map(_part, parts))


def paragraph(*parts: Part) -> str:
    """A line of text as HTML; nothing without text."""
    return f'<div style="{_LINE}">{inline(*parts)}</div>' if parts else ""


def alert(text: str) -> str:
    """What is wrong, in red, as HTML."""
    return f'<div role="alert" style="{_ALERT}">{inline(text)}</div>'


def link(address: str, text: str, rest: str) -> str:
    """A link that opens a new tab, and text after it, as HTML."""
    target = f'<a href="{inline(address)}" target="_blank" rel="noopener">{inline(text)}</a>'
    return f'<div style="{_SMALL}">{target}{inline(rest)}</div>'


def spread(*texts: str) -> str:
    """Texts from left to right over the whole width, as HTML."""
    cells = "".join(f"<span>{inline(text)}</span>" for text in texts)
    return f'<div style="display:flex;justify-content:space-between">{cells}</div>'


def _part(part: Part) -> str:
    if isinstance(part, Swatch):
        red, green, blue = (int(value) for value in part)
        return f'<span style="color:rgb({red},{green},{blue})">\N{BLACK SQUARE}</span>'
    text = html.escape(part)
    if isinstance(part, Term):
        return f'<b style="{_HELP}" title="{html.escape(part.meaning)}">{text}</b>'
    return f"<b>{text}</b>" if isinstance(part, Strong) else text
