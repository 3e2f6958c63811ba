"""Named values of a result as people read them: a line each, errors beside their values."""

import math
from collections.abc import Iterator
from typing import Any

from softreach.support.quantity import columns, five_digits, quantity
from softreach.support.units import POWERS, LengthUnit

Rows = dict[str, tuple[Any, str]]  # name -> (value, SI unit)
ERROR = " error"  # behind the name of a row with the error of another


def lines_of(rows: Rows, unit: LengthUnit) -> Iterator[str]:
    """The rows as a table: lengths, areas and volumes in the unit, and errors beside values."""
    cells = list[tuple[str, str]]()
    for name, (value, symbol) in rows.items():
        if name.endswith(ERROR) and name.removesuffix(ERROR) in rows:
            continue  # it stands beside the value
        size, power = 1.0, POWERS.get(symbol)
        if power is not None:
            size, symbol = unit.scale(power), unit.symbol(power)
        text = _shown_in(value, rows.get(f"{name}{ERROR}", (None, ""))[0], size)
        cells.append((name, f"{text} {'' if text == '-' else symbol}".rstrip()))
    return columns(cells)


def _shown_in(value: Any, error: Any, size: float) -> str:
    """Numbers in a unit of this size, each to the first digit of its error if that is known."""
    if isinstance(value, list):
        errors = error if isinstance(error, list) else [error] * len(value)
        return ", ".join(_shown_in(*pair, size) for pair in zip(value, errors, strict=True))
    if value is None or error is None:
        return shown(value if value is None or size == 1.0 else value / size)
    return quantity(value / size, "", error / size)


def shown(value: Any) -> str:
    """A value in a table, with five digits that count; a dash where there is none."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "-"
    if isinstance(value, float):
        return five_digits(value)
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    if isinstance(value, list | tuple):
        return ", ".join(shown(item) for item in value)
    return str(value)


def to_degrees(angles: Any) -> Any:
    """Angles [rad] in degrees, without the digits that come of the conversion."""
    import numpy as np

    return np.round(np.degrees(angles), 9).tolist()
