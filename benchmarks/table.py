"""Tables of the page of benchmarks: each number is declared beside its head."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

__all__ = ["print_table"]

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
