"""The text of a design file, every number such that it reads back to the same one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any

from softreach.arm.actuators import Actuator
from softreach.arm.along import AlongArm, Samples
from softreach.arm.base import Base
from softreach.arm.design_file.keys import (
    ACTUATORS,
    PROFILES,
    degrees_text,
    inline_table,
    key_text,
    keys_of,
    value_text,
)
from softreach.arm.drives import BundleNumbers, Drive
from softreach.arm.loads import Loads
from softreach.arm.marker import Marker
from softreach.arm.material import Material
from softreach.arm.number import Station
from softreach.arm.profile import Profile
from softreach.arm.rest_shape import RestShape
from softreach.arm.rigid import RigidPiece
from softreach.arm.section import Section
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["display_text", "render"]

_ALWAYS = {"activation_bounds", "gravity", "offset", "taper"}
"""Fields that are written even where they are the default, for people to change."""

_FIRST = ("name", "unit", "ring", "length", "revolution")
_LAST = (
    "taper",
    "offset",
    "extent",
    "bundles",
    "activation_bounds",
    "start_over_length",
    "end_over_length",
    "start",
    "end",
)
"""Order of fields: between these stands what distinguishes a kind."""


def render(
    profile: Profile,
    section: Section,
    actuators: Sequence[Actuator],
    loads: Loads | None,
    base: Base,
    rest: RestShape,
    stations: Mapping[str, float],
    rigid_pieces: Sequence[RigidPiece],
    drives: Sequence[Drive],
    markers: Sequence[Marker],
) -> str:
    """TOML text of a design, of version 2.

    Raises:
        InvalidDesign: A part of one's own kind that is not made of plain values.
    """
    names = _named_materials(section)
    blocks = [
        ["version = 2"] if actuators else ["version = 2", "actuators = []"],
        ["[profile]", *_part_lines(profile, PROFILES)],
        *(
            [f"[materials.{key_text(name)}]", *_lines(material, without=("name",))]
            for name, material in names.items()
        ),
        *_section_blocks(section, names),
    ]
    if stations:
        places = (f"{key_text(name)} = {value_text(z)}" for name, z in stations.items())
        blocks.append(["[stations]", *places])
    for actuator in actuators:
        blocks.append(["[[actuators]]", *_part_lines(actuator, ACTUATORS)])
    blocks += [["[[rigid_pieces]]", *_lines(piece)] for piece in rigid_pieces]
    blocks += [["[[drives]]", *_lines(drive)] for drive in drives]
    blocks += [["[[markers]]", *_lines(marker)] for marker in markers]
    if loads is not None:
        blocks.append(["[loads]", *_lines(loads)])
        blocks += [["[[loads.point_loads]]", *_lines(load)] for load in loads.point_loads]
    if not base.is_identity:
        blocks.append(["[base]", *_lines(base)])
    if not rest.is_straight:
        blocks.append(["[rest]", *_lines(rest)])
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def display_text(unit: str | None) -> str:
    """Text that follows a design in a file which says in what unit to show it."""
    return "" if unit is None else f"\n[display]\nunit = {value_text(unit)}\n"


def _part_lines(part: Actuator | Profile, kinds: Mapping[str, type]) -> Iterator[str]:
    """Kind and fields; of a class outside softreach the fields as they are in Python."""
    for name, kind in kinds.items():
        if kind is type(part):
            yield f"kind = {value_text(name)}"
            yield from _lines(part)
            return
    yield f"kind = {value_text(type(part).__name__)}"
    for field in fields(part):  # pyright: ignore[reportArgumentType]
        if field.init and (value := getattr(part, field.name)) is not None:
            value = value.name if isinstance(value, Station) else value
            yield f"{field.name} = {_plain_text(part, field.name, value)}"


def _plain_text(part: object, name: str, value: Any) -> str:
    try:
        return _along_text(value, value_text) if isinstance(value, AlongArm) else value_text(value)
    except (TypeError, ValueError):
        kind = type(part).__name__
        allowed = "must be a number, text or a sequence of these to fit in a design file"
        raise InvalidDesign([Fault(f"{kind}.{name}", value, allowed)]) from None


def _named_materials(section: Section) -> dict[str, Material]:
    used = [*([section.core] if section.core else []), *(ring.material for ring in section.rings)]
    named: dict[str, Material] = {}
    for material in used:
        if material.name:
            named.setdefault(material.name, material)
    return named


def _section_blocks(section: Section, names: Mapping[str, Material]) -> Iterator[list[str]]:
    inside = _lines(section, without=("core", "measured"))
    if section.core is not None:
        inside.insert(0, f"core = {_material_text(section.core, names)}")
    if inside:
        yield ["[section]", *inside]
    if section.measured is not None:
        yield ["[section.measured]", *_lines(section.measured)]
    for ring in section.rings:
        text = _material_text(ring.material, names)
        lines = _lines(ring, without=("material",))
        yield ["[[rings]]", *lines, *([] if text == "{}" else [f"material = {text}"])]


def _material_text(material: Material, names: Mapping[str, Material]) -> str:
    if repr(names.get(material.name)) == repr(material):
        return value_text(material.name)
    return inline_table(_pairs(material))


def _lines(part: object, without: tuple[str, ...] = ("point_loads",)) -> list[str]:
    return [f"{key} = {text}" for key, text in _pairs(part, without)]


def _pairs(part: object, without: tuple[str, ...] = ()) -> Iterator[tuple[str, str]]:
    """Keys and texts of what is not the default."""
    for key in sorted(keys_of(type(part)).values(), key=lambda key: _rank(key.field)):
        value = getattr(part, key.field)
        if key.field in without or value is None or key.of_names != isinstance(value, Station):
            continue
        if key.field in _ALWAYS or repr(value) != repr(key.default):
            yield key.name, _text(key.name, value)


def _rank(field: str) -> int:
    if field in _FIRST:
        return _FIRST.index(field) - len(_FIRST)
    return 1 + _LAST.index(field) if field in _LAST else 0


def _text(key: str, value: Any) -> str:
    if isinstance(value, BundleNumbers):
        return inline_table((key_text(name), value_text(x)) for name, x in value.items())
    if isinstance(value, Station):
        return value_text(value.name)
    number = degrees_text if key.endswith("_deg") else value_text
    return _along_text(value, number) if isinstance(value, AlongArm) else number(value)


def _along_text(along: AlongArm, number: Callable[[float], str]) -> str:
    kind = along.interpolation if isinstance(along, Samples) else "constant"
    pairs = [
        ("stations_over_length", value_text(along.stations_over_length)),
        ("values", f"[{', '.join(map(number, along.values))}]"),
    ]
    return inline_table(pairs if kind == "cubic" else [*pairs, ("interpolation", value_text(kind))])
