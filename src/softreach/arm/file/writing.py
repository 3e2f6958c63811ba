"""The text of a design file, every number such that it reads back to the same one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from softreach.arm.actuators import Actuator
from softreach.arm.along import AlongArm
from softreach.arm.file.actuator_tables import ACTUATORS, kind_of
from softreach.arm.file.along import along_text
from softreach.arm.file.body_tables import (
    PROFILES,
    MaterialTable,
    RingTable,
)
from softreach.arm.file.degrees import degrees_text
from softreach.arm.file.load_table import LoadTable, PointLoadTable
from softreach.arm.file.own_kind import own_kind_lines
from softreach.arm.file.table import Table
from softreach.arm.file.toml_text import inline_table, key_text, value_text
from softreach.arm.loads import Loads
from softreach.arm.material import Material
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.sampled_profiles import PiecewiseTaper, SampledTaper
from softreach.arm.section import Section
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["render"]

_PROFILE_KINDS = {LinearTaper: "linear", PiecewiseTaper: "piecewise", SampledTaper: "sampled"}

_ALWAYS = {"activation_bounds", "gravity", "offset", "taper"}
"""What is written even where it is the default, for people to change."""

_ORDER = (
    "name",
    "ring",
    "helical_angle",
    "revolution",
    "distance",
    "distance_ratio",
    "routing",
    "radius",
    "radius_ratio",
    "area_factor",
    "offset",
    "extent",
    "bundles",
    "activation_bounds",
    "start_over_length",
    "end_over_length",
)
"""Of an actuator: what distinguishes it first, what all share last."""


def render(
    profile: Profile, section: Section, actuators: Sequence[Actuator], loads: Loads | None = None
) -> str:
    """TOML text of a design, of version 2.

    Raises:
        InvalidDesign: A profile that design files have no table for, or an actuator of one's own
            kind that is not made of plain values.
    """
    names = _named_materials(section)
    blocks = [
        ["version = 2"] if actuators else ["version = 2", "actuators = []"],
        ["[profile]", *_profile_lines(profile)],
        *(_material_block(name, material) for name, material in names.items()),
        *_section_blocks(section, names),
    ]
    for actuator in actuators:
        kind = kind_of(actuator)
        lines = own_kind_lines(actuator) if kind is None else _actuator_lines(kind, actuator)
        blocks.append(["[[actuators]]", *lines])
    if loads is not None:
        blocks.append(["[loads]", *_lines(LoadTable, {**vars(loads), "point_loads": None})])
        blocks += [
            ["[[loads.point_loads]]", *_lines(PointLoadTable, vars(one))]
            for one in loads.point_loads
        ]
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def _profile_lines(profile: Profile) -> Iterator[str]:
    if type(profile) not in _PROFILE_KINDS:
        raise InvalidDesign([Fault("profile", profile, "has no keys in a design file")])
    kind = _PROFILE_KINDS[type(profile)]
    yield f"kind = {value_text(kind)}"
    yield from _lines(PROFILES[kind], vars(profile))


def _actuator_lines(kind: str, actuator: Actuator) -> Iterator[str]:
    yield f"kind = {value_text(kind)}"
    yield from _lines(ACTUATORS[kind], vars(actuator))


def _named_materials(section: Section) -> dict[str, Material]:
    """The materials that get a table: those with a name, the first of each."""
    used = [ring.material for ring in section.rings]
    if section.core is not None:
        used.insert(0, section.core)
    named: dict[str, Material] = {}
    for material in used:
        if material.name:
            named.setdefault(material.name, material)
    return named


def _material_block(name: str, material: Material) -> list[str]:
    return [f"[materials.{key_text(name)}]", *_lines(MaterialTable, vars(material))]


def _section_blocks(section: Section, names: Mapping[str, Material]) -> Iterator[list[str]]:
    inside = []
    if section.core is not None:
        inside.append(f"core = {_material_text(section.core, names)}")
    if repr(section.bore_ratio) != "0.0":
        inside.append(f"bore_ratio = {value_text(section.bore_ratio)}")
    if inside:
        yield ["[section]", *inside]
    for ring in section.rings:
        lines = _lines(RingTable, {**vars(ring), "material": None})
        made_of = _material_text(ring.material, names)
        yield ["[[rings]]", *lines, *([] if made_of == "{}" else [f"material = {made_of}"])]


def _material_text(material: Material, names: Mapping[str, Material]) -> str:
    """The name of a material that has a table, else its values."""
    if repr(names.get(material.name)) == repr(material):
        return value_text(material.name)
    pairs = list(_pairs(MaterialTable, vars(material)))
    return inline_table([("name", value_text(material.name)), *pairs] if material.name else pairs)


def _lines(table: type[Table], values: Mapping[str, Any]) -> list[str]:
    return [f"{key} = {text}" for key, text in _pairs(table, values)]


def _pairs(table: type[Table], values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys and texts of what is not the default."""
    keys = table.keys()
    order = {field: place for place, field in enumerate(_ORDER)}
    for field, key in sorted(keys.items(), key=lambda one: order.get(one[0], 0)):
        value, default = values.get(field), table.model_fields[field].default
        if value is not None and (field in _ALWAYS or not _is_default(value, default)):
            yield key, _text(key, value)


def _is_default(value: Any, default: Any) -> bool:
    plain = list(value) if isinstance(value, tuple) else value
    return repr(plain) == repr(default)


def _text(key: str, value: Any) -> str:
    number = degrees_text if key.endswith("_deg") else value_text
    return along_text(value, number) if isinstance(value, AlongArm) else number(value)
