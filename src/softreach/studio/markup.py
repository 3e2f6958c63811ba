"""The one place where text becomes markup: nothing that is said to the reader is rendered.

Names, file names and messages may come from a file of someone else. Whoever shows text
makes it here; nobody else escapes, and nobody else writes tags around what is not a constant.
"""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence
from typing import Self


class Bad(str):
    """Text in red."""


class Term(str):
    """Text in bold that explains itself when pointed at."""

    meaning: str

    def __new__(cls, text: str, meaning: str) -> Self:
        term = super().__new__(cls, text)
        term.meaning = meaning
        return term


class Swatch(str):
    """A little square of a color, as CSS has it or RGB from 0 to 255."""

    def __new__(cls, color: str | tuple[int, int, int]) -> Self:
        text = color if isinstance(color, str) else "rgb({},{},{})".format(*color)
        return super().__new__(cls, text)


Part = str | Bad | Term | Swatch


def inline(*parts: Part) -> str:
    """Text, some of it bold, and swatches, as HTML."""
    return "".join(map(_part, parts))


def paragraph(*parts: Part) -> str:
    """A line of text as HTML; nothing without text."""
    return f'<div class="sr-line">{inline(*parts)}</div>' if parts else ""


def status(*lines: str) -> str:
    """Lines that the other functions here make, as HTML of one height: the tabs never jump."""
    return f'<div data-softreach class="sr-status">{"".join(lines)}</div>'


def alert(text: str) -> str:
    """A warning in red, as HTML."""
    return f'<div role="alert" class="sr-alert">{inline(text)}</div>'


def bar(share: float, text: str, meaning: str, *, faded: bool = False) -> str:
    """A bar as HTML, as long as its share of half of the track, to the right if positive."""
    side, meaning = ("left" if share > 0 else "right"), html.escape(meaning)
    return (
        f'<div role="img" class="sr-bar" title="{meaning}" aria-label="{inline(text)}: {meaning}" '
        f'style="opacity:{0.4 if faded else 1}"><div>{inline(text)}</div><div>'
        f'<i class="{side}" style="{side}:50%;width:{50 * min(abs(share), 1.0):.2f}%"></i>'
        '<i class="middle"></i></div></div>'
    )


def scale(colors: Sequence[str], *texts: str) -> str:
    """A scale of colors, as CSS has them, over texts from its left to its right end, as HTML."""
    cells = "".join(f"<span>{inline(text)}</span>" for text in texts)
    shown = f"background:linear-gradient(90deg,{','.join(colors)})"
    return f'<div class="sr-key"><div style="{shown}"></div><div>{cells}</div></div>'


def swatches(title: str, entries: Sequence[tuple[str, str]]) -> str:
    """A title, and labels behind the colors that they explain, as HTML."""
    parts = [f"{title} \N{EN SPACE} "] if title else []
    for label, color in entries:
        parts += [Swatch(color), f" {label} \N{EN SPACE} "]
    return paragraph(*parts)


def table(head: Sequence[str], rows: Iterable[Sequence[Part]]) -> str:
    """A table as HTML, as wide as it needs to be; the first column stays in sight."""
    titles = "".join(f"<th>{inline(text)}</th>" for text in head)
    lines = ("".join(f"<td>{inline(cell)}</td>" for cell in row) for row in rows)
    body = "".join(f"<tr>{cells}</tr>" for cells in lines)
    inner = f"<thead><tr>{titles}</tr></thead><tbody>{body}</tbody>"
    return f'<div class="sr-table"><table>{inner}</table></div>'


def _part(part: Part) -> str:
    if isinstance(part, Swatch):
        return f'<span style="color:{html.escape(part)}">\N{BLACK SQUARE}</span>'
    text = html.escape(part)
    if isinstance(part, Term):
        return f'<b class="sr-term" title="{html.escape(part.meaning)}">{text}</b>'
    if isinstance(part, Bad):
        return f'<b class="sr-bad">{text}</b>'
    return text
