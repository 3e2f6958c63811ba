"""Values as people read and write them: decimal numbers, degrees, units beside numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from enum import Enum
from itertools import repeat
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter, Token

import softreach as sr
from softreach.support.errors import InvalidInput
from softreach.support.quantity import quantity, read_number, read_whole_number
from softreach.support.units import LengthUnit

if TYPE_CHECKING:
    import xarray as xr

Rows = dict[str, tuple[Any, str]]
"""Name -> (value, unit)."""

ERROR = " error"
"""Behind the name of a row with the error of another."""
_POWERS = {"m": 1, "m²": 2, "m³": 3}
_READ_AS = {"m2": "m²", "m3": "m³", "1": ""}


def read_as(name: str, text: Any, read: Callable[[Any], Any], allowed: str) -> Any:
    """What a reader makes of a text; where it raises ValueError, the option is refused."""
    try:
        return read(text)
    except ValueError:
        raise InvalidInput(name, text or "''", allowed) from None


def read_positive(name: str, text: str, read: Callable[[str], float], allowed: str) -> float:
    """As `read_as`, of numbers above 0."""
    if (value := read_as(name, text, read, allowed)) > 0:
        return value
    raise InvalidInput(name, text, allowed)


def _read_by(read: Callable[[str], float], allowed: str) -> Parameter:
    """Options that are read by a function from text."""

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


def rows_for_people(rows: Rows, unit: LengthUnit) -> dict[str, str]:
    """The rows as text: lengths, areas and volumes in the unit, and errors beside their values."""
    texts: dict[str, str] = {}
    for name, (value, symbol) in rows.items():
        if name.endswith(ERROR) and _are_alike(value, rows.get(name.removesuffix(ERROR))):
            continue  # it stands beside the value
        size, power = 1.0, _POWERS.get(symbol)
        if power is not None:
            size, symbol = unit.scale(power), unit.symbol(power)
        error = rows.get(f"{name}{ERROR}")
        if error is not None and _are_alike(value, error):
            text = _with_errors(value, error[0], size)
        else:
            text = shown(value if size == 1.0 else _over(value, size))
        texts[name] = f"{text} {'' if text == '-' else symbol}".rstrip()
    return texts


def _are_alike(value: Any, row: tuple[Any, str] | None) -> bool:
    """True if a row has one number for each of a value, such as an error."""
    return row is not None and isinstance(value, list) == isinstance(row[0], list)


def _with_errors(value: Any, error: Any, size: float) -> str:
    if isinstance(value, list):
        return ", ".join(map(_with_errors, value, error, repeat(size)))
    return shown(None) if value is None else quantity(value / size, "", error / size)


def rows_for_machines(rows: Rows, length: float | None) -> Iterator[tuple[str, Any, str]]:
    """Name, value and unit of every row; lengths, areas and volumes in SI units and in L."""
    for name, (value, unit) in rows.items():
        yield name, value, unit
        if length is not None and (power := _POWERS.get(unit)):
            relative = LengthUnit("L", length)
            yield name, _over(value, relative.scale(power)), relative.symbol(power)


def record(values: Mapping[str, Any], length: float, *names: str) -> dict[str, Any]:
    """The fields of a result for machines; those that are lengths [m] by name, in m and in L."""
    fields: dict[str, Any] = {}
    for name, value in plain(values).items():
        if name in names:
            fields |= {f"{name}_m": value, f"{name}_L": _over(value, length)}
        else:
            fields[name] = value
    return fields


def _over(value: Any, scale: float) -> Any:
    if isinstance(value, list | tuple):
        return [_over(item, scale) for item in value]
    return None if value is None else value / scale


def activation_text(arm: sr.Manipulator, values: Iterable[float]) -> str:
    """Activations with the names and units of their bundles: "left -1, right 0.5 N"."""
    named = zip(arm.input_names, values, arm.input_units, strict=True)
    return ", ".join(
        f"{name} {round(value, 6) + 0.0:.6g}" if unit == "1" else f"{name} {value:.6g} {unit}"
        for name, value, unit in named
    )


def shown(value: Any) -> str:
    """A value in a table; a dash where there is none."""
    if value is None or (isinstance(value, float) and not math.isfinite(value)):
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
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


_SUFFIX = {"": "1", "%": "percent", "N m²": "n_m2"}
_PLAIN = str.maketrans({"³": "3", "²": "2", "/": "_per_", " ": "_"})


def key(name: str, unit: str) -> str:
    """The key of a value in JSON: its name with its unit, as in `convex_volume_L3`."""
    from softreach.arm.parameters import written_name

    bare = name.replace(" ", "_").replace("/", "_per_").replace("(", "").replace(")", "")
    return written_name(bare, _SUFFIX.get(unit, unit)).translate(_PLAIN)
