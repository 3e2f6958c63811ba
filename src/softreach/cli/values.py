"""Values as people read and write them: decimal numbers, degrees, units beside numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from enum import Enum
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter, Token

from softreach.support.errors import InvalidInput, Range
from softreach.support.quantity import five_digits, quantity, read_number, read_whole_number
from softreach.support.units import POWERS, LengthUnit

if TYPE_CHECKING:
    import xarray as xr

Rows = dict[str, tuple[Any, str]]
"""Name -> (value, unit)."""

ERROR = " error"
"""Behind the name of a row with the error of another."""
_READ_AS = {"m2": "m²", "m3": "m³", "1": ""}
_PLAIN = str.maketrans({"³": "3", "²": "2", "/": "_per_", " ": "_", "(": "", ")": ""})


def read_as(
    name: str, text: Any, read: Callable[[Any], Any], allowed: str, limits: Range | None = None
) -> Any:
    """What a reader makes of a text; refused where it raises ValueError or leaves the limits."""
    try:
        value = read(text)
        if limits is None or limits.admits(value):
            return value
    except ValueError:
        pass
    raise InvalidInput(name, text or "''", allowed)


def _read_by(read: Callable[[str], float], allowed: str) -> Parameter:
    def convert(kind: Any, tokens: Sequence[Token]) -> float:
        del kind
        name = (tokens[0].keyword or "number").lstrip("-").replace("-", "_")
        return read_as(name, tokens[0].value, read, allowed)

    return Parameter(converter=convert)


Whole = Annotated[int, _read_by(read_whole_number, "a whole number such as 20000 or 2e4")]
Number = Annotated[float, _read_by(read_number, "a finite number such as 0.5 or 1e-3")]


def pairs_in(name: str, texts: Sequence[str] | None, allowed: str) -> dict[str, str]:
    """Names and values of NAME=VALUE, each name once; a name may hold another =."""
    pairs: dict[str, str] = {}
    for text in texts or ():
        key, sign, value = (part.strip() for part in text.rpartition("="))
        if not sign or not key or not value:
            raise InvalidInput(name, text, allowed)
        if key in pairs:
            raise InvalidInput(name, text, f"given once for {key}")
        pairs[key] = value
    return pairs


def to_degrees(angles: Any) -> Any:
    """Angles [rad] in degrees, without the digits that come of the conversion."""
    import numpy as np

    return np.round(np.degrees(angles), 9).tolist()


def as_read(values: Any, unit: str) -> tuple[Any, str]:
    """Numbers and their unit as people read them: degrees for radians, m³ for m3."""
    if unit == "rad":
        return to_degrees(values), "deg"
    return plain(values), _READ_AS.get(unit, unit)


def rows_of(dataset: xr.Dataset) -> Rows:
    """The numbers of a result, by the names and units that its dataset has."""
    rows: Rows = {}
    for name, column in dataset.variables.items():
        if column.dtype.kind in "fi":
            unit = str(column.attrs.get("units", "1"))
            rows[str(name).replace("_", " ")] = as_read(column.values, unit)
    return rows | ({"route": (dataset.attrs["route"], "")} if "route" in dataset.attrs else {})


def fields_of(values: Mapping[str, Any], *lengths: str) -> Rows:
    """The fields of a result as rows; those that are lengths [m] by name."""
    return {name: (value, "m" if name in lengths else "") for name, value in values.items()}


def for_people(rows: Rows, unit: LengthUnit) -> Iterable[tuple[str, str]]:
    """The rows as text: lengths, areas and volumes in the unit, and errors beside their values."""
    for name, (value, symbol) in rows.items():
        if name.endswith(ERROR) and name.removesuffix(ERROR) in rows:
            continue  # it stands beside the value
        size, power = 1.0, POWERS.get(symbol)
        if power is not None:
            size, symbol = unit.scale(power), unit.symbol(power)
        text = _shown_in(value, rows.get(f"{name}{ERROR}", (None, ""))[0], size)
        yield name, f"{text} {'' if text == '-' else symbol}".rstrip()


def _shown_in(value: Any, error: Any, size: float) -> str:
    """Numbers in a unit of this size, each to the first digit of its error if that is known."""
    if isinstance(value, list):
        errors = error if isinstance(error, list) else [error] * len(value)
        return ", ".join(_shown_in(*pair, size) for pair in zip(value, errors, strict=True))
    if value is None or error is None:
        return shown(value if value is None or size == 1.0 else value / size)
    return quantity(value / size, "", error / size)


def for_machines(rows: Rows, length: float | None = None) -> dict[str, Any]:
    """The rows by names with their units; lengths, areas and volumes in SI units and in L."""
    from softreach.arm.written import written_name

    fields: dict[str, Any] = {}
    for name, (value, unit) in rows.items():
        values = {unit: value}
        if length is not None and (power := POWERS.get(unit)):
            import numpy as np

            relative = LengthUnit("L", length)
            values[relative.symbol(power)] = np.asarray(plain(value), float) / relative.scale(power)
        for own, number in values.items():
            key = written_name(name.translate(_PLAIN), own or "1").translate(_PLAIN)
            fields[key] = plain(number)
    return fields


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


def plain(value: Any) -> Any:
    """Arrays as lists, members of an enumeration by name, and None for what JSON does not have."""
    if isinstance(value, Enum):
        return value.name.lower()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    return plain(value.tolist()) if hasattr(value, "tolist") else value
