"""Regions of space in TOML: their tables, with numbers in units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from softreach.geometry.meshes import Mesh, MeshFile
from softreach.geometry.regions import Box, Cylinder, HalfSpace, Region, Sphere, Tube
from softreach.support.errors import InvalidInput, SoftreachError
from softreach.support.files import toml
from softreach.support.quantity import read_quantity, unit_names
from softreach.support.units import read_length

EXAMPLES = {"m": "5cm", "kg": "200g", "N": "5N", "Pa": "50kPa", "rad": "5deg"}
"""SI unit of numbers that have one -> how such a number may be written."""
SHAPES: Mapping[str, tuple[type[Region], Mapping[str, str]]] = {
    "box": (Box, {"low": "m", "high": "m"}),
    "sphere": (Sphere, {"center": "m", "radius": "m"}),
    "cylinder": (Cylinder, {"start": "m", "end": "m", "radius": "m"}),
    "tube": (Tube, {"start": "m", "end": "m", "radius": "m", "inner_radius": "m"}),
    "half_space": (HalfSpace, {"point": "m", "normal": ""}),
    "mesh": (Mesh, {"vertices": "m", "faces": ""}),
}
"""Regions, with their numbers and the units of these."""


class RegionReader(toml.FaultReader):
    """Reads tables of numbers with units, and regions, and gathers the faults.

    Files lie beside `folder`; None for text that may name no file. Lengths may be in `length` [m],
    as "0.05L", if that is known.
    """

    lists: ClassVar[set[str]] = {name for _, own in SHAPES.values() for name in own}
    lists -= {"radius", "inner_radius"}
    """Names of numbers of which there are several."""

    def __init__(self, folder: Path | None, length: float | None, *, is_lazy: bool = False) -> None:
        """With `is_lazy` the files of meshes are read at their first use."""
        super().__init__()
        self.folder, self.length, self.is_lazy = folder, length, is_lazy

    def _beside(self, name: str, instead: str) -> Path:
        if self.folder is not None:
            return self.folder / name
        allowed = f"part of the text: other files are not sent along; write {instead}"
        raise InvalidInput("file", repr(name), allowed)

    def one_of(self, raw: dict[str, Any], path: str) -> Any:
        """The region of a table; `WRONG` and a fault where it has none, or several."""
        shapes = [name for name in SHAPES if name in raw]
        if len(shapes) != 1:
            allowed = f"needs one of {', '.join(SHAPES)}, and has {len(shapes)}"
            return self._refuse(path, None, allowed)
        return self.region(raw, shapes[0], f"{path}.{shapes[0]}")

    def region(self, raw: dict[str, Any], shape: str, path: str) -> Any:
        """The region that stands under the key of its shape."""
        table = raw[shape]
        if shape == "mesh" and isinstance(table, str):
            try:
                file = self._beside(table, "vertices_m and faces")
                unit = raw.get("mesh_unit")
                return MeshFile(file, unit) if self.is_lazy else Mesh.load(file, unit=unit)
            except InvalidInput as error:
                of_unit = error.name == "unit"
                place, value = (f"{path}_unit", error.value) if of_unit else (path, table)
                return self._refuse(place, value, f"must be {error.allowed}")
            except SoftreachError as error:
                return self._refuse(path, table, str(error))
        if not isinstance(table, dict):
            return self._refuse(path, table, "must be a table" + " or a file" * (shape == "mesh"))
        kind, numbers = SHAPES[shape]
        values = self._numbers(table, path, numbers)
        for name, unit in numbers.items():
            if name not in values:
                key = [*keys_with_units(name, unit)][unit != ""]
                return self._refuse(f"{path}.{key}", None, "required key is missing")
        return self._made(kind, table, path, values)

    def _made(self, kind: Any, raw: dict[str, Any], path: str, values: dict[str, Any]) -> Any:
        """A part of checked numbers; `WRONG` and a fault where it refuses them."""
        if any(value is toml.WRONG for value in values.values()):
            return toml.WRONG
        try:
            return kind(**values)
        except InvalidInput as error:
            field = re.split(r"[ .\[]", error.name)[0]
            key = next((key for key in raw if key.startswith(field)), "")
            value = raw[key] if key else error.value
            said = "" if key or error.name == field else f"{error.name} "
            place = f"{path}.{key}" if key else path
            return self._refuse(place, value, f"{said}must be {error.allowed}")
        except SoftreachError as error:
            return self._refuse(path, None, str(error))

    def _numbers(
        self,
        raw: dict[str, Any],
        path: str,
        numbers: Mapping[str, str],
        others: Sequence[str] = (),
        *,
        plain: bool = False,
    ) -> dict[str, Any]:
        """Numbers of a table in SI units by field; keys beside these and `others` are refused.

        `plain` ones may go without their unit.
        """
        known = {name: keys_with_units(name, unit) for name, unit in numbers.items()}
        self._check_keys(raw, path, (*numbers, *others), set().union(*known.values()))
        start, values = f"{path}." if path else "", {}
        for name, unit in numbers.items():
            keys = [key for key in known[name] if key in raw]
            if len(keys) > 1:
                allowed = f"has {' and '.join(keys)}: give one"
                values[name] = self._refuse(start + name, None, allowed)
            elif keys:
                value, symbol = raw[keys[0]], known[name][keys[0]]
                fits = name not in self.lists or isinstance(value, list | str)
                try:
                    own = value if fits else None
                    values[name] = self._read(own, unit, symbol, plain or not unit)
                except ValueError:
                    allowed = self._allowed(unit, symbol, name) if fits else "must be a list"
                    values[name] = self._refuse(start + keys[0], value, allowed)
        return values

    def _read(self, value: Any, unit: str, symbol: str, plain: bool) -> Any:
        """Numbers in SI units, however nested; `ValueError` of anything else."""
        if isinstance(value, str) and "," in value:
            value = value.split(",")
        if isinstance(value, list):
            return [self._read(item, unit, symbol, plain) for item in value]
        is_number = isinstance(value, int | float) and not isinstance(value, bool)
        if is_number and symbol in ("", unit) and (symbol or plain or value == 0):
            return value
        if is_number and symbol:
            value = f"{value!r}{symbol}"
        elif not isinstance(value, str) or not unit or symbol:
            raise ValueError(value)
        is_relative = unit == "m" and value.strip().endswith("L")
        return read_length(value, self.length) if is_relative else read_quantity(value, unit)

    def _allowed(self, unit: str, symbol: str, name: str) -> str:
        if symbol == "L" and self.length is None:
            return "the length L of the arm is not known here: give m, cm or mm"
        if symbol or not unit:
            return "must be finite numbers" + " without a unit, which the key holds" * bool(symbol)
        more, hint = ("", "; L is not known here") if self.length is None else (", L", "")
        more, hint = (more, hint) if unit == "m" else ("", "")
        how = f'({", ".join(unit_names(unit))}{more}), such as "{EXAMPLES[unit]}"'
        return f"must have its unit {how}, or stand under {name}_{unit.lower()}{hint}"


def keys_with_units(name: str, unit: str) -> dict[str, str]:
    """Keys of a number: as it is, with its unit in its value, or with each unit in the name."""
    units = {each.lower(): each for each in unit_names(unit) if each.isascii()} if unit else {}
    units |= {"over_length": "L"} if unit == "m" else {}
    return {name: ""} | {f"{name}_{suffix}": symbol for suffix, symbol in units.items()}


def lines_of(values: Mapping[str, Any]) -> list[str]:
    """Lines of a table, without what is None."""
    return [f"{key} = {toml.value_text(x)}" for key, x in values.items() if x is not None]


def region_line(region: Region) -> str:
    """The line of a table that says a region."""
    if isinstance(region, MeshFile) or (isinstance(region, Mesh) and region.source):
        place = region.path if isinstance(region, MeshFile) else Path(region.source).resolve()
        place = str(place)
        return "\n".join(lines_of({"mesh": place, "mesh_unit": region.unit}))
    shapes = SHAPES.items()
    shape, numbers = next((name, own) for name, (kind, own) in shapes if type(region) is kind)
    keys = (f"{name}_{unit}".rstrip("_") for name, unit in numbers.items())
    values = (toml.value_text(np.asarray(getattr(region, name)).tolist()) for name in numbers)
    return f"{shape} = {toml.inline_table(zip(keys, values, strict=True))}"
