"""Search for the end of what exists along a number, in values of three digits."""

from __future__ import annotations

import math
from collections.abc import Callable

_HALVINGS = 14


def last_value(
    start: float, limit: float, near: float | None, exists: Callable[[float], bool]
) -> float:
    """The last value from a start toward a limit that exists, of three digits but for the start.

    It is looked for near another one first, where that is known.
    """
    inside, outside = start, limit
    if near is not None and min(start, limit) < near < max(start, limit):
        inside, outside = _around(near, start, limit, exists)
    if outside == limit and exists(limit):
        return limit
    for _ in range(_HALVINGS):
        middle = (inside + outside) / 2
        middle = round(middle, _decimals(middle))
        if not min(inside, outside) < middle < max(inside, outside):
            break
        inside, outside = (middle, outside) if exists(middle) else (inside, middle)
    return inside


def _around(
    near: float, start: float, limit: float, exists: Callable[[float], bool]
) -> tuple[float, float]:
    """A value that exists and one toward the limit that does not, ever farther from `near`.

    The first may be the start, and the second the limit, of which it is not known.
    """
    here, digits = exists(near), _decimals(near)
    last, end = near, limit if here else start
    step = math.copysign(10.0**-digits, end - near)
    while abs(step) < abs(end - last):
        tried = round(last + step, digits)
        if exists(tried) != here:
            end = tried
            break
        last, step = tried, 2 * step
    return (last, end) if here else (end, last)


def _decimals(value: float) -> int:
    """Digits after the point that a value of three digits has."""
    return max(0, 2 - math.floor(math.log10(abs(value)))) if value else 0
