"""Requirements as TOML: units in keys or values, places and meshes in files beside it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from softreach.arm.design_file.keys import inline_table, key_text, unknown_key, value_text
from softreach.atlas.metrics import known_metric
from softreach.inverse.request import positions_in
from softreach.requirements.parts import LIMIT_UNITS, LONGEST, Keep, Limits, Target
from softreach.requirements.regions import Box, HalfSpace, Mesh, Region, Sphere
from softreach.support.errors import Fault, InvalidDesign, InvalidInput, SoftreachError
from softreach.support.files.text import read_text, tables_of
from softreach.support.quantity import read_quantity, unit_names
from softreach.support.units import read_length

if TYPE_CHECKING:
    from softreach.requirements.requirements import Requirements

__all__ = ["read", "written"]

_KEYS = ("version", "payloads", "reach", "stay_inside", "avoid", "limits", "measures")
_SUFFIXES = {
    "m": {"m": "m", "cm": "cm", "mm": "mm", "over_length": "L"},
    "kg": {"kg": "kg", "g": "g"},
    "N": {"n": "N"},
    "Pa": {"pa": "Pa", "kpa": "kPa"},
}
"""SI unit -> suffix of a key -> unit."""
_EXAMPLES = {"m": "5cm", "kg": "200g", "N": "5N", "Pa": "50kPa"}
_SHAPES: Mapping[str, Mapping[str, str]] = {
    "box": {"low": "m", "high": "m"},
    "sphere": {"center": "m", "radius": "m"},
    "half_space": {"point": "m", "normal": ""},
    "mesh": {},
}
"""Region -> its numbers and their units."""
_KINDS = {"box": Box, "sphere": Sphere, "half_space": HalfSpace}
_NUMBERS = {"reach": {"within": "m", "share": ""}, "keep": {"clearance": "m"}}
_WORDS = {"reach": ("name", "file"), "keep": ("name", "of", "when")}
_WRONG: Any = object()
"""In place of a value that has faults."""
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
    if len(text) > LONGEST:
        raise InvalidDesign([Fault("TOML", None, f"must be at most {LONGEST:,} long")], source)
    try:
        document = tables_of(text)
    except ValueError as error:
        raise InvalidDesign([Fault("TOML", str(error), "must be valid TOML")], source) from None
    reader = _Reader(folder, length)
    parts = reader.parts(document)
    if reader.faults:
        raise InvalidDesign(reader.faults, source)
    return parts


class _Reader:
    def __init__(self, folder: Path, length: float | None) -> None:
        self.folder, self.length = folder, length
        self.faults: list[Fault] = []

    def parts(self, document: dict[str, Any]) -> dict[str, Any]:
        """Fields of the requirements; of no use where there are faults."""
        keys = (*_KEYS, "search")  # which the search of designs reads
        self._check_keys(document, {key: key for key in keys}, "", ("payloads",))
        if document.get("version", 1) != 1:
            self._refuse("version", document["version"], "must be 1")
        payloads = self._value(document, "", "payloads", "kg", several=True)
        targets = [self._target(*each) for each in self._tables(document, "reach")]
        inside = [self._keep(*each, True) for each in self._tables(document, "stay_inside")]
        outside = [self._keep(*each, False) for each in self._tables(document, "avoid")]
        return {
            "targets": targets,
            "keeps": inside + outside,
            "limits": self._limits(self._table(document, "limits")),
            "payloads": () if payloads is None else payloads,
            "measures": self._measures(self._table(document, "measures")),
        }

    def _target(self, raw: dict[str, Any], path: str) -> Any:
        numbers = {**_NUMBERS["reach"], "places": "m"}
        values = self._part(raw, path, numbers, _WORDS["reach"], ("places",))
        region = values.pop("region", None)
        file = values.pop("file", None)
        sources = [x for x in (values.get("places"), file, region) if x is not None]
        if len(sources) != 1:
            allowed = f"needs one of places, file, {', '.join(_SHAPES)}, and has {len(sources)}"
            return self._refuse(path, None, allowed)
        if isinstance(file, str):
            values["places"] = self._places_of(file, f"{path}.file")
        return self._made(Target, raw, path, values | ({"region": region} if region else {}))

    def _keep(self, raw: dict[str, Any], path: str, inside: bool) -> Any:
        values = self._part(raw, path, _NUMBERS["keep"], _WORDS["keep"], ())
        if values.get("region") is None:
            return self._refuse(path, None, f"needs one of {', '.join(_SHAPES)}")
        return self._made(Keep, raw, path, {**values, "inside": inside})

    def _part(
        self,
        raw: dict[str, Any],
        path: str,
        numbers: Mapping[str, str],
        words: tuple[str, ...],
        several: tuple[str, ...],
    ) -> dict[str, Any]:
        """Values of a table by field: numbers, words, and the region that it has."""
        known = {**numbers, **dict.fromkeys((*words, *_SHAPES, "mesh_unit"), "")}
        self._check_keys(raw, known, f"{path}.", tuple(numbers))
        values = {
            name: value
            for name, unit in numbers.items()
            if (value := self._value(raw, path, name, unit, several=name in several)) is not None
        }
        for name in words:
            if isinstance(value := raw.get(name, ""), str):
                values |= {name: value} if name in raw else {}
            else:
                values[name] = self._refuse(f"{path}.{name}", value, "must be text")
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
            self._check_keys(table, {"vertices": "m", "faces": ""}, f"{path}.", ("vertices",))
            vertices = self._value(table, path, "vertices", "m", several=True)
            values = {"vertices": vertices, "faces": table.get("faces")}
            return self._made(Mesh, table, path, values)
        numbers = _SHAPES[shape]
        self._check_keys(table, numbers, f"{path}.", tuple(numbers))
        values = {
            name: self._value(table, path, name, unit, several=name != "radius", needed=True)
            for name, unit in numbers.items()
        }
        return self._made(_KINDS[shape], table, path, values)

    def _limits(self, raw: dict[str, Any]) -> Any:
        self._check_keys(raw, LIMIT_UNITS, "limits.", tuple(LIMIT_UNITS))
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
                ends = ("at_least", "at_most")
                self._check_keys(table, dict.fromkeys(ends, metric.unit), f"{path}.", ends)
                unit = metric.unit if metric.unit in _SUFFIXES else ""
                measures[name] = tuple(
                    self._value(table, path, end, unit, plain=True) for end in ends
                )
        return measures

    def _places_of(self, file: str, path: str) -> Any:
        name = self.folder / file
        try:
            text = read_text("file", name, LONGEST)
            return np.array(positions_in(text, str(file), self.length))
        except InvalidInput as error:
            allowed = f"must be {error.allowed} ({error.name} = {error.value})"
            return self._refuse(path, file, allowed)

    def _made(self, kind: Any, raw: dict[str, Any], path: str, values: dict[str, Any]) -> Any:
        """A part of checked numbers; `_WRONG` and a fault where it refuses them."""
        wrong = [name for name, value in values.items() if value is _WRONG]
        if wrong and kind not in _EXAMPLE:
            return _WRONG
        values = {name: value for name, value in values.items() if name not in wrong}
        if {"region", "places"} & set(wrong):  # so that the others can be judged
            values = _EXAMPLE[kind] | values
        try:
            made = kind(**values)
            return _WRONG if wrong else made
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

        Args:
            raw: The table.
            path: Its path.
            name: The key without a unit.
            unit: SI unit; "" for none.
            several: A list, in lists if need be.
            needed: Its absence is a fault.
            plain: Numbers may go without their unit, which is known.
        """
        suffixes = {
            f"{name}_{suffix}": symbol for suffix, symbol in _SUFFIXES.get(unit, {}).items()
        }
        keys = [key for key in (name, *suffixes) if key in raw]
        start = f"{path}." if path else ""
        if len(keys) != 1:
            if keys or needed:
                said = f"has {' and '.join(keys)}: give one" if keys else "required key is missing"
                key = name if keys else next(iter(suffixes), name)
                return self._refuse(start + key, None, said)
            return None
        (key,) = keys
        symbol = suffixes.get(key, "")
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
            if unit == "m":
                return read_length(_with_unit(value), self.length)
            return read_quantity(value, unit)
        if not symbol and not plain and value != 0:
            raise ValueError(value)
        if symbol in ("", unit):
            return value
        text = f"{value!r}{symbol}"
        return read_length(text, self.length) if unit == "m" else read_quantity(text, unit)

    def _allowed(self, unit: str, symbol: str, name: str) -> str:
        if symbol == "L" and self.length is None:
            return "the length L of the arm is not known here: give m, cm or mm"
        if symbol or not unit:
            return "must be finite numbers" + " without a unit, which the key holds" * bool(symbol)
        suffix = next(key for key, each in _SUFFIXES[unit].items() if each == unit)
        units = ", ".join(unit_names(unit)) + ", L" * (unit == "m" and self.length is not None)
        hint = "" if unit != "m" or self.length is not None else "; L is not known here"
        return (
            f'must have its unit ({units}), such as "{_EXAMPLES[unit]}", or stand under '
            f"{name}_{suffix}{hint}"
        )

    def _check_keys(
        self, raw: dict[str, Any], known: Mapping[str, str], start: str, numbers: tuple[str, ...]
    ) -> None:
        every = {}
        for name, unit in known.items():
            every[name] = name
            if name in numbers:
                unit = "kg" if name == "payloads" else unit
                every |= {f"{name}_{x}": f"{name}_{x}" for x in _SUFFIXES.get(unit, {})}
        for key in raw:
            if key not in every:
                shown = {name: name for name in known}
                self._refuse(start + key_text(key), raw[key], unknown_key(key, shown))

    def _table(self, document: dict[str, Any], key: str) -> dict[str, Any]:
        raw = document.get(key, {})
        if isinstance(raw, dict):
            return raw
        self._refuse(key, raw, "must be a table")
        return {}

    def _tables(self, document: dict[str, Any], key: str) -> Iterator[tuple[dict[str, Any], str]]:
        raw = document.get(key, [])
        if not isinstance(raw, list):
            self._refuse(key, raw, f"must be tables: write [[{key}]]")
            return
        for k, table in enumerate(raw):
            if isinstance(table, dict):
                yield table, f"{key}[{k}]"
            else:
                self._refuse(f"{key}[{k}]", table, "must be a table")

    def _refuse(self, path: str, value: Any, allowed: str) -> Any:
        self.faults.append(Fault(path, value, allowed))
        return _WRONG


def _with_unit(text: str) -> str:
    """A length that has a unit, or is 0.

    Raises:
        ValueError: A number alone.
    """
    bare = text.strip().lstrip("+-").replace(".", "").replace("e", "").replace("E", "")
    if bare.isdigit() and float(text) != 0.0:
        raise ValueError(text)
    return text


def written(needs: Requirements) -> str:
    """The text of a file; lengths in m, masses in kg."""
    blocks = [["# softreach requirements", "version = 1"]]
    if needs.payloads:
        blocks[0].append(f"payloads_kg = {value_text(needs.payloads)}")
    blocks += map(_target_lines, needs.targets)
    blocks += map(_keep_lines, sorted(needs.keeps, key=lambda keep: not keep.inside))
    if limits := needs.limits.given:
        blocks.append(["[limits]", *(_limit_line(name, x) for name, x in limits.items())])
    if needs.measures:
        blocks.append(["[measures]", *(_measure_line(*each) for each in needs.measures.items())])
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _target_lines(target: Target) -> list[str]:
    lines = ["[[reach]]", f"name = {value_text(target.name)}"]
    if target.places is not None:
        rows = (f"  {value_text(row)}," for row in target.places.tolist())
        lines += ["places_m = [", *rows, "]"]
    elif target.region is not None:
        lines += [*_region_lines(target.region), f"share = {value_text(target.share)}"]
    return lines + [f"within_m = {value_text(target.within)}"] * bool(target.within)


def _keep_lines(keep: Keep) -> list[str]:
    lines = [f"[[{keep.kind}]]", f"name = {value_text(keep.name)}", *_region_lines(keep.region)]
    lines += [f"of = {value_text(keep.of)}", f"when = {value_text(keep.when)}"]
    return lines + [f"clearance_m = {value_text(keep.clearance)}"] * bool(keep.clearance)


def _region_lines(region: Region) -> Iterator[str]:
    if isinstance(region, Mesh):
        if region.source:
            yield f"mesh = {value_text(str(Path(region.source).resolve()))}"
            yield f"mesh_unit = {value_text(region.unit)}"
            return
        arrays = {"vertices_m": region.vertices, "faces": region.faces}
        pairs = [(key, value_text(array.tolist())) for key, array in arrays.items()]
        yield f"mesh = {inline_table(pairs)}"
        return
    shape = next(name for name, kind in _KINDS.items() if isinstance(region, kind))
    pairs = [
        (f"{name}_{unit}" if unit else name, value_text(getattr(region, name)))
        for name, unit in _SHAPES[shape].items()
    ]
    yield f"{shape} = {inline_table(pairs)}"


def _limit_line(name: str, value: float) -> str:
    unit = LIMIT_UNITS[name].lower()
    return f"{name}_{unit} = {value_text(value)}" if unit else f"{name} = {value_text(value)}"


def _measure_line(name: str, ends: tuple[float | None, float | None]) -> str:
    pairs = zip(("at_least", "at_most"), ends, strict=True)
    table = inline_table((key, value_text(end)) for key, end in pairs if end is not None)
    return f"{key_text(name)} = {table}"
