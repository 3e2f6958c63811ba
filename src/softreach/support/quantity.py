"""Numbers as people write them: a value with its error and its unit."""

import math
import re
from collections.abc import Iterator, Sequence
from decimal import Decimal

_SMALLEST = 1e-3  # below it, numbers are written with a power of ten
_FINEST = 1e-9  # of the value: what follows is rounding

_DECIMAL = r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?"
_NUMBER = re.compile(rf"\s*({_DECIMAL})\s*(.*?)\s*", re.ASCII)
_WHOLE = re.compile(r"\s*[+-]?\d+(?:_\d+)*\s*", re.ASCII)
_DEGREE = str(Decimal(math.radians(1.0)))
_UNITS = {
    "kg": {"kg": "1", "g": "1e-3", "mg": "1e-6"},
    "m": {"m": "1", "cm": "1e-2", "mm": "1e-3", "um": "1e-6", "µm": "1e-6", "in": "0.0254"},
    "N": {"N": "1", "mN": "1e-3", "kN": "1e3"},
    "N m": {"N m": "1", "Nm": "1", "mN m": "1e-3", "mNm": "1e-3", "N mm": "1e-3", "Nmm": "1e-3"},
    "N m²": {"N m2": "1", "N m²": "1", "Nm2": "1", "Nm²": "1", "N mm2": "1e-6", "N mm²": "1e-6"},
    "N/m": {"N/m": "1", "mN/m": "1e-3", "N/mm": "1e3"},
    "Pa": {"Pa": "1", "kPa": "1e3", "MPa": "1e6", "GPa": "1e9", "bar": "1e5"},
    "kg/m": {"kg/m": "1", "g/m": "1e-3"},
    "kg/m³": {"kg/m3": "1", "kg/m³": "1", "g/cm3": "1e3", "g/cm³": "1e3"},
    "m/s²": {"m/s2": "1", "m/s²": "1"},
    "rad": {"deg": _DEGREE, "°": _DEGREE, "rad": "1"},
}
"""SI unit -> units that may be written in its place, with their size in it."""


def quantity(value: float, unit: str = "", error: float = math.nan, digits: int = 1) -> str:
    """A value to some digits of its error, such as "0.69164 ± 0.00002 m³", or with five digits."""
    if not (math.isfinite(value) and 0 < error < math.inf):
        return f"{five_digits(value)}{unit if unit == '°' else f' {unit}'}".rstrip()
    error = max(error, _FINEST * abs(value))
    largest = max(abs(value), error)
    power = math.floor(math.log10(largest)) if largest < _SMALLEST else 0
    scale = 10.0**power
    decimals = max(0, digits - 1 - math.floor(math.log10(error / scale)))
    text = f"{value / scale:.{decimals}f} ± {error / scale:.{decimals}f}"
    return f"{f'({text})e{power}' if power else text} {unit}".rstrip()


def five_digits(value: float) -> str:
    """A number with five digits that count, and without an exponent up to a million."""
    return f"{float(f'{value:.5g}'):.6g}"


def round_above(value: float) -> float:
    """The least of 1, 2, 5, 10, ... and of 0.5, 0.2, ... from a value on; 0 from 0."""
    power = 10.0 ** math.floor(math.log10(value)) if value else 0.0
    return next(step * power for step in (1, 2, 5, 10) if value <= step * power)


def read_number(text: str) -> float:
    """The finite decimal number that a text is, or `ValueError`."""
    return read_quantity(text, "1")


def read_whole_number(text: str) -> int:
    """The whole number that a text is, such as "400_000" or "4e5", or `ValueError`."""
    if _WHOLE.fullmatch(text):
        return int(text)
    read_number(text)  # refuses what is no finite decimal number
    if (number := Decimal(text.strip())) != number.to_integral_value():
        raise ValueError(text)
    return int(number)


def numbers_in(text: str, count: int | None = None) -> list[float] | None:
    """Comma-separated numbers; None if they are anything else, or not so many."""
    try:
        values = [read_number(part) for part in text.split(",")]
    except ValueError:
        return None
    return values if count in (None, len(values)) else None


def unit_names(unit: str) -> tuple[str, ...]:
    """The units that a quantity of this SI unit may be written in; none for a plain number."""
    return () if unit == "1" else tuple(_UNITS.get(unit, (unit,)))


def sizes_in(unit: str) -> dict[str, float]:
    """The units that may be written in place of one, such as "mm", with their sizes in it."""
    known = next((units for units in _UNITS.values() if unit in units), {unit: "1"})
    return {name: float(Decimal(size) / Decimal(known[unit])) for name, size in known.items()}


def read_quantity(text: str, unit: str) -> float:
    """The value in an SI unit, "1" for none, of "200g" or "1.5 MPa"; `ValueError` of anything else.

    The unit is one of `unit_names(unit)`; a zero needs none.
    """
    match = _NUMBER.fullmatch(text)
    if match is None:
        raise ValueError(text)
    number, symbol = match.groups()
    value = float(number)
    if symbol not in (unit_names(unit) or ("",)) and (symbol or value):
        raise ValueError(text)
    if symbol in ("deg", "°"):
        value = math.radians(value)
    elif abs(value) < math.inf:  # decimals, so that 200 g are 0.2 kg to the last bit
        value = float(Decimal(number) * Decimal(_UNITS.get(unit, {}).get(symbol, "1")))
    if not math.isfinite(value):
        raise ValueError(text)
    return value


def columns(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Cells below each other, a line for each row."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for cells in rows:
        padded = (f"{cell:<{width}}" for cell, width in zip(cells, widths, strict=True))
        yield "  ".join(padded).rstrip()
