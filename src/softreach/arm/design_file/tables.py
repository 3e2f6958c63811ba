"""Reader of single tables of design files: the parts that they describe, and all their faults."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

from softreach.arm.actuators import Actuator
from softreach.arm.actuators.actuator import bounds_faults
from softreach.arm.actuators.sector import ring_name_faults
from softreach.arm.along import Pieces, Samples
from softreach.arm.design_file.keys import Key, field_keys, in_file_units, keys_of, radians
from softreach.arm.loads import PointLoad
from softreach.arm.material import Material
from softreach.arm.measured import Measured
from softreach.arm.number import Number, series_faults
from softreach.arm.profile import Profile
from softreach.support.errors import Fault, InvalidDesign, Range, did_you_mean

__all__ = ["WRONG", "TableReader", "is_doubtful", "unknown_key"]

WRONG: Any = object()
"""In place of a value that has faults."""

_RESTS_ON = {
    "activation_bounds": {"bundles"},
    "end_over_length": {"start_over_length"},
    "inner_ratio": {"outer_ratio"},
    "radii": {"stations_over_length"},
    "taper": {"length", "outer_radius"},
}
"""Fields -> others that decide whether they are right."""

_ALONG_KEYS = {key: key for key in ("stations_over_length", "values", "interpolation")}


_THREE = "must be three finite numbers"


class TableReader:
    """Reads tables one at a time and keeps their faults."""

    def __init__(self) -> None:
        self.faults: list[Fault] = []

    def part(
        self, kind: type[Any], raw: Any, path: str, without: tuple[str, ...] = (), **others: Any
    ) -> Any:
        """The part that a table describes; None where it has faults.

        Args:
            kind: Its class.
            raw: Table as the file holds it.
            path: Its path in the file.
            without: Keys that the table does not have here.
            others: Further fields of the part.
        """
        values, wrong = self.values(kind, raw, path, without)
        if values is None:
            return None
        for key in keys_of(kind).values():  # so that the others can be judged
            if key.field in wrong and key.required:
                values[key.field] = _example(key)
        try:
            part = kind(**values, **others)
        except InvalidDesign as error:
            keys = field_keys(kind)
            certain = (fault for fault in error.faults if not is_doubtful(fault, wrong))
            self.faults += [_in_keys(fault, keys, raw, path) for fault in certain]
            return None
        return None if wrong else part

    def values(
        self, kind: type[Any], raw: Any, path: str, without: tuple[str, ...] = ()
    ) -> tuple[dict[str, Any] | None, set[str]]:
        """Field -> value of a table, None if it is none, and the fields whose values are wrong."""
        if not isinstance(raw, dict):
            self.refused(path, raw, "must be a table")
            return None, set()
        keys = {name: key for name, key in keys_of(kind).items() if name not in without}
        values: dict[str, Any] = {}
        for name, key in keys.items():
            if name in raw and key.field in values:
                allowed = f"give exactly one of {key.field} (a name) and {name}"
                values[key.field] = self.refused(f"{path}.{name}", raw[name], allowed)
            elif name in raw:
                values[key.field] = self.value(key, raw[name], f"{path}.{name}")
            elif key.required and key.field not in values:
                values[key.field] = self.refused(f"{path}.{name}", None, "required key is missing")
        fields = {key.field: name for name, key in keys.items()}
        for name in raw:
            if name not in keys and not (name == "kind" and issubclass(kind, (Profile, Actuator))):
                self.refused(f"{path}.{name}", raw[name], unknown_key(name, fields))
        wrong = {field for field, value in values.items() if value is WRONG}
        return {field: value for field, value in values.items() if field not in wrong}, wrong

    def value(self, key: Key, raw: Any, path: str) -> Any:
        """Value of a field in SI units."""
        if key.number is not None:
            return self.number(key.number, raw, path)
        if key.field == "activation_bounds":
            return self._judged(raw, path, bounds_faults(raw, None))
        if key.field == "ring":
            return self._judged(raw, path, ring_name_faults(raw))
        if key.field in ("material", "core"):
            return self.material(raw, path)
        if key.field in ("points", "gains", "offsets", "bounds"):  # which base and drive judge
            return raw if key.field == "points" else _floats(raw)
        if key.field == "measured":
            made = self.part(Measured, raw, path)
            return WRONG if made is None else made
        if key.field == "point_loads":
            return self._point_loads(raw, path)
        return raw if isinstance(raw, str) else self.refused(path, raw, "must be text")

    def number(self, number: Number, raw: Any, path: str) -> Any:
        """A number in SI units, a function along the arm, or a tuple of numbers."""
        if number.along is not None and isinstance(raw, dict):
            return self.along(number, raw, path)
        if number.pair and isinstance(raw, list):
            values = self._all(number, raw, path)
            return values if len(raw) == 2 else self.refused(path, raw, "must be a number, or two")
        if number.shape == "along":
            return self.refused(path, raw, "must be a table")
        if number.shape == "single":
            return self._single(number, raw, path)
        if number.shape == "series" and isinstance(raw, list):
            return self._all(number, raw, path)
        numbers = isinstance(raw, list) and all(map(_is_number, raw))
        if number.shape == "triple":
            faults = number.faults(raw) if numbers else [Fault("", raw, _THREE)]
            return self._judged(tuple(raw) if numbers else raw, path, faults, raw)
        return tuple(raw) if numbers else self.refused(path, raw, "must be a list of numbers")

    def along(self, number: Number, raw: dict[str, Any], path: str) -> Any:
        """A function along the arm, in the unit of the key that it belongs to."""
        before = len(self.faults)
        places, values = (self._list(raw, name, path) for name in list(_ALONG_KEYS)[:2])
        values = self._all(number, values, f"{path}.values")
        kinds = ("cubic", "linear") if number.along is Samples else ("cubic", "linear", "constant")
        kind = raw.get("interpolation", "cubic")
        if kind not in kinds:
            self.refused(f"{path}.interpolation", kind, f"must be one of {', '.join(kinds)}")
        for name in (key for key in raw if key not in _ALONG_KEYS):
            self.refused(f"{path}.{name}", raw[name], unknown_key(name, _ALONG_KEYS))
        if len(self.faults) > before:
            return WRONG
        fields = {"stations_over_length": places, "values": values}
        for fault in series_faults(fields, "values", kind != "constant"):
            return self.refused(f"{path}.{fault.path}", raw[fault.path], fault.allowed)
        return Pieces(**fields) if kind == "constant" else Samples(**fields, interpolation=kind)

    def _list(self, raw: dict[str, Any], name: str, path: str) -> list[Any]:
        """The list under a required key; an empty one, and a fault, if there is none."""
        if isinstance(value := raw.get(name), list):
            return value
        allowed = "must be a list of numbers" if name in raw else "required key is missing"
        self.refused(f"{path}.{name}", value, allowed)
        return []

    def material(self, raw: Any, path: str) -> Any:
        """A material from the table of its values."""
        made = self.part(Material, raw, path)
        return WRONG if made is None else made

    def refused(self, path: str, value: Any, allowed: Range | str) -> Any:
        """Note a fault, in the units of files."""
        self.faults.append(Fault(path, value, in_file_units(allowed)))
        return WRONG

    def _single(self, number: Number, raw: Any, path: str) -> Any:
        if not _is_number(raw) or (number.allowed.whole and isinstance(raw, float)):
            kind = "integer" if number.allowed.whole else "number"
            return self.refused(path, raw, f"must be a valid {kind}")
        value = radians(raw) if number.unit == "rad" else raw
        if limits := number.refusal(value):
            return self.refused(path, raw, limits)
        return int(value) if number.allowed.whole else float(value)

    def _all(self, number: Number, raw: list[Any], path: str) -> Any:
        values = [self._single(number, element, f"{path}[{k}]") for k, element in enumerate(raw)]
        return WRONG if any(value is WRONG for value in values) else tuple(values)

    def _judged(self, value: Any, path: str, faults: list[Fault], shown: Any = None) -> Any:
        for fault in faults:
            return self.refused(path, fault.value if shown is None else shown, fault.allowed)
        return value

    def _point_loads(self, raw: Any, path: str) -> Any:
        if not isinstance(raw, list):
            return self.refused(path, raw, "must be a list")
        loads = [self.part(PointLoad, table, f"{path}[{k}]") for k, table in enumerate(raw)]
        return WRONG if None in loads else tuple(loads)


def unknown_key(name: str, keys: Mapping[str, str]) -> str:
    """Message for a key that a table does not have.

    Args:
        name: The key.
        keys: Field -> key of the table.
    """
    hint = did_you_mean(keys.get(name, name), keys.values())
    return f"unknown key; {hint or 'known keys: ' + ', '.join(keys.values())}"


def is_doubtful(fault: Fault, wrong: Iterable[str]) -> bool:
    """A fault of fields that are wrong anyway."""
    fields = set(fault.path.split(", "))
    decisive = fields | {basis for field in fields for basis in _RESTS_ON.get(field, ())}
    return not decisive.isdisjoint(wrong)


def _in_keys(fault: Fault, keys: Mapping[str, str], raw: Mapping[str, Any], path: str) -> Fault:
    """The fault under the keys of the table, with the values as the file has them."""
    fields = fault.path.split(", ")
    if not set(fields) <= keys.keys():
        return fault._replace(path=f"{path}.{fault.path}")
    names = [keys[field] for field in fields]
    allowed = in_file_units(fault.allowed)
    if isinstance(allowed, str):
        allowed = re.sub(r"\w+", lambda word: keys.get(word[0], word[0]), allowed)
    values = tuple(raw.get(name) for name in names)
    value = values[0] if len(values) == 1 else values
    if all(part is None for part in values):
        value = None
    return Fault(", ".join(f"{path}.{name}" for name in names), value, allowed)


def _example(key: Key) -> Any:
    if key.number is None:
        return {"name": "drive", "gains": {"bundle": 1.0}}.get(key.field, (0.0, 1.0))  # or bounds
    if key.number.shape in ("series", "stations"):
        return (0.0, 1.0) if key.number.shape == "stations" else (1.0, 1.0)
    return next(value for value in (1.0, 0.5, 0.0) if key.number.allowed.admits(value))


def _floats(raw: Any) -> Any:
    if isinstance(raw, dict):
        return {name: _floats(value) for name, value in raw.items()}
    if isinstance(raw, list):
        return tuple(map(_floats, raw))
    return float(raw) if _is_number(raw) else raw


def _is_number(raw: Any) -> bool:
    return isinstance(raw, int | float) and not isinstance(raw, bool)
