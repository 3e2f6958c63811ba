"""Positions from a table in text: the columns x, y, z of a CSV file."""

from __future__ import annotations

from softreach.errors import InvalidInput

__all__ = ["position_in", "positions_in"]


def positions_in(text: str, source: str) -> list[list[float]]:
    """Positions [m] from lines x,y,z; a header is skipped, and so are columns after the third.

    Args:
        text: Content of the file.
        source: What errors call it.

    Raises:
        InvalidInput: A line that does not begin with three numbers.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    rows = lines[1:] if lines and _numbers(lines[0]) is None else lines
    return [position_in(f"{source}, point {k + 1}", row) for k, row in enumerate(rows)]


def position_in(name: str, text: str) -> list[float]:
    """One position [m] from x,y,z.

    Raises:
        InvalidInput: The text, called `name`, does not begin with three numbers.
    """
    values = _numbers(text)
    if values is None:
        raise InvalidInput(name, text, "three comma-separated numbers x,y,z in m")
    return values


def _numbers(text: str) -> list[float] | None:
    try:
        values = [float(part) for part in text.split(",")[:3]]
    except ValueError:
        return None
    return values if len(values) == 3 else None
