"""From the text of a design file to the fields of an arm.

The parts and the arm judge themselves; their faults come back under the keys of the file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Set
from os import PathLike
from pathlib import Path
from typing import Any, TypeVar

from softreach.arm.actuators import Actuator
from softreach.arm.body import named_actuators
from softreach.arm.design_file import (
    KINDS,
    LAYOUT,
    Key,
    Kind,
    Place,
    WrittenFloat,
    field_keys,
    in_file_terms,
    keys_of,
    one_a_path,
    own_kinds,
    radians,
)
from softreach.arm.loads import Loads, PointLoad
from softreach.arm.number import Number
from softreach.arm.obstacles import Obstacle
from softreach.arm.part import AlongArm, Part, Pieces, Samples
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.section import (
    LIBRARY_HINT,
    Material,
    Measured,
    Ring,
    Section,
    material_names,
    named_material,
)
from softreach.arm.stations import Marker, Stations
from softreach.geometry.region_tables import SHAPES, RegionReader
from softreach.support.errors import Fault, InvalidDesign, Range, did_you_mean
from softreach.support.files import toml
from softreach.support.files.text import read_text
from softreach.support.files.toml import WRONG, FaultReader, key_text, unknown_key

LONGEST = 250_000
"""Bytes, or characters, that a design file may have: thousands of times as many as designs take."""

Arm = TypeVar("Arm")


def text_of(path: str | PathLike[str]) -> str:
    """The text of a design file; raises InvalidInput without one, or without text in UTF-8."""
    return read_text("design", path, LONGEST)


def read(text: str, source: str, make: Callable[..., Arm]) -> Arm:
    """The arm that `make` makes of the fields in a TOML text, which errors call `source`.

    Raises:
        InvalidDesign: Every fault of the tables, and of the arm that the sound ones make.
    """
    document = toml.document_of(text, LONGEST, source, WrittenFloat)
    version = document.get("version", 2)
    if isinstance(version, bool) or version != 2:
        beside = "" if "profile" in document else ", and a design has a table [profile]"
        raise InvalidDesign([Fault("version", version, f"must be 2{beside}")], source)
    reader = _Reader(document, Path(source).parent)
    fields, faults, arm = reader.fields(), reader.faults, None
    if fields.keys() >= {"profile", "section", "stations"}:
        try:
            arm = make(**fields)
        except InvalidDesign as error:
            faults += in_file_terms(error, "", reader.places).faults
    if arm is None or faults:
        raise InvalidDesign(one_a_path(faults), source)
    return arm


class _Reader(FaultReader):
    """Makes the parts of an arm of tables, and gathers the faults."""

    def __init__(self, document: dict[str, Any], folder: Path) -> None:
        super().__init__()
        self._folder = folder
        self.places: dict[str, Place] = {}
        self._document = document
        self._materials: dict[str, Any] = {}

    def fields(self) -> dict[str, Any]:
        """Fields of the arm, without what is faulty, nor drives of actuators that may be."""
        self._check_layout()
        fields: dict[str, Any] = {"profile": self._alone("profile", Profile)}
        for name, raw in self._table(self._document, "materials").items():
            path = f"materials.{key_text(name)}"
            self._materials[name] = self._part(Material, raw, path, ("name",), name=name)
        fields["section"] = self._section()
        places = {"places": self._table(self._document, "stations")}
        fields["stations"] = self._made(Stations, Place("stations"), places)
        for name in ("actuators", "rigid_pieces", "drives", "markers", "surroundings"):
            fields[name] = self._several(name, LAYOUT[name].kind)
        listed = self._document.get("actuators")
        if not isinstance(listed, list) or len(fields["actuators"]) < len(listed):
            del fields["drives"]
        for name in ("loads", "base", "rest"):
            fields[name] = self._alone(name, LAYOUT[name].kind)
        display = self._table(self._document, "display")
        self._check_keys(display, "display", ["unit"])
        self.places["display_unit"] = Place("display.unit")
        fields["display_unit"], fields["point"] = display.get("unit"), self._document.get("point")
        return {name: x for name, x in fields.items() if x is not None and x is not WRONG}

    def _alone(self, name: str, kind: type[Part]) -> Any:
        raw = self._document.get(name)
        return self._any(kind, raw, name) if isinstance(raw, dict) else None

    def _several(self, name: str, kind: type[Part]) -> tuple[Any, ...]:
        """The sound parts of a list of tables, and where they stand by their paths in the arm."""
        tables = self._tables(self._document, name)
        each = [(path, self._any(kind, raw, path)) for raw, path in tables]
        sound = [(self.places[path], part) for path, part in each if part is not WRONG]
        parts = [part for _, part in sound]
        names = [each.name for each in named_actuators(parts)] if kind is Actuator else []
        names += [f"markers.{each.name}" for each in parts] if kind is Marker else []
        self.places |= {f"{name}[{k}]": place for k, (place, _) in enumerate(sound)}
        self.places |= dict(zip(names, (place for place, _ in sound), strict=False))
        return tuple(parts)

    def _any(self, kind: type[Part], raw: dict[str, Any], path: str) -> Any:
        """The part of a table, whose kind the table says where there are several."""
        if kind is Obstacle:
            return self._obstacle(raw, path)
        if kind not in KINDS:
            return self._part(kind, raw, path)
        named = raw.get("kind", "linear" if kind is Profile else None)
        if isinstance(named, str) and named in KINDS[kind]:
            return self._part(KINDS[kind][named], raw, path)
        own = own_kinds(kind).get(named) if isinstance(named, str) else None
        if own is None:
            return self._refuse(f"{path}.kind", named, _kinds_text(kind, named))
        # A class outside softreach: fields as they are in Python, in SI units.
        values = {key: self._plain(x, f"{path}.{key}") for key, x in raw.items() if key != "kind"}
        try:
            return self._made(own, Place(path), values)
        except TypeError as error:
            return self._refuse(path, own.__name__, f"has other fields: {error}")

    def _obstacle(self, raw: dict[str, Any], path: str) -> Any:
        reader, keys = RegionReader(self._folder, None, is_lazy=True), {*SHAPES, "mesh_unit"}
        region = reader.one_of(raw, path)
        self.faults += reader.faults
        own = {name: value for name, value in raw.items() if name not in keys}
        values, wrong = self._values(Obstacle, own, path)
        if region is WRONG:
            region, wrong = None, wrong | {"region"}
        place = Place(path, field_keys(Obstacle), own)
        return self._made(Obstacle, place, values | {"region": region}, wrong)

    def _part(
        self, kind: type[Part], raw: Any, path: str, without: tuple[str, ...] = (), **others: Any
    ) -> Any:
        values, wrong = self._values(kind, raw, path, without)
        return self._made(kind, Place(path, field_keys(kind), raw), values | others, wrong)

    def _values(
        self, kind: type[Part], raw: Any, path: str, without: tuple[str, ...] = ()
    ) -> tuple[dict[str, Any], set[str]]:
        """Field -> value in SI units, and the fields that no value can be given."""
        if not isinstance(raw, dict):
            self._refuse(path, raw, "must be a table")
            return {}, {""}
        keys = {name: key for name, key in keys_of(kind).items() if name not in without}
        values: dict[str, Any] = {}
        for name, key in keys.items():
            if name in raw and key.field in values:
                allowed = f"give exactly one of {key.field} (a name) and {name}"
                values[key.field] = self._refuse(f"{path}.{name}", raw[name], allowed) or WRONG
            elif name in raw:
                values[key.field] = self._value(kind, key, raw[name], f"{path}.{name}")
            elif key.required and key.field not in values:
                values[key.field] = self._refuse(f"{path}.{name}", None, "required key is missing")
        known = {key.field: name for name, key in keys.items()}
        allowed = {*keys, "kind"} if issubclass(kind, tuple(KINDS)) else {*keys}
        for name in (name for name in raw if name not in allowed):
            self._refuse(f"{path}.{name}", raw[name], unknown_key(name, known))
        wrong = {field for field, value in values.items() if value is WRONG}
        return {field: value for field, value in values.items() if field not in wrong}, wrong

    def _made(
        self,
        kind: type[Any],
        place: Place,
        values: Mapping[str, Any],
        wrong: Set[str] = frozenset(),
    ) -> Any:
        """A part, which judges its values but for those in `wrong`; `WRONG` for a faulty one."""
        self.places[place.path] = place
        if "" in wrong:
            return WRONG
        required = {key.field for key in keys_of(kind).values() if key.required} if wrong else set()
        try:
            part = kind(**{**dict.fromkeys(wrong & required), **values})
        except InvalidDesign as error:
            sure = [f for f in error.faults if wrong.isdisjoint(f.path.split(", "))]
            self.faults += in_file_terms(InvalidDesign(sure), "", {**self.places, "": place}).faults
            return WRONG
        return WRONG if wrong else part

    def _value(self, kind: type[Part], key: Key, raw: Any, path: str) -> Any:
        """Value of a field in SI units; what it may be is for the part to judge."""
        if key.number is not None:
            return self._number(key.number, raw, path)
        if key.field in ("material", "core"):
            return self._material(raw, path, of="core" if key.field == "core" else path)
        if key.field == "measured":
            return self._part(Measured, raw, path)
        if key.of_names and not isinstance(raw, str):
            return self._refuse(path, raw, "must be text")
        if key.field == "point_loads" and isinstance(raw, list):
            each = [self._part(PointLoad, load, f"{path}[{k}]") for k, load in enumerate(raw)]
            return WRONG if WRONG in each else tuple(each)
        return self._refuse(path, raw, "must be a list") if key.field == "point_loads" else raw

    def _number(self, number: Number, raw: Any, path: str) -> Any:
        if isinstance(raw, str) and number.named:  # which for the part is the name of a station
            return self._refuse(path, raw, "must be a number")
        if isinstance(raw, dict) and number.along is not None:
            return self._along(number, raw, path)
        if number.unit != "rad":
            return raw
        return tuple(map(_in_radians, raw)) if isinstance(raw, list) else _in_radians(raw)

    def _along(self, number: Number, raw: dict[str, Any], path: str) -> Any:
        """A function along the arm, in the unit of the key that it belongs to."""
        kind: type[AlongArm] = Samples
        kinds = ("cubic", "linear", "constant")[: 3 if number.along is AlongArm else 2]
        if (interpolation := raw.get("interpolation", "cubic")) not in kinds:
            allowed = f"must be one of {', '.join(kinds)}"
            return self._refuse(f"{path}.interpolation", interpolation, allowed)
        if interpolation == "constant":
            kind, raw = Pieces, {name: raw[name] for name in raw if name != "interpolation"}
        values, wrong = self._values(kind, raw, path)
        if isinstance(values.get("values"), list):
            values["values"] = self._number(number, values["values"], f"{path}.values")
        return self._made(kind, Place(path, field_keys(kind), raw), values, wrong)

    def _material(self, raw: Any, path: str, of: str) -> Any:
        if isinstance(raw, dict):
            made = self._part(Material, raw, path)
            self.places[of] = self.places[path]
            return made
        if isinstance(raw, str) and raw in self._materials:
            self.places[of] = self.places[f"materials.{key_text(raw)}"]
            return self._materials[raw]
        self.places[of] = Place(path, field_keys(Material))
        if isinstance(raw, str) and raw in material_names():
            return named_material(raw)
        if not isinstance(raw, str):
            allowed = "must be the name of a material, or a table of its values"
            return self._refuse(path, raw, allowed)
        own = [*self._materials]
        hint = did_you_mean(raw, [*own, *material_names()]) or LIBRARY_HINT
        here = f"of this file ({', '.join(own)})" if own else "with a table [materials.NAME]"
        return self._refuse(path, raw, f"must be a material {here}, or of the library; {hint}")

    def _section(self) -> Any:
        rings = [self._part(Ring, raw, path) for raw, path in self._tables(self._document, "rings")]
        for k in range(len(rings)):
            path = f"rings[{k}].material"
            self.places.setdefault(path, Place(path, field_keys(Material)))
        table = self._table(self._document, "section")
        values, wrong = self._values(Section, table, "section")
        if not rings or WRONG in rings:
            return WRONG
        place = Place("section", field_keys(Section), table)
        return self._made(Section, place, values | {"rings": tuple(rings)}, wrong)

    def _check_layout(self) -> None:
        """Top of the file: keys that are unknown or missing, and values of another type."""
        words = {dict: "must be a table", list: "must be a list", str: "must be text", int: ""}
        for key, block in LAYOUT.items():
            if key not in self._document and block.required:
                self._refuse(key, None, "required key is missing")
            elif key in self._document and not isinstance(self._document[key], block.shape):
                self._refuse(key, self._document[key], words[block.shape])
        if self._document.get("rings") == []:
            self._refuse("rings", [], "must not be empty")
        homes = {
            "[profile]": LinearTaper,
            "[section]": Section,
            "[[rings]]": Ring,
            "[materials.NAME]": Material,
            "[loads]": Loads,
        }
        for key in (key for key in self._document if key not in LAYOUT):
            home = next((home for home, kind in homes.items() if key in keys_of(kind)), "")
            said = f"unknown key; it belongs in {home}"
            if (kind := key.removesuffix("s")) in KINDS[Actuator]:
                said = f'unknown key; write [[actuators]] with kind = "{kind}"'
            elif not home:
                said = unknown_key(key, {name: name for name in LAYOUT})
            self._refuse(key_text(key), self._document[key], said)

    def _plain(self, value: Any, path: str) -> Any:
        """Lists as tuples, and tables of values along the arm as functions."""
        if isinstance(value, dict):
            anything = Number(symbol="", meaning="", allowed=Range(), along=AlongArm)
            made = self._along(anything, value, path)
            return None if made is WRONG else made
        if isinstance(value, list):
            return tuple(self._plain(item, path) for item in value)
        return float(value) if isinstance(value, WrittenFloat) else value


def _in_radians(value: Any) -> Any:
    return radians(value) if Range().admits(value) else value


def _kinds_text(of: type[Kind], kind: Any) -> str:
    known = KINDS[of]
    if kind is None:
        return f"required key is missing: one of {', '.join(known)}"
    names = {part.__name__: name for name, part in known.items()}
    if isinstance(kind, str) and kind in names:
        return f'must be the kind of a file; did you mean "{names[kind]}"?'
    own = own_kinds(of)
    others = "or a class of your own that is imported, on the command line by --import"
    hint = did_you_mean(kind, [*known, *own]) if isinstance(kind, str) else ""
    return f"must be one of {', '.join([*known, *own])}, {others}{f'; {hint}' if hint else ''}"
