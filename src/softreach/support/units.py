"""Units of length that a user chooses, and named values of a result as lines in them."""

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

from softreach.support.arguments import as_given
from softreach.support.errors import InvalidInput
from softreach.support.quantity import columns, five_digits, quantity, read_quantity, unit_names

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from softreach.support.arrays import Array

Rows = dict[str, tuple[Any, str]]  # name -> (value, SI unit)
ERROR = " error"  # behind the name of a row with the error of another
UNITS = ("m", "cm", "mm", "in", "L")  # Names of the units; L is the length of an arm
TYPED = ", ".join(unit_names("m"))  # Units to type lengths in, beside L where the arm is known
POWERS = {"m": 1, "m2": 2, "m²": 2, "m3": 3, "m³": 3}  # SI unit -> power of the length

_SIZES = {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "in": 0.0254}
_VOLUMES = {"m": ("m³", 1.0), "cm": ("liters", 1e-3), "mm": ("mL", 1e-6), "in": ("in³", 0.0254**3)}
"""Unit of length -> that of volumes beside it, and its size [m³]. L alone is never a liter here."""
_PRESSURES = {"GPa": 1e9, "MPa": 1e6, "kPa": 1e3, "Pa": 1.0}


class LengthUnit(NamedTuple):
    """A unit of length with those of areas and volumes beside it."""

    name: str  # One of `UNITS`
    size: float  # [m]; of L, the length of the arm

    @property
    def relative(self) -> bool:
        """True if it is L, the length of the arm."""
        return self.name == "L"

    def of(self, values: "ArrayLike", power: int = 1) -> "Array":
        """Lengths [m] in this unit; areas [m²] for power 2, volumes [m³] for 3."""
        import numpy as np  # the command line reads units before it needs arrays

        plain, scale = np.asarray(values, float), self.scale(power)
        return plain if scale == 1.0 else plain / scale

    def symbol(self, power: int = 1) -> str:
        """Behind a number: "mm", "mm²", "mL"."""
        if power == 3 and not self.relative:
            return _VOLUMES[self.name][0]
        return self.name + ("", "²", "³")[power - 1]

    def label(self, name: str, power: int = 1) -> str:
        """Of an axis with lengths, areas or volumes, such as "x / L", "x [mm]" or "V [mL]"."""
        symbol = self.symbol(power)
        return f"{name} / {symbol}" if self.relative else f"{name} [{symbol}]"

    def text(self, value: float, power: int = 1, error: float = math.nan) -> str:
        """A value in SI units to the first digit of its error, such as "312.4 ± 0.2 mL"."""
        scale = self.scale(power)
        return quantity(value / scale, self.symbol(power), error / scale)

    def rounded(self, value: float, power: int = 1, digits: str = ".4g") -> str:
        """A value in SI units with so many digits, such as "12.5 mm"."""
        return f"{value / self.scale(power):{digits}} {self.symbol(power)}"

    def place(self, point: Iterable[float]) -> str:
        """A position [m] in words: "(200, 100, 600) mm"."""
        return f"({', '.join(f'{five_digits(x / self.size)}' for x in point)}) {self.name}"

    def scale(self, power: int = 1) -> float:
        """Size of the unit of lengths [m], of areas [m²] for power 2, of volumes [m³] for 3."""
        if power == 3 and not self.relative:
            return _VOLUMES[self.name][1]
        return self.size**power


METER = LengthUnit("m", 1.0)


def as_unit(unit: object, length: float | None = None) -> LengthUnit:
    """The unit of that name, of which L is one where the length [m] of the arm is known."""
    if isinstance(unit, LengthUnit):
        return unit
    name = unit if isinstance(unit, str) else ""
    if name == "L" and length is not None:
        return LengthUnit(name, length)
    if name in _SIZES:
        return LengthUnit(name, _SIZES[name])
    known = UNITS if length is not None else tuple(_SIZES)
    hint = "the length L of the arm is not known here" if name == "L" else ""
    raise InvalidInput("unit", as_given(unit), f"one of {', '.join(known)}", hint)


def handy_unit(length: float) -> str:
    """The unit for an arm of that length [m]: mm below a meter, m from there."""
    return "mm" if length < 1.0 else "m"


def readable_unit(unit: str, value: float, length: LengthUnit) -> tuple[str, float]:
    """The unit that people read a number of an SI unit in, and its size.

    Lengths, areas and volumes are in that of length, pressures in one of the size of the number.
    """
    if power := POWERS.get(unit):
        return length.symbol(power), length.scale(power)
    if unit == "rad":
        return "°", math.pi / 180.0
    if unit == "Pa":
        return next((pair for pair in _PRESSURES.items() if abs(value) >= pair[1]), ("Pa", 1.0))
    return ("" if unit == "1" else unit), 1.0


def readable(
    value: float, unit: str, length: LengthUnit, error: float = math.nan, *, digits: int = 1
) -> str:
    """A number in an SI unit as people read it, to some digits of its error: "12.5 mm", "20.3°"."""
    name, size = readable_unit(unit, value, length)
    return quantity(value / size, name, error / size, digits)


def read_length(text: str, length: float | None = None) -> float:
    """A length [m] typed as "80mm", "0.08" in m, or "0.1L" where L is known; or `ValueError`."""
    text = text.strip()
    if length is not None and text.endswith("L"):
        return length * read_quantity(text[:-1], "1")
    return read_quantity(text, "m") if text[-1:].isalpha() else read_quantity(text, "1")


def lengths_in(text: str, count: int, length: float | None = None) -> list[float] | None:
    """Comma-separated lengths [m], each as `read_length` takes it, all with a unit or all without.

    A zero needs none. None if the text is anything else, or not so many.
    """
    parts = text.split(",")
    try:
        values = [read_length(part, length) for part in parts]
    except ValueError:
        return None
    named = {part.strip()[-1:].isalpha() for part, x in zip(parts, values, strict=True) if x}
    return values if len(parts) == count and len(named) < 2 else None


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
