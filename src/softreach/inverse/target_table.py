"""Positions from a table in text: the columns x, y, z of a CSV file."""

from __future__ import annotations

from softreach.errors import InvalidInput
from softreach.quantity import numbers_in, shortened

__all__ = ["FARTHEST", "position_in", "positions_in"]

FARTHEST = 1e100
"""How far a target may lie [m]: squares of larger distances leave the range of numbers."""


def positions_in(text: str, source: str) -> list[list[float]]:
    """Positions [m] from lines x,y,z; a header is skipped.

    Args:
        text: Content of the file.
        source: What errors call it.

    Raises:
        InvalidInput: A line that is not three numbers, or no line.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    rows = lines[1:] if lines and _is_header(lines[0]) else lines
    if not rows:
        raise InvalidInput("targets", source, "a CSV file with a row x,y,z for each position")
    return [position_in(f"{source}, point {k + 1}", row) for k, row in enumerate(rows)]


def position_in(name: str, text: str) -> list[float]:
    """One position [m] from x,y,z.

    Raises:
        InvalidInput: The text, called `name`, is not three numbers.
    """
    values = numbers_in(text, 3)
    if values is None or max(map(abs, values)) > FARTHEST:
        allowed = f"three comma-separated numbers x,y,z in m, up to {FARTHEST:g}"
        raise InvalidInput(name, shortened(text) or "''", allowed)
    return values


def _is_header(line: str) -> bool:
    """Whether a line holds names: no part of it begins as a number does."""
    return not any(part.strip().startswith(tuple("+-.0123456789")) for part in line.split(","))
