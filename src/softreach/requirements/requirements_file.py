"""Requirements as TOML: units in keys or values, places and meshes in files beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softreach.atlas.metrics import known_metric
from softreach.inverse.request import positions_in
from softreach.requirements.parts import LIMIT_UNITS, LONGEST, Keep, Limits, Target
from softreach.requirements.regions import Box, HalfSpace, Mesh, Region, Sphere
from softreach.support.errors import InvalidDesign, InvalidInput, NotPossible, SoftreachError
from softreach.support.files.text import read_text
from softreach.support.files.toml import (
    WRONG,
    FaultReader,
    document_of,
    inline_table,
    key_text,
    value_text,
)
from softreach.support.quantity import read_quantity, unit_names
from softreach.support.units import read_length

_KEYS = ("version", "reach", "stay_inside", "avoid", "limits", "measures", "search")
"""At the top, beside payloads; `search` is read by the search of designs."""
_EXAMPLES = {"m": "5cm", "kg": "200g", "N": "5N", "Pa": "50kPa"}
"""SI unit of numbers that have one -> how such a number may be written."""
_SHAPES: Mapping[str, Mapping[str, str]] = {
    "box": {"low": "m", "high": "m"},
    "sphere": {"center": "m", "radius": "m"},
    "half_space": {"point": "m", "normal": ""},
    "mesh": {},
}
"""Region -> its numbers and their units."""
_KINDS = {"box": Box, "sphere": Sphere, "half_space": HalfSpace}
_EXAMPLE = {kind: {"region": Sphere((0.0, 0.0, 0.0), 1.0)} for kind in (Target, Keep)} | {
    Limits: {}
}


def read(text: str, folder: Path, length: float | None, source: str) -> dict[str, Any]:
    """Fields of the requirements of a text, or all of its faults at once.

    Args:
        text: TOML.
        folder: Folder that the paths in it start from.
        length: Length of the arm [m], for lengths in L; None refuses these.
        source: What errors call it.

    Raises:
        InvalidDesign: Faults under the keys of the text.
    """
    document = document_of(text, LONGEST, source)
    reader = _Reader(folder, length)
    parts = reader.parts(document)
    if reader.faults:
        raise InvalidDesign(reader.faults, source)
    return parts


class _Reader(FaultReader):
    def __init__(self, folder: Path, length: float | None) -> None:
        super().__init__()
        self.folder, self.length = folder, length

    def parts(self, document: dict[str, Any]) -> dict[str, Any]:
        """Fields of the requirements; of no use where there are faults."""
        self._check_keys(document, "", ("payloads", *_KEYS), _keys("payloads", "kg"))
        if document.get("version", 1) != 1:
            self._refuse("version", document["version"], "must be 1")
        payloads = self._value(document, "", "payloads", "kg", several=True)
        return {
            "payloads": () if payloads is None else payloads,
            "targets": [self._target(*each) for each in self._tables(document, "reach")],
            "keeps": [
                self._keep(*each, kind == "stay_inside")
                for kind in ("stay_inside", "avoid")
                for each in self._tables(document, kind)
            ],
            "limits": self._limits(self._table(document, "limits")),
            "measures": self._measures(self._table(document, "measures")),
        }

    def _target(self, raw: dict[str, Any], path: str) -> Any:
        values = self._part(
            raw, path, {"within": "m", "share": "", "places": "m"}, ("name", "file")
        )
        region, file = values.pop("region", None), values.pop("file", None)
        sources = [x for x in (values.get("places"), file, region) if x is not None]
        if len(sources) != 1:
            allowed = f"needs one of places, file, {', '.join(_SHAPES)}, and has {len(sources)}"
            return self._refuse(path, None, allowed)
        if isinstance(file, str):
            try:
                text = read_text("file", self.folder / file, LONGEST)
                values["places"] = np.array(positions_in(text, file, self.length))
            except InvalidInput as error:
                allowed = f"must be {error.allowed} ({error.name} = {error.value})"
                values["places"] = self._refuse(f"{path}.file", file, allowed)
        return self._made(Target, raw, path, values | ({"region": region} if region else {}))

    def _keep(self, raw: dict[str, Any], path: str, inside: bool) -> Any:
        values = self._part(raw, path, {"clearance": "m"}, ("name", "of", "when"))
        if values.get("region") is None:
            return self._refuse(path, None, f"needs one of {', '.join(_SHAPES)}")
        return self._made(Keep, raw, path, {**values, "inside": inside})

    def _part(
        self, raw: dict[str, Any], path: str, numbers: Mapping[str, str], words: tuple[str, ...]
    ) -> dict[str, Any]:
        """Values of a table by field: numbers, words, and the region that it has."""
        shown = (*numbers, *words, *_SHAPES, "mesh_unit")
        self._check_keys(raw, path, shown, _all_keys(numbers))
        values = {
            name: value
            for name, unit in numbers.items()
            if (value := self._value(raw, path, name, unit, several=name == "places")) is not None
        }
        for name in (name for name in words if name in raw):
            is_text = isinstance(raw[name], str)
            text = (
                raw[name] if is_text else self._refuse(f"{path}.{name}", raw[name], "must be text")
            )
            values[name] = text
        shapes = [name for name in _SHAPES if name in raw]
        if len(shapes) > 1:
            values["region"] = self._refuse(path, None, f"has {' and '.join(shapes)}: give one")
        elif shapes:
            values["region"] = self._region(raw, shapes[0], f"{path}.{shapes[0]}")
        if "mesh_unit" in raw and "mesh" not in raw:
            self._refuse(f"{path}.mesh_unit", raw["mesh_unit"], "needs a mesh")
        return values

    def _region(self, raw: dict[str, Any], shape: str, path: str) -> Any:
        table = raw[shape]
        if shape == "mesh" and isinstance(table, str):
            try:
                return Mesh.load(self.folder / table, unit=raw.get("mesh_unit"))
            except InvalidInput as error:
                if error.name == "unit":
                    return self._refuse(f"{path}_unit", error.value, f"must be {error.allowed}")
                return self._refuse(path, table, f"must be {error.allowed} ({error.value})")
            except SoftreachError as error:
                return self._refuse(path, table, str(error))
        if not isinstance(table, dict):
            return self._refuse(path, table, "must be a table" + " or a file" * (shape == "mesh"))
        if shape == "mesh":
            self._check_keys(table, path, ("vertices", "faces"), _keys("vertices", "m"))
            vertices = self._value(table, path, "vertices", "m", several=True)
            values = {"vertices": vertices, "faces": table.get("faces")}
            return self._made(Mesh, table, path, values)
        numbers = _SHAPES[shape]
        self._check_keys(table, path, numbers, _all_keys(numbers))
        values = {
            name: self._value(table, path, name, unit, several=name != "radius", needed=True)
            for name, unit in numbers.items()
        }
        return self._made(_KINDS[shape], table, path, values)

    def _limits(self, raw: dict[str, Any]) -> Any:
        self._check_keys(raw, "limits", LIMIT_UNITS, _all_keys(LIMIT_UNITS))
        values = {
            name: self._value(raw, "limits", name, unit) for name, unit in LIMIT_UNITS.items()
        }
        return self._made(Limits, raw, "limits", values)

    def _measures(self, raw: dict[str, Any]) -> dict[str, Any]:
        measures = {}
        for name, table in raw.items():
            path = f"measures.{key_text(name)}"
            metric = known_metric(name)
            if metric is None or metric.over:
                self._refuse(path, None, "is no metric: softreach list metrics names them")
            elif not isinstance(table, dict):
                self._refuse(path, table, "must be a table with at_least, at_most or both")
            else:
                unit = metric.unit if metric.unit in _EXAMPLES else ""
                ends: dict[str, str] = dict.fromkeys(("at_least", "at_most"), unit)
                self._check_keys(table, path, ends, _all_keys(ends))
                measures[name] = tuple(
                    self._value(table, path, end, unit, plain=True) for end in ends
                )
        return measures

    def _made(self, kind: Any, raw: dict[str, Any], path: str, values: dict[str, Any]) -> Any:
        """A part of checked numbers; `WRONG` and a fault where it refuses them."""
        wrong = [name for name, value in values.items() if value is WRONG]
        if wrong and kind not in _EXAMPLE:
            return WRONG
        values = {name: value for name, value in values.items() if name not in wrong}
        if {"region", "places"} & set(wrong):  # so that the others can be judged
            values = _EXAMPLE[kind] | values
        try:
            made = kind(**values)
            return WRONG if wrong else made
        except NotPossible as error:
            return self._refuse(path, None, str(error))
        except InvalidInput as error:
            field = error.name.partition(" ")[0].partition("[")[0]
            key = next((key for key in raw if key.startswith(field)), "")
            value = raw[key] if key else error.value
            place = f"{path}.{key}" if key else path
            said = "" if key or error.name == field else f"{error.name} "
            return self._refuse(place, value, f"{said}must be {error.allowed}")

    def _value(
        self,
        raw: dict[str, Any],
        path: str,
        name: str,
        unit: str,
        *,
        several: bool = False,
        needed: bool = False,
        plain: bool = False,
    ) -> Any:
        """A number, or several, in SI units under a key with or without its unit; None without.

        `several` are in lists; `plain` ones may go without their unit.
        """
        known = _keys(name, unit)
        keys = [key for key in known if key in raw]
        start = f"{path}." if path else ""
        if len(keys) != 1:
            if keys:
                return self._refuse(start + name, None, f"has {' and '.join(keys)}: give one")
            usual = [*known][unit != ""]
            return self._refuse(start + usual, None, "required key is missing") if needed else None
        (key,) = keys
        symbol = known[key]
        if several and not isinstance(raw[key], list | str):
            return self._refuse(start + key, raw[key], "must be a list")
        try:
            return self._read(raw[key], unit, symbol, plain or not unit)
        except ValueError:
            return self._refuse(start + key, raw[key], self._allowed(unit, symbol, name))

    def _read(self, value: Any, unit: str, symbol: str, plain: bool) -> Any:
        """Numbers in SI units, however nested.

        Raises:
            ValueError: Anything else.
        """
        if isinstance(value, list):
            return [self._read(item, unit, symbol, plain) for item in value]
        if isinstance(value, bool) or not isinstance(value, int | float | str):
            raise ValueError(value)
        if isinstance(value, str):
            if symbol or not unit:
                raise ValueError(value)
            if "," in value:
                return [self._read(item, unit, symbol, plain) for item in value.split(",")]
            return self._quantity(value, unit)
        if not symbol and not plain and value != 0:
            raise ValueError(value)
        if symbol in ("", unit):
            return value
        return self._quantity(f"{value!r}{symbol}", unit)

    def _quantity(self, text: str, unit: str) -> float:
        is_relative = unit == "m" and text.strip().endswith("L")
        return read_length(text, self.length) if is_relative else read_quantity(text, unit)

    def _allowed(self, unit: str, symbol: str, name: str) -> str:
        if symbol == "L" and self.length is None:
            return "the length L of the arm is not known here: give m, cm or mm"
        if symbol or not unit:
            return "must be finite numbers" + " without a unit, which the key holds" * bool(symbol)
        units = ", ".join(unit_names(unit)) + ", L" * (unit == "m" and self.length is not None)
        hint = "" if unit != "m" or self.length is not None else "; L is not known here"
        return (
            f'must have its unit ({units}), such as "{_EXAMPLES[unit]}", or stand under '
            f"{name}_{unit.lower()}{hint}"
        )


def _all_keys(numbers: Mapping[str, str]) -> list[str]:
    return [key for name, unit in numbers.items() for key in _keys(name, unit)]


def _keys(name: str, unit: str) -> dict[str, str]:
    units = {each.lower(): each for each in unit_names(unit) if each.isascii()} if unit else {}
    units |= {"over_length": "L"} if unit == "m" else {}
    return {name: ""} | {f"{name}_{suffix}": symbol for suffix, symbol in units.items()}


def written(
    *,
    targets: Sequence[Target],
    keeps: Sequence[Keep],
    limits: Limits,
    payloads: Sequence[float],
    measures: Mapping[str, tuple[float | None, float | None]],
) -> str:
    """The text of a file with these fields; lengths in m, masses in kg."""
    head = {"version": 1} | ({"payloads_kg": payloads} if payloads else {})
    blocks = [["# softreach requirements", *_lines(head)]]
    for target in targets:
        lines = ["[[reach]]", *_lines({"name": target.name})]
        if target.places is not None:
            rows = (f"  {value_text(row)}," for row in target.places.tolist())
            lines += ["places_m = [", *rows, "]"]
        elif target.region is not None:
            lines += [_region_line(target.region), *_lines({"share": target.share})]
        blocks.append(lines + _lines({"within_m": target.within} if target.within else {}))
    for keep in sorted(keeps, key=lambda keep: not keep.inside):
        words = {"of": keep.of, "when": keep.when}
        words |= {"clearance_m": keep.clearance} if keep.clearance else {}
        start = [f"[[{keep.kind}]]", *_lines({"name": keep.name})]
        blocks.append([*start, _region_line(keep.region), *_lines(words)])
    if limits.given:
        keys = (f"{name}_{LIMIT_UNITS[name].lower()}".rstrip("_") for name in limits.given)
        blocks.append(["[limits]", *_lines(dict(zip(keys, limits.given.values(), strict=True)))])
    blocks += [["[measures]"]] if measures else []
    for name, ends in measures.items():
        pairs = zip(("at_least", "at_most"), ends, strict=True)
        table = inline_table((key, value_text(end)) for key, end in pairs if end is not None)
        blocks[-1].append(f"{key_text(name)} = {table}")
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _lines(values: Mapping[str, Any]) -> list[str]:
    return [f"{key} = {value_text(value)}" for key, value in values.items()]


def _region_line(region: Region) -> str:
    if isinstance(region, Mesh) and region.source:
        place = str(Path(region.source).resolve())
        return "\n".join(_lines({"mesh": place, "mesh_unit": region.unit}))
    if isinstance(region, Mesh):
        shape = "mesh"
        values = {"vertices_m": region.vertices.tolist(), "faces": region.faces.tolist()}
    else:
        shape = next(name for name, kind in _KINDS.items() if isinstance(region, kind))
        keys = (f"{name}_{unit}".rstrip("_") for name, unit in _SHAPES[shape].items())
        values = dict(zip(keys, (getattr(region, x) for x in _SHAPES[shape]), strict=True))
    return f"{shape} = {inline_table((key, value_text(x)) for key, x in values.items())}"
