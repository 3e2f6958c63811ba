"""Numbers as people write them: a value with its error and its unit."""

from __future__ import annotations

import math

__all__ = ["quantity"]

_SMALLEST = 1e-3  # below it, numbers are written with a power of ten
_FINEST = 1e-9  # of the value: what follows is rounding


def quantity(value: float, unit: str = "", error: float = math.nan) -> str:
    """A value to the first digit of its error, such as "0.69164 ± 0.00002 m³".

    Args:
        value: The number.
        unit: What it counts.
        error: How far off it may be, same unit; without one the value has six digits.
    """
    if math.isfinite(value) and 0 < error < math.inf:
        return f"{_with_error(value, error)} {unit}".rstrip()
    return f"{value:.6g} {unit}".rstrip()


def _with_error(value: float, error: float) -> str:
    error = max(error, _FINEST * abs(value))
    largest = max(abs(value), error)
    power = math.floor(math.log10(largest)) if largest < _SMALLEST else 0
    scale = 10.0**power
    decimals = max(0, -math.floor(math.log10(error / scale)))
    text = f"{value / scale:.{decimals}f} ± {error / scale:.{decimals}f}"
    return f"({text})e{power}" if power else text
