"""Materials of an arm, and those of the library by name: `materials.toml`."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from types import MappingProxyType
from typing import Any

from softreach.arm.number import number
from softreach.arm.part import Part
from softreach.support.arguments import as_text
from softreach.support.errors import Fault, InvalidInput

LIBRARY_HINT = (
    "the page Materials of the guide lists them, and so does arm.material.material_names()"
)
"""Places where the names of materials are listed."""


@dataclass(frozen=True, kw_only=True)
class Material(Part):
    """An isotropic elastic material.

    While one material fills an arm that only fibers and muscles drive, Young's modulus cancels from
    its shapes and may be left out. Density is needed for weight alone.

    Raises:
        InvalidDesign: A field is out of its range.
    """

    young_modulus: float | None = number("E", "Pa", "Young's modulus", above=0.0, default=None)
    """E, Young's modulus [Pa]; None where it cancels."""
    poisson_ratio: float = number("ν", "", "Poisson's ratio", low=0.0, high=0.5, default=0.5)
    """ν, Poisson's ratio [-]."""
    density: float | None = number("ρ", "kg/m³", "density", low=0.0, default=None)
    """ρ, mass per volume [kg/m³]; 0 where only loads count, None where weight plays no part."""
    name: str = ""
    """Name in files and pictures."""

    @property
    def relative_modulus(self) -> float:
        """E [Pa], or 1 where it cancels and was left out."""
        return 1.0 if self.young_modulus is None else self.young_modulus

    def same_matter(self, other: Material) -> bool:
        """All but the names are equal."""
        return self == other or self.replace(name="") == other.replace(name="")


@dataclass(frozen=True)
class MaterialRecord:
    """A material of the library and where its numbers come from."""

    material: Material  # The material under its name
    modulus: str  # Kind of Young's modulus: `Young's modulus`, `stress at 100 % strain`, ...
    sources: Mapping[str, str]  # Field of a number -> heading of the page of references
    note: str  # Advice to a designer, in a line


def material_names() -> tuple[str, ...]:
    """The names of all materials of the library, from soft to stiff."""
    return tuple(_library())


def material_record(name: str) -> MaterialRecord:
    """A material of the library with the sources of its numbers; raises InvalidInput."""
    if name not in (library := _library()):
        hint = _hint(name, tuple(library))
        raise InvalidInput("material", name, "a material of the library", hint)
    return library[name]


def named_material(name: str) -> Material:
    """A material of the library.

    Args:
        name: One of `material_names()`, such as "ecoflex_00_30".

    Raises:
        InvalidInput: No material has this name.
    """
    return material_record(as_text("name", name)).material


def as_material(material: Any) -> Any:
    """The material of the library for its name; anything else as it is."""
    known = isinstance(material, str) and material in _library()
    return _library()[material].material if known else material


def material_faults(field: str, value: object, *, optional: bool = False) -> list[Fault]:
    """A fault for a field of a part that is no material and no name of one."""
    if isinstance(value, Material) or (optional and value is None):
        return []
    hint = f"; {_hint(value, material_names())}" if isinstance(value, str) else ""
    others = "the name of one of the library" + (", or None" if optional else "")
    return [Fault(field, value, f"must be a Material, or {others}{hint}")]


@cache
def _library() -> Mapping[str, MaterialRecord]:
    text = files("softreach.arm").joinpath("materials.toml").read_text(encoding="utf-8")
    records: list[MaterialRecord] = []
    for name, row in tomllib.loads(text).items():
        numbers = {
            "young_modulus": row["young_modulus_pa"],
            "poisson_ratio": row["poisson_ratio"],
            "density": row.get("density_kg_m3"),
        }
        sources = MappingProxyType(row["sources"])
        material = Material(**numbers, name=name)
        records.append(MaterialRecord(material, row["modulus"], sources, row["note"]))
    records.sort(key=lambda record: record.material.young_modulus or 0.0)
    return MappingProxyType({record.material.name: record for record in records})


def _hint(name: object, names: tuple[str, ...]) -> str:
    spelled = str(name).strip().lower().replace(" ", "_").replace("-", "_")
    close = difflib.get_close_matches(spelled, names, n=3, cutoff=0.5)
    return f"did you mean {' or '.join(close)}?" if close else LIBRARY_HINT
