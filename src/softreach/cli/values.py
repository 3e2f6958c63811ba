"""Values as people read and write them: decimal numbers, degrees, units beside numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter, Token

from softreach.support.errors import InvalidInput
from softreach.support.quantity import read_number, read_whole_number, shortened

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = [
    "NUMBER",
    "WHOLE",
    "activation_text",
    "as_read",
    "finite",
    "key",
    "position_text",
    "shown",
    "to_degrees",
]


def _whole(kind: Any, tokens: Sequence[Token]) -> int:
    """A whole number: 400000, 400_000 or 4e5."""
    del kind
    try:
        return read_whole_number(tokens[0].value)
    except ValueError:
        allowed = "a whole number such as 20000 or 2e4"
        raise InvalidInput(*_name_and_value(tokens[0]), allowed) from None


def _number(kind: Any, tokens: Sequence[Token]) -> float:
    """A finite number: 0.5, 1e-6."""
    del kind
    try:
        return read_number(tokens[0].value)
    except ValueError:
        allowed = "a finite number such as 0.5 or 1e-3"
        raise InvalidInput(*_name_and_value(tokens[0]), allowed) from None


WHOLE = Parameter(converter=_whole)
"""Of every option that is an `int`."""

NUMBER = Parameter(converter=_number)
"""Of every option that is a `float`."""


def _name_and_value(token: Token) -> tuple[str, str]:
    name = (token.keyword or "number").lstrip("-").replace("-", "_")
    return name, shortened(token.value) or "''"


def to_degrees(angles: Any) -> Any:
    """Angles [rad] in degrees, without the digits that come of the conversion."""
    import numpy as np

    return np.round(np.degrees(angles), 9).tolist()


def as_read(values: Any, unit: str) -> tuple[Any, str]:
    """An array and its unit as people read them: degrees for radians, m³ for m3."""
    if unit == "rad":
        return to_degrees(values), "deg"
    return values.tolist(), {"m3": "m³", "1": ""}.get(unit, unit)


def activation_text(arm: Manipulator, values: Iterable[float]) -> str:
    """Activations with the names and units of their bundles: "left -1, right 0.5 N"."""
    named = zip(arm.bundle_names, values, arm.bundle_units, strict=True)
    return ", ".join(
        f"{name} {round(value, 6):.6g}" if unit == "1" else f"{name} {value:.6g} {unit}"
        for name, value, unit in named
    )


def position_text(point: Iterable[float]) -> str:
    """A position: "(0.2, 0.1, 0.6) m"."""
    return f"({', '.join(f'{x:.6g}' for x in point)}) m"


def shown(value: Any) -> str:
    """A value in a table; a dash where there is none."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return "-"
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, int) and not isinstance(value, bool):
        return f"{value:,}"
    if isinstance(value, list | tuple):
        return ", ".join(shown(item) for item in value)
    return str(value)


def finite(value: Any) -> Any:
    """The value with None for every NaN and infinity in it, which JSON does not have."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {name: finite(item) for name, item in value.items()}
    return [finite(item) for item in value] if isinstance(value, list | tuple) else value


_SUFFIX = {"": "1", "%": "percent", "N m²": "n_m2"}
_PLAIN = str.maketrans({"³": "3", "²": "2", "/": "_per_", " ": "_"})


def key(name: str, unit: str) -> str:
    """The key of a value in JSON: its name with its unit, as in `convex_volume_L3`."""
    from softreach.arm.parameters.written import written_name

    plain = name.replace(" ", "_").replace("/", "_per_").replace("(", "").replace(")", "")
    suffixed = written_name(plain, _SUFFIX.get(unit, unit))
    return suffixed.translate(_PLAIN)
