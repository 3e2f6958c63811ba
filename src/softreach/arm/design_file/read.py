"""From the text of a design file to the parts of an arm, or every fault of it at once."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from os import PathLike
from typing import Any, NamedTuple

from softreach.arm.actuators import Actuator
from softreach.arm.actuators.actuator import MOST_BUNDLES
from softreach.arm.along import AlongArm
from softreach.arm.base import Base
from softreach.arm.design_file.keys import (
    ACTUATORS,
    KINDS,
    PROFILES,
    Kind,
    WrittenFloat,
    field_keys,
    key_text,
    keys_of,
    known_kinds,
    own_kind,
)
from softreach.arm.design_file.tables import WRONG, TableReader, is_doubtful, unknown_key
from softreach.arm.drives import Drive
from softreach.arm.loads import Loads, PointLoad
from softreach.arm.marker import Marker
from softreach.arm.material import LIBRARY_HINT, Material, material_names, named_material
from softreach.arm.number import Number
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.rest_shape import STRAIGHT, RestShape
from softreach.arm.rigid import RigidPiece
from softreach.arm.section import Ring, Section, name_faults
from softreach.arm.stations import PLACE, Located, Stations, placed
from softreach.support.errors import Fault, InvalidDesign, Range, did_you_mean
from softreach.support.files.text import read_text, tables_of
from softreach.support.units import UNITS

__all__ = ["LONGEST", "Parts", "document_of", "parse", "text_of"]

LONGEST = 250_000
"""Bytes, or characters, that a design file may have: thousands of times as many as designs take."""

LAYOUT: Mapping[str, tuple[type, bool]] = {
    "version": (int, True),
    "profile": (dict, True),
    "materials": (dict, False),
    "section": (dict, False),
    "rings": (list, True),
    "stations": (dict, False),
    "actuators": (list, True),
    "rigid_pieces": (list, False),
    "drives": (list, False),
    "markers": (list, False),
    "loads": (dict, False),
    "base": (dict, False),
    "rest": (dict, False),
    "display": (dict, False),
}
"""Keys at the top of a file, their types, and whether they are required."""


class Parts(NamedTuple):
    """Parts of an arm that a file describes."""

    profile: Profile
    section: Section
    actuators: tuple[Actuator, ...]
    loads: Loads | None
    base: Base
    rest: RestShape
    stations: Mapping[str, float]
    rigid_pieces: tuple[RigidPiece, ...]
    drives: tuple[Drive, ...]
    markers: tuple[Marker, ...]
    display_unit: str | None


def text_of(path: str | PathLike[str]) -> str:
    """The text of a design file.

    Raises:
        InvalidInput: No file that can be read, one too large to be a design, or no text in UTF-8.
    """
    return read_text("design", path, LONGEST)


def document_of(
    text: str, source: str, number: Callable[[str], Any] = WrittenFloat
) -> dict[str, Any]:
    """The tables of TOML text; numbers with a point or an exponent remember how they were written.

    Args:
        text: The text of a design file.
        source: Its name in errors.
        number: Maker of the value of a number with a point or an exponent.

    Raises:
        InvalidDesign: Text that is no TOML, or too long to be a design.
    """
    if len(text) > LONGEST:
        allowed = f"must be at most {LONGEST:,} characters long, and has {len(text):,}"
        raise InvalidDesign([Fault("TOML", None, allowed)], source)
    try:
        return tables_of(text, number)
    except ValueError as error:
        raise InvalidDesign([Fault("TOML", str(error), "must be valid TOML")], source) from None


def parse(text: str, source: str) -> Parts:
    """The parts of an arm from TOML text.

    Args:
        text: The text of a design file.
        source: Its name in errors.

    Raises:
        InvalidDesign: Every fault of the text, with its key, value and what is allowed.
    """
    document = document_of(text, source)
    version = document.get("version", 2)
    if isinstance(version, bool) or version != 2:
        raise InvalidDesign([Fault("version", version, "must be 2")], source)
    reader = _DesignReader(document)
    parts = reader.parts()
    if parts is None or reader.faults:
        raise InvalidDesign(reader.faults, source)
    return parts


class _DesignReader(TableReader):
    def __init__(self, document: dict[str, Any]) -> None:
        super().__init__()
        self._document = document
        self._materials: dict[str, Material | None] = {}
        self._unknown_material = False
        self._unknown_kinds: list[Any] = []

    def parts(self) -> Parts | None:
        self._check_layout()
        profile = self._profile()
        self._materials = {
            name: self.part(Material, raw, f"materials.{key_text(name)}", ("name",), name=name)
            for name, raw in (self._table("materials") or {}).items()
        }
        rings = [self.part(Ring, raw, f"rings[{k}]") for k, raw in self._tables("rings")]
        section = self._section(rings)
        tables = self._document.get("actuators")
        if isinstance(tables, list) and len(tables) > MOST_BUNDLES:
            self.refused("actuators", f"{len(tables):,} tables", f"must be at most {MOST_BUNDLES}")
            return None
        actuators = [(k, self._actuator(k, raw)) for k, raw in self._tables("actuators")]
        drives = [self.part(Drive, raw, f"drives[{k}]") for k, raw in self._tables("drives")]
        raw = self._table("loads")
        loads = None if raw is None else self.part(Loads, raw, "loads")
        raw = self._table("base")
        base = Base() if raw is None else self.part(Base, raw, "base")
        raw = self._table("rest")
        rest = STRAIGHT if raw is None else self.part(RestShape, raw, "rest")
        stations = self._stations()
        others = {
            key: [(k, self.part(kind, raw, f"{key}[{k}]")) for k, raw in self._tables(key)]
            for key, kind in (("rigid_pieces", RigidPiece), ("markers", Marker))
        }
        unit = self._display_unit()
        names = [table.get("name") if isinstance(table, dict) else None for table in tables or ()]
        self.faults += name_faults(names, "actuators")
        if profile is None or section is None or stations is None:
            return None
        sound = [(k, actuator) for k, actuator in actuators if actuator is not None]
        self._check_fit(profile, section, stations, sound)
        made = {key: [(k, part) for k, part in each if part] for key, each in others.items()}
        for path, part in ((f"{key}[{k}]", part) for key, each in made.items() for k, part in each):
            faults = _place_faults(part, profile, stations)
            self.faults += [fault._replace(path=f"{path}.{fault.path}") for fault in faults]
        if loads is not None:
            self.faults += self._of_section(loads.section_faults(section, profile.length))
        actuators = tuple(actuator for _, actuator in sound)
        rigid, markers = (tuple(part for _, part in each) for each in made.values())
        return Parts(
            profile=profile,
            section=section,
            actuators=actuators,
            loads=loads,
            base=base,
            rest=rest,
            stations=stations,
            rigid_pieces=rigid,
            drives=tuple(drive for drive in drives if drive is not None),
            markers=markers,
            display_unit=unit,
        )

    def _stations(self) -> Stations | None:
        before = len(self.faults)
        places = {
            name: self.number(PLACE, raw, f"stations.{key_text(name)}")
            for name, raw in (self._table("stations") or {}).items()
        }
        try:
            stations = Stations({name: z for name, z in places.items() if z is not WRONG})
        except InvalidDesign as error:
            for fault in error.faults:
                self.refused(f"stations.{key_text(fault.path)}", fault.value, fault.allowed)
            return None
        return stations if len(self.faults) == before else None

    def _display_unit(self) -> str | None:
        raw = self._table("display") or {}
        for key in raw:
            if key != "unit":
                said = unknown_key(key, {"unit": "unit"})
                self.refused(f"display.{key_text(key)}", raw[key], said)
        unit = raw.get("unit")
        if unit is not None and unit not in UNITS:
            self.refused("display.unit", unit, f"must be one of {', '.join(UNITS)}")
        return unit

    def _check_layout(self) -> None:
        """Top of the file: keys that are unknown or missing, and values of another type."""
        for key, (kind, required) in LAYOUT.items():
            value = self._document.get(key)
            if key not in self._document:
                if required:
                    self.refused(key, None, "required key is missing")
            elif kind is list:
                self._check_list(key, value)
            elif kind is dict and not isinstance(value, dict):
                self.refused(key, value, "must be a table")
        for key in self._document:
            if key not in LAYOUT:
                place = _place(key)
                known = {name: name for name in LAYOUT}
                said = f"unknown key; {place}" if place else unknown_key(key, known)
                self.refused(key_text(key), self._document[key], said)

    def _check_list(self, key: str, value: Any) -> None:
        if not isinstance(value, list):
            self._document = {**self._document, key: []}
            self.refused(key, value, "must be a list")
        elif key == "rings" and not value:
            self.refused(key, value, "must not be empty")
        else:
            for k, table in enumerate(value):
                if not isinstance(table, dict):
                    self.refused(f"{key}[{k}]", table, "must be a table")

    def _table(self, key: str) -> dict[str, Any] | None:
        value = self._document.get(key)
        return value if isinstance(value, dict) else None

    def _tables(self, key: str) -> Iterator[tuple[int, dict[str, Any]]]:
        for k, raw in enumerate(self._document.get(key, ())):
            if isinstance(raw, dict):
                yield k, raw

    def _profile(self) -> Profile | None:
        if (raw := self._table("profile")) is None:
            return None
        kind = raw.get("kind", "linear")
        if isinstance(kind, str) and kind in PROFILES:
            return self.part(PROFILES[kind], raw, "profile")
        return self._own_part(Profile, kind, raw, "profile")

    def material(self, raw: Any, path: str) -> Any:
        if isinstance(raw, dict):
            return super().material(raw, path)
        if not isinstance(raw, str):
            self._unknown_material = True
            allowed = "must be the name of a material, or a table of its values"
            return self.refused(path, raw, allowed)
        if raw in self._materials:
            self._unknown_material |= self._materials[raw] is None
            return self._materials[raw] or Material()
        if raw in material_names():
            return named_material(raw)
        self._unknown_material = True
        self.refused(path, raw, _materials_text(raw, [*self._materials]))
        return Material()

    def _section(self, rings: list[Ring | None]) -> Section | None:
        made = tuple(ring for ring in rings if ring is not None)
        raw = self._document.get("section", {})
        if not isinstance(raw, dict):
            return None
        values, wrong = self.values(Section, raw, "section")
        if not made or len(made) < len(rings) or values is None:
            return None
        if self._unknown_material:
            made = tuple(ring.replace(material=Material()) for ring in made)
            values.pop("core", None)
        try:
            section = Section(rings=made, **values)
        except InvalidDesign as error:
            certain = [fault for fault in error.faults if not is_doubtful(fault, wrong)]
            self.faults += self._of_section(certain)
            return None
        return None if wrong or self._unknown_material else section

    def _of_section(self, faults: list[Fault]) -> list[Fault]:
        """Faults of the section under the paths of the file, one for each path."""
        placed = {}
        for fault in faults:
            path = self._place(fault.path.removeprefix("section."))
            placed.setdefault(path, fault._replace(path=path))
        return list(placed.values())

    def _place(self, path: str) -> str:
        """Path in the file of a field of the section, of a ring or of a material of one."""
        owner, _, field = path.rpartition(".")
        if path.startswith("loads."):
            return f"{owner}.{field_keys(PointLoad).get(field, field)}"
        if not path.startswith(("rings", "core")):
            return f"section.{path}"
        key = field_keys(Material).get(field)
        if key is None:
            return path if path.startswith("rings") else f"section.{path}"
        name = self._material_name(owner)
        if isinstance(name, str) and name in self._materials:
            return f"materials.{key_text(name)}.{key}"
        return f"section.{owner}.{key}" if owner == "core" else f"{owner}.{key}"

    def _material_name(self, owner: str) -> Any:
        if owner == "core":
            return (self._table("section") or {}).get("core")
        k = int(owner.partition("[")[2].partition("]")[0])
        return dict(self._tables("rings"))[k].get("material")

    def _actuator(self, k: int, raw: dict[str, Any]) -> Actuator | None:
        path, kind = f"actuators[{k}]", raw.get("kind")
        if isinstance(kind, str) and kind in ACTUATORS:
            return self.part(ACTUATORS[kind], raw, path)
        return self._own_part(Actuator, kind, raw, path)

    def _own_part(self, of: type[Kind], kind: Any, raw: dict[str, Any], path: str) -> Kind | None:
        own = own_kind(of, kind) if isinstance(kind, str) else None
        if own is None:
            path = f"{path}.kind"
            if not isinstance(kind, str) or kind not in self._unknown_kinds:
                self.refused(path, kind, _kinds_text(of, kind))
            self._unknown_kinds.append(kind)
            return None
        try:
            return _of_own_kind(own, raw)
        except InvalidDesign as error:
            for fault in error.faults:
                self.faults.append(fault._replace(path=f"{path}.{fault.path}".rstrip(".")))
            return None

    def _check_fit(
        self,
        profile: Profile,
        section: Section,
        stations: Stations,
        actuators: list[tuple[int, Actuator]],
    ) -> None:
        lacking: list[Fault] = []
        for k, actuator in actuators:
            named = dataclasses.replace(actuator, name=actuator.name or f"actuators[{k}]")
            faults = _place_faults(named, profile, stations)
            for fault in faults or placed(named, stations).section_faults(profile, section):
                if fault.path.startswith(("rings", "core")):
                    lacking.append(fault)
                else:
                    self.faults.append(fault._replace(path=f"actuators[{k}].{fault.path}"))
        self.faults += self._of_section(lacking)


def _place_faults(part: Located, profile: Profile, stations: Stations) -> list[Fault]:
    try:
        return placed(part, stations).place_faults(profile.length)
    except InvalidDesign as error:
        return list(error.faults)


def _of_own_kind(kind: type[Kind], table: Mapping[str, Any]) -> Kind:
    """A part of a class outside softreach, from its fields in Python and in SI units."""
    values = {key: _plain(value) for key, value in table.items() if key != "kind"}
    try:
        return kind(**values)
    except TypeError as error:
        raise InvalidDesign([Fault("", kind.__name__, f"has other fields: {error}")]) from None


def _plain(value: Any) -> Any:
    """Lists as tuples, and tables of values along the arm as functions."""
    if isinstance(value, dict):
        anything = Number(symbol="", meaning="", allowed=Range(), along=AlongArm)
        function = TableReader().along(anything, value, "")
        return value if function is WRONG else function
    if isinstance(value, list):
        return tuple(_plain(item) for item in value)
    return float(value) if isinstance(value, WrittenFloat) else value


def _place(key: str) -> str:
    """Hint where a key belongs that is not one of the top."""
    if key.removesuffix("s") in ACTUATORS:
        return f'write [[actuators]] with kind = "{key.removesuffix("s")}"'
    homes = {
        "[profile]": LinearTaper,
        "[section]": Section,
        "[[rings]]": Ring,
        "[materials.NAME]": Material,
        "[loads]": Loads,
    }
    home = next((home for home, kind in homes.items() if key in keys_of(kind)), "")
    return f"it belongs in {home}" if home else ""


def _materials_text(name: str, own: list[str]) -> str:
    hint = did_you_mean(name, [*own, *material_names()]) or LIBRARY_HINT
    here = f"of this file ({', '.join(own)})" if own else "with a table [materials.NAME]"
    return f"must be a material {here}, or of the library; {hint}"


def _kinds_text(of: type[Any], kind: Any) -> str:
    known = KINDS[of]
    if kind is None:
        return f"required key is missing: one of {', '.join(known)}"
    names = {part.__name__: name for name, part in known.items()}
    if isinstance(kind, str) and kind in names:
        return f'must be the kind of a file; did you mean "{names[kind]}"?'
    own = known_kinds(of)
    others = "or a class of your own that is imported, on the command line by --import"
    hint = did_you_mean(kind, [*known, *own]) if isinstance(kind, str) else ""
    return f"must be one of {', '.join([*known, *own])}, {others}{f'; {hint}' if hint else ''}"
