"""Values as people read and write them: decimal numbers, degrees, units beside numbers."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter, Token

from softreach.support.errors import InvalidInput
from softreach.support.quantity import read_number, read_whole_number

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator


def _read_by(read: Callable[[str], float], allowed: str) -> Parameter:
    """Options that are read by a function from text, which raises ValueError of other text."""

    def convert(kind: Any, tokens: Sequence[Token]) -> float:
        del kind
        try:
            return read(tokens[0].value)
        except ValueError:
            name = (tokens[0].keyword or "number").lstrip("-").replace("-", "_")
            raise InvalidInput(name, tokens[0].value or "''", allowed) from None

    return Parameter(converter=convert)


Whole = Annotated[int, _read_by(read_whole_number, "a whole number such as 20000 or 2e4")]
Number = Annotated[float, _read_by(read_number, "a finite number such as 0.5 or 1e-3")]


def pairs_in(name: str, texts: Sequence[str] | None, allowed: str) -> dict[str, str] | None:
    """Names and values of NAME=VALUE; a name may hold another =.

    Raises:
        InvalidInput: Text of another form, or a name that is given twice.
    """
    if texts is None:
        return None
    pairs: dict[str, str] = {}
    for text in texts:
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
    plain = values if isinstance(values, int | float) else values.tolist()
    return plain, {"m3": "m³", "1": ""}.get(unit, unit)


def activation_text(arm: Manipulator, values: Iterable[float]) -> str:
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
    from softreach.arm.written import written_name

    plain = name.replace(" ", "_").replace("/", "_per_").replace("(", "").replace(")", "")
    suffixed = written_name(plain, _SUFFIX.get(unit, unit))
    return suffixed.translate(_PLAIN)
