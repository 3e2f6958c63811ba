"""Tables of benchmarks, and where they are written."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

__all__ = ["FOR_DEVELOPERS", "VALIDATION", "print_table", "put_between_marks"]

FOR_DEVELOPERS = "\n<!-- for developers -->\n"
"""What a benchmark prints after this is not written into the documentation."""

VALIDATION = Path(__file__).parent.parent / "docs" / "validation.md"

Row = Mapping[str, object]


def print_table(rows: Iterable[Row], words: Iterable[str] = ()) -> None:
    """Print rows as soon as they are known, head -> cell; columns of words are on the left."""
    heads: tuple[str, ...] = ()
    for row in rows:
        if not heads:
            heads, words = tuple(row), set(words)
            print(f"| {' | '.join(heads)} |")
            print(f"|{'|'.join('---' if head in words else '--:' for head in heads)}|")
        assert tuple(row) == heads, (tuple(row), heads)
        print(f"| {' | '.join(str(cell) for cell in row.values())} |", flush=True)


def put_between_marks(page: Path, name: str, text: str) -> None:
    """Renew what a page holds between the comments `name` and `end of name`."""
    begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
    head, rest = page.read_text(encoding="utf-8").split(begin)
    tail = rest.split(end)[1]
    page.write_text(f"{head}{begin}\n{text.strip()}\n\n{end}{tail}", encoding="utf-8")
