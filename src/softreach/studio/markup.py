"""The one place where text becomes markup: nothing that is said to the reader is rendered.

Names, file names and messages may come from a file of someone else. Whoever shows text
makes it here; nobody else escapes, and nobody else writes tags around what is not a constant.
"""

from __future__ import annotations

import html
from collections.abc import Sequence
from typing import Self

_LINE = "font-size:0.85em;line-height:1.45;padding:0 0.8em 0.4em;overflow-wrap:anywhere"
_STATUS = "height:7em;overflow-y:auto"
_SMALL = "font-size:0.8em;padding:0 0.8em 0.5em;overflow-wrap:anywhere"
_KEY = "font-size:0.8em;padding:0 0.8em 0.4em"
_HELP = "cursor:help;text-decoration:underline dotted"
_ALERT = f"color:var(--alert,#c92a2a);{_SMALL};white-space:pre-line"

_BAR = (
    "display:flex;align-items:center;padding:0 7.4rem 0.4em 0.8em;font-size:0.72em;"
    "min-height:1.2em;line-height:1.2;cursor:help;font-variant-numeric:tabular-nums"
)
_TRACK = "flex:1;position:relative;height:5px;background:rgba(128,128,128,0.2)"
_IN_TRACK = "position:absolute;top:0;height:100%"
_BEFORE = "flex:none;width:102px;white-space:nowrap"
_GROWS, _SHRINKS = "#3a7fc8", "#d9731a"  # told apart by the color-blind, on white and on black

_WIDE = "overflow-x:auto;padding:0 0.8em 0.6em"
_TABLE = (
    "border-collapse:collapse;font-size:0.8em;line-height:1.35;font-variant-numeric:tabular-nums"
)
_CELL = (
    "text-align:right;vertical-align:top;padding:0.25em 0.6em;white-space:nowrap;"
    "border-bottom:1px solid rgba(128,128,128,0.3)"
)
_HEAD = "white-space:normal;vertical-align:bottom;min-width:4em"
_STICKY = "position:sticky;left:0;text-align:left;background:var(--mantine-color-body,#fff);"


class Strong(str):
    """Text in bold."""

    __slots__ = ()


class Term(str):
    """Text in bold that explains itself when pointed at."""

    __slots__ = ("meaning",)
    meaning: str

    def __new__(cls, text: str, meaning: str) -> Self:
        """Text, and its meaning."""
        term = super().__new__(cls, text)
        term.meaning = meaning
        return term


class Swatch(str):
    """A little square of a color, as CSS has it or RGB from 0 to 255."""

    __slots__ = ()

    def __new__(cls, color: str | tuple[int, int, int]) -> Self:
        """The color, as CSS has it."""
        text = color if isinstance(color, str) else "rgb({},{},{})".format(*color)
        return super().__new__(cls, text)


Part = str | Strong | Term | Swatch


def inline(*parts: Part) -> str:
    """Text, some of it bold, and swatches, as HTML."""
    return "".join(map(_part, parts))


def paragraph(*parts: Part) -> str:
    """A line of text as HTML; nothing without text."""
    return f'<div style="{_LINE}">{inline(*parts)}</div>' if parts else ""


def status(*lines: str) -> str:
    """Lines that the other functions here make, as HTML of one height: the tabs never jump."""
    return f'<div data-softreach style="{_STATUS}">{"".join(lines)}</div>'


def alert(text: str) -> str:
    """A warning in red, as HTML."""
    return f'<div role="alert" style="{_ALERT}">{inline(text)}</div>'


def bar(share: float, text: str, meaning: str, *, faded: bool = False) -> str:
    """A bar from the middle of its track under a slider, text under its label, as HTML.

    Args:
        share: Its length over that of half of the track, to the right for positive ones.
        text: Before it.
        meaning: What it says when pointed at.
        faded: Whether it is pale.
    """
    side, color = ("left", _GROWS) if share > 0 else ("right", _SHRINKS)
    length = f"{side}:50%;width:{50 * min(abs(share), 1.0):.2f}%;background:{color}"
    meaning, looks = html.escape(meaning), f"{_BAR};opacity:{0.4 if faded else 1}"
    return (
        f'<div role="img" title="{meaning}" aria-label="{inline(text)}: {meaning}" style="{looks}">'
        f'<div style="{_BEFORE}">{inline(text)}</div>'
        f'<div style="{_TRACK}"><div style="{_IN_TRACK};{length}"></div>'
        f'<div style="{_IN_TRACK};left:50%;width:1px;background:currentColor"></div></div></div>'
    )


def scale(colors: Sequence[str], *texts: str) -> str:
    """A scale of colors, as CSS has them, over texts from its left to its right end, as HTML."""
    cells = "".join(f"<span>{inline(text)}</span>" for text in texts)
    shown = f"background:linear-gradient(90deg,{','.join(colors)});height:0.6em;margin:0.2em 0"
    below = f'<div style="display:flex;justify-content:space-between">{cells}</div>'
    return f'<div style="{_KEY}"><div style="{shown}"></div>{below}</div>'


def swatches(title: str, entries: Sequence[tuple[str, str]]) -> str:
    """A title, and labels behind the colors that they explain, as HTML."""
    parts = [f"{title} \N{EN SPACE} "] if title else []
    for label, color in entries:
        parts += [Swatch(color), f" {label} \N{EN SPACE} "]
    return f'<div style="{_KEY}">{inline(*parts)}</div>'


def table(head: Sequence[str], rows: Sequence[Sequence[Sequence[Part]]]) -> str:
    """A table as HTML, as wide as it needs to be; the first column stays in sight.

    Args:
        head: Titles of the columns.
        rows: For every cell its lines.
    """
    titles = "".join(
        f"<th style='{_CELL};{_HEAD};{_STICKY * (k == 0)}'>{inline(text)}</th>"
        for k, text in enumerate(head)
    )
    body = "".join(f"<tr>{_row(row)}</tr>" for row in rows)
    inner = f"<thead><tr>{titles}</tr></thead><tbody>{body}</tbody>"
    return f'<div style="{_WIDE}"><table style="{_TABLE}">{inner}</table></div>'


def _row(cells: Sequence[Sequence[Part]]) -> str:
    return "".join(
        f"<td style='{_CELL};{_STICKY * (k == 0)}'>{'<br>'.join(map(_part, lines))}</td>"
        for k, lines in enumerate(cells)
    )


def _part(part: Part) -> str:
    if isinstance(part, Swatch):
        return f'<span style="color:{html.escape(part)}">\N{BLACK SQUARE}</span>'
    text = html.escape(part)
    if isinstance(part, Term):
        return f'<b style="{_HELP}" title="{html.escape(part.meaning)}">{text}</b>'
    return f"<b>{text}</b>" if isinstance(part, Strong) else text
