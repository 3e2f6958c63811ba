"""The text of a design file, every number such that it reads back to the same one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from functools import cache
from typing import Any

from softreach.arm.along import AlongArm, Samples
from softreach.arm.design_file.keys import KINDS, Key, degrees_text, keys_of
from softreach.arm.material import Material
from softreach.arm.number import NamedFloats, Station
from softreach.arm.part import Part
from softreach.arm.section import Section
from softreach.support.errors import Fault, InvalidDesign
from softreach.support.files.toml import inline_table, key_text, value_text

_NAMES = {kind: name for kinds in KINDS.values() for name, kind in kinds.items()}
_ALWAYS = {"activation_bounds", "gravity", "offset", "taper"}
"""Fields that are written even where they are the default, for people to change."""

_ORDER = (
    *("name", "unit", "ring", "length", "revolution"),
    "",  # what distinguishes a kind
    *("taper", "offset", "extent", "bundles", "activation_bounds"),
    *("start_over_length", "end_over_length", "start", "end"),
)
"""Order of fields."""


def render(arm: Mapping[str, Any]) -> str:
    """TOML text of a design, of version 2; raises InvalidDesign where a part is no plain values."""
    section, stations, loads = arm["section"], arm["stations"], arm["loads"]
    names: dict[str, Material] = {}
    for material in (section.core, *(ring.material for ring in section.rings)):
        if material is not None and material.name:
            names.setdefault(material.name, material)
    point = [] if arm["point"] is None else [f"point = {value_text(arm['point'])}"]
    top = ["version = 2", *point, *([] if arm["actuators"] else ["actuators = []"])]
    blocks = [top, ["[profile]", *_lines(arm["profile"])]]
    for name, material in names.items():
        blocks.append([f"[materials.{key_text(name)}]", *_lines(material, without=("name",))])
    blocks += _section_blocks(section, names)
    if stations:
        places = (f"{key_text(name)} = {value_text(z)}" for name, z in stations.items())
        blocks.append(["[stations]", *places])
    for several in ("actuators", "rigid_pieces", "drives", "markers"):
        blocks += [[f"[[{several}]]", *_lines(part)] for part in arm[several]]
    if loads is not None:
        blocks.append(["[loads]", *_lines(loads)])
        blocks += [["[[loads.point_loads]]", *_lines(load)] for load in loads.point_loads]
    if not arm["base"].is_identity:
        blocks.append(["[base]", *_lines(arm["base"])])
    if not arm["rest"].is_straight:
        blocks.append(["[rest]", *_lines(arm["rest"])])
    return "\n\n".join("\n".join(block) for block in blocks) + "\n"


def display_text(unit: str | None) -> str:
    """Text that follows a design in a file which says in what unit to show it."""
    return "" if unit is None else f"\n[display]\nunit = {value_text(unit)}\n"


def _lines(part: Part, without: tuple[str, ...] = ("point_loads",)) -> list[str]:
    """What a table says; of a class outside softreach the fields as they are in Python."""
    if not isinstance(part, tuple(KINDS)):
        return [f"{key} = {text}" for key, text in _pairs(part, without)]
    kind = _NAMES.get(type(part), type(part).__name__)
    pairs = _pairs(part) if type(part) in _NAMES else _plain_pairs(part)
    return [f"kind = {value_text(kind)}", *(f"{key} = {text}" for key, text in pairs)]


def _plain_pairs(part: Part) -> Iterator[tuple[str, str]]:
    for field in fields(part):  # pyright: ignore[reportArgumentType]
        value = getattr(part, field.name) if field.init else None
        value = value.name if isinstance(value, Station) else value
        try:
            if value is not None:
                yield field.name, _text("", value)
        except (TypeError, ValueError):
            allowed = "must be a number, text or a sequence of these to fit in a design file"
            path = f"{type(part).__name__}.{field.name}"
            raise InvalidDesign([Fault(path, value, allowed)]) from None


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


def _pairs(part: Part, without: tuple[str, ...] = ()) -> Iterator[tuple[str, str]]:
    """Keys and texts of what is not the default."""
    for key in _ordered_keys(type(part)):
        value = getattr(part, key.field)
        if key.field in without or value is None or key.of_names != isinstance(value, Station):
            continue
        if key.field in _ALWAYS or repr(value) != repr(key.default):
            yield key.name, _text(key.name, value)


@cache
def _ordered_keys(kind: type) -> list[Key]:
    keys = keys_of(kind).values()
    return sorted(keys, key=lambda key: _ORDER.index(key.field if key.field in _ORDER else ""))


def _text(key: str, value: Any) -> str:
    if isinstance(value, NamedFloats):
        return inline_table((key_text(name), value_text(x)) for name, x in value.items())
    number = degrees_text if key.endswith("_deg") else value_text
    if isinstance(value, AlongArm):
        kind = value.interpolation if isinstance(value, Samples) else "constant"
        pairs = [
            ("stations_over_length", value_text(value.stations_over_length)),
            ("values", f"[{', '.join(map(number, value.values))}]"),
            ("interpolation", value_text(kind)),
        ]
        return inline_table(pairs[: 2 if kind == "cubic" else 3])
    if isinstance(value, tuple):
        return f"[{', '.join(map(number, value))}]"
    return value_text(value.name) if isinstance(value, Station) else number(value)
