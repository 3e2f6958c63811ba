"""From the text of a design file to the parts of an arm, or every fault of it at once."""

from __future__ import annotations

import dataclasses
import difflib
from collections.abc import Iterator
from typing import Any

from softreach.arm.actuator_checks import MOST_BUNDLES
from softreach.arm.actuators import Actuator
from softreach.arm.checks import name_faults
from softreach.arm.file.actuator_tables import ACTUATORS
from softreach.arm.file.body_tables import (
    PROFILES,
    InlineMaterial,
    MaterialTable,
    RingTable,
    SectionTable,
)
from softreach.arm.file.document import Parts, document_of
from softreach.arm.file.layout import Layout
from softreach.arm.file.load_table import LoadTable
from softreach.arm.file.own_kind import made_own_kind, own_kinds
from softreach.arm.file.table_reader import TableReader
from softreach.arm.file.toml_text import key_text
from softreach.arm.file.version_1 import ROOT_KEYS, parts_of_version_1
from softreach.arm.loads import Loads
from softreach.arm.material import Material
from softreach.arm.materials import LISTED, material_names, named_material
from softreach.arm.profile import Profile
from softreach.arm.section import Ring, Section
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["parse"]


def parse(text: str, source: str) -> Parts:
    """The parts of an arm from TOML text.

    Args:
        text: The text of a design file.
        source: What errors call it.

    Raises:
        InvalidDesign: Every fault of the text, with its key, value and what is allowed.
    """
    document = document_of(text, source)
    version = document.get("version", 1 if _looks_like_version_1(document) else 2)
    if version == 1 and version is not True:
        return parts_of_version_1(document, source)
    if version != 2:
        allowed = "must be 2, or 1 for files from before there were versions"
        raise InvalidDesign([Fault("version", version, allowed)], source)
    reader = _DesignReader(document)
    parts = reader.parts()
    if parts is None or reader.faults:
        raise InvalidDesign(reader.faults, source)
    return parts


def _looks_like_version_1(document: dict[str, Any]) -> bool:
    old = document.keys() & (ROOT_KEYS - {"actuators", "version"})
    return bool(old) and not document.keys() & {"profile", "rings", "section", "materials"}


class _DesignReader(TableReader):
    """Reads the tables of a design in the order in which they refer to each other."""

    def __init__(self, document: dict[str, Any]) -> None:
        super().__init__()
        self._document = document
        self._materials: dict[str, Material | None] = {}
        self._unknown_material = False

    def parts(self) -> Parts | None:
        """The parts of the arm; None where there are faults."""
        self.checked(Layout, self._document, "")
        profile = self._profile()
        self._materials = dict(self._own_materials())
        rings = [self._ring(k, raw) for k, raw in self._tables("rings")]
        section = self._section(rings)
        found = self._document.get("actuators")
        if isinstance(found, list) and len(found) > MOST_BUNDLES:
            allowed = f"must be at most {MOST_BUNDLES}"
            self.faults.append(Fault("actuators", f"{len(found):,} tables", allowed))
            return None
        actuators = [(k, self._actuator(k, raw)) for k, raw in self._tables("actuators")]
        loads = self._loads()
        self._check_names()
        if profile is None or section is None:
            return None
        made = [(k, one) for k, one in actuators if one is not None]
        self._check_fit(profile, section, made)
        if loads is not None:
            self.faults += self._of_section(loads.section_faults(section, profile.length))
        return Parts(profile, section, tuple(one for _, one in made), loads=loads)

    def _table(self, key: str) -> dict[str, Any] | None:
        """A table at the top; None if there is none, or something else."""
        found = self._document.get(key)
        return found if isinstance(found, dict) else None

    def _tables(self, key: str) -> Iterator[tuple[int, dict[str, Any]]]:
        """Index and content of those under a key that are tables."""
        found = self._document.get(key)
        for k, raw in enumerate(found if isinstance(found, list) else ()):
            if isinstance(raw, dict):
                yield k, raw

    def _profile(self) -> Profile | None:
        if (raw := self._table("profile")) is None:
            return None
        kind = raw.get("kind", "linear")
        if not isinstance(kind, str) or kind not in PROFILES:
            self.faults.append(Fault("profile.kind", kind, f"must be one of {', '.join(PROFILES)}"))
            return None
        return self.read(PROFILES[kind], raw, "profile", lambda table: table.made())

    def _loads(self) -> Loads | None:
        raw = self._table("loads")
        return None if raw is None else self.read(LoadTable, raw, "loads", lambda one: one.made())

    def _own_materials(self) -> Iterator[tuple[str, Material | None]]:
        for name, raw in (self._table("materials") or {}).items():
            if isinstance(raw, dict):
                path = f"materials.{key_text(name)}"
                yield name, self.read(MaterialTable, raw, path, lambda one, n=name: one.made(n))
            else:
                yield name, None

    def _material(self, given: str | InlineMaterial | None, path: str) -> Material:
        """The material of that name; a blank one, and a fault, where it is not known."""
        if not isinstance(given, str):
            return Material() if given is None else given.made(given.name)
        if given in self._materials:
            self._unknown_material |= self._materials[given] is None
            return self._materials[given] or Material()
        if given in material_names():
            return named_material(given)
        self.faults.append(Fault(path, given, _materials_text(given, [*self._materials])))
        self._unknown_material = True
        return Material()

    def _ring(self, k: int, raw: dict[str, Any]) -> Ring | None:
        path = f"rings[{k}]"
        if not isinstance(raw.get("material", ""), str | dict):
            self._unknown_material = True
        return self.read(
            RingTable,
            raw,
            path,
            lambda table: table.made(self._material(table.material, f"{path}.material")),
        )

    def _section(self, rings: list[Ring | None]) -> Section | None:
        made = tuple(ring for ring in rings if ring is not None)
        raw = self._document.get("section", {})
        if not isinstance(raw, dict):
            return None

        def section(table: SectionTable) -> Section | None:
            core = None
            if table.core is not None:
                core = self._material(table.core, "section.core")
            if not made or len(made) < len(rings):
                return None
            if not self._unknown_material:
                return table.made(made, core)
            table.made(tuple(ring.replace(material=Material()) for ring in made), None)
            return None

        before = len(self.faults)
        found = self.read(SectionTable, raw, "section", section)
        self.faults[before:] = self._of_section(self.faults[before:])
        return found

    def _of_section(self, faults: list[Fault]) -> list[Fault]:
        """Faults of the section under the paths of the file, one for each path."""
        placed = {}
        for fault in faults:
            path = self._place(fault.path.removeprefix("section."))
            placed.setdefault(path, fault._replace(path=path))
        return list(placed.values())

    def _place(self, path: str) -> str:
        """Where the file has a field of the section, of a ring or of a material of one."""
        owner, _, field = path.rpartition(".")
        if path.startswith("loads."):
            return path
        if not path.startswith(("rings", "core")):
            return f"section.{path}"
        key = MaterialTable.keys().get(field)
        if key is None:
            return path if path.startswith("rings") else f"section.{path}"
        name = self._material_name(owner)
        home = f"section.{owner}" if owner == "core" else owner
        if isinstance(name, str) and name in self._materials:
            return f"materials.{key_text(name)}.{key}"
        return f"{home}.{key}"

    def _material_name(self, owner: str) -> Any:
        """What the core, or a ring such as `rings[0].material`, names as its material."""
        if owner == "core":
            return (self._table("section") or {}).get("core")
        k = int(owner.partition("[")[2].partition("]")[0])
        return dict(self._tables("rings"))[k].get("material")

    def _actuator(self, k: int, raw: dict[str, Any]) -> Actuator | None:
        path, kind, own = f"actuators[{k}]", raw.get("kind"), own_kinds()
        if isinstance(kind, str) and kind in ACTUATORS:
            return self.read(ACTUATORS[kind], raw, path, lambda table: table.made())
        if not isinstance(kind, str) or kind not in own:
            self.faults.append(Fault(f"{path}.kind", kind, _kinds_text(kind, [*own])))
            return None
        try:
            return made_own_kind(own[kind], raw)
        except InvalidDesign as error:
            for fault in error.faults:
                self.faults.append(fault._replace(path=f"{path}.{fault.path}".rstrip(".")))
            return None

    def _check_names(self) -> None:
        found = self._document.get("actuators")
        tables = found if isinstance(found, list) else []
        names = [one.get("name") if isinstance(one, dict) else None for one in tables]
        self.faults += name_faults(names, "actuators")

    def _check_fit(
        self, profile: Profile, section: Section, actuators: list[tuple[int, Actuator]]
    ) -> None:
        """What keeps actuators from driving this body."""
        lacking: list[Fault] = []
        for k, actuator in actuators:
            named = dataclasses.replace(actuator, name=actuator.name or f"actuators[{k}]")
            for fault in named.section_faults(profile, section):
                if fault.path.startswith(("rings", "core")):
                    lacking.append(fault)
                else:
                    self.faults.append(fault._replace(path=f"actuators[{k}].{fault.path}"))
        self.faults += self._of_section(lacking)


def _materials_text(name: str, own: list[str]) -> str:
    """What is allowed as a material."""
    close = difflib.get_close_matches(name, [*own, *material_names()], n=1, cutoff=0.5)
    hint = f'; did you mean "{close[0]}"?' if close else ""
    here = f"of this file ({', '.join(own)})" if own else "with a table [materials.NAME]"
    return f"must be a material {here}, or of the library{hint or f'; {LISTED}'}"


def _kinds_text(kind: Any, own: list[str]) -> str:
    """What is allowed as the kind of an actuator."""
    if kind is None:
        return f"required key is missing: one of {', '.join(ACTUATORS)}"
    classes = {table.makes.__name__: name for name, table in ACTUATORS.items()}
    if isinstance(kind, str) and kind in classes:
        return f'must be the kind of a file; did you mean "{classes[kind]}"?'
    others = ", or a class of your own that is imported" + (f": {', '.join(own)}" if own else "")
    return f"must be one of {', '.join(ACTUATORS)}{others}"
