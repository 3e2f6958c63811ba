"""Design files: keys with their units, kinds of tables, and designs as their text.

Lengths are in meters, angles in degrees, and every key ends with its unit. A number is written such
that it reads back to the same one.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import MISSING, fields
from decimal import Decimal
from functools import cache
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

from softreach.arm.actuators import (
    Actuator,
    Chamber,
    FiberArchitecture,
    LengthTendon,
    ObliqueMuscle,
    RadialMuscle,
    Tendon,
)
from softreach.arm.base import Base
from softreach.arm.body import RestShape
from softreach.arm.drives import Drive
from softreach.arm.loads import Loads, PointLoad
from softreach.arm.number import NamedFloats, Number, Station, fields_of, unit_suffix
from softreach.arm.obstacles import Obstacle
from softreach.arm.part import AlongArm, Part, Samples
from softreach.arm.profile import LinearTaper, PiecewiseTaper, Profile, SampledTaper
from softreach.arm.section import Material, Measured, Ring, Section
from softreach.arm.stations import Marker, RigidPiece, Stations
from softreach.geometry.region_tables import region_line
from softreach.support.errors import Fault, InvalidDesign, Range
from softreach.support.files.formats import FileFormat, Formats
from softreach.support.files.toml import inline_table, key_text, value_text

DESIGN_FILE: Formats = {".toml": FileFormat()}  # Format that a design is saved in

Kind = TypeVar("Kind", bound=Part)  # Actuators or profiles

KINDS: Mapping[type, Mapping[str, type]] = {
    Actuator: {
        "fiber": FiberArchitecture,
        "oblique_muscle": ObliqueMuscle,
        "radial_muscle": RadialMuscle,
        "tendon": Tendon,
        "length_tendon": LengthTendon,
        "chamber": Chamber,
    },
    Profile: {"linear": LinearTaper, "piecewise": PiecewiseTaper, "sampled": SampledTaper},
}
"""Kinds of actuators and of profiles by the words that files have for them."""

TABLES: Mapping[str, type] = {
    "material": Material,
    "ring": Ring,
    "measured": Measured,
    "section": Section,
    "loads": Loads,
    "point_load": PointLoad,
    "base": Base,
    "rest": RestShape,
    "rigid_piece": RigidPiece,
    "marker": Marker,
    "drive": Drive,
    "surrounding": Obstacle,
}
"""Other parts that tables describe."""

_PI = Decimal("3.14159265358979323846264338327950288420")
_LONG = 17  # digits from which a number of degrees is read exactly


class Block(NamedTuple):
    """What a file says under a key at its top."""

    shape: type  # One table, a list of tables, text or a number
    kind: Any  # Kind of part that a table describes; None for none
    required: bool = False


LAYOUT: Mapping[str, Block] = {
    "version": Block(int, None, required=True),
    "profile": Block(dict, Profile, required=True),
    "materials": Block(dict, Material),
    "section": Block(dict, Section),
    "rings": Block(list, Ring, required=True),
    "stations": Block(dict, Stations),
    "actuators": Block(list, Actuator, required=True),
    "rigid_pieces": Block(list, RigidPiece),
    "drives": Block(list, Drive),
    "markers": Block(list, Marker),
    "surroundings": Block(list, Obstacle),
    "loads": Block(dict, Loads),
    "base": Block(dict, Base),
    "rest": Block(dict, RestShape),
    "point": Block(str, None),
    "display": Block(dict, None),
}
"""Keys at the top of a file."""


class Key(NamedTuple):
    """A key of a table."""

    name: str  # As the file has it: `offset_deg`
    field: str  # Field of the part
    number: Number | None  # None for names, bounds, materials, and lists of tables
    default: Any  # Default of the field; MISSING where the key is required
    of_names: bool = False  # It holds the name of a station, another key its place in m

    @property
    def required(self) -> bool:
        """A table without it is refused."""
        return self.default is MISSING


@cache
def keys_of(kind: type) -> Mapping[str, Key]:
    """Keys of the table of a kind of part by their names; other tables of their own are no keys."""
    numbers = fields_of(kind)
    keys: list[Key] = []
    for field in fields(kind):
        number = numbers.get(field.name)
        name = number.key if number else field.name
        if field.name == "activation_bounds":
            name = f"{kind.activation}_bounds{unit_suffix(kind.unit)}"
        default = field.default if field.default_factory is MISSING else None
        if number is not None and number.named:  # text has no unit
            keys.append(Key(field.name, field.name, None, default, of_names=True))
        if (kind, field.name) not in {(Section, "rings"), (Obstacle, "region")}:
            keys.append(Key(name, field.name, number, default))
    return MappingProxyType({key.name: key for key in keys})


def field_keys(kind: type) -> dict[str, str]:
    """Field -> key."""
    return {key.field: name for name, key in keys_of(kind).items()}


def own_kinds(of: type[Kind]) -> dict[str, type[Kind]]:
    """Imported kinds of actuators or profiles that are not softreach's, by their classes' names."""
    kinds = of.__subclasses__()
    for kind in kinds:  # which grows
        kinds += kind.__subclasses__()
    return {
        kind.__name__: kind
        for kind in kinds
        if kind.__module__.partition(".")[0] != "softreach"
        and not getattr(kind, "__abstractmethods__", ())
    }


@cache
def _every_key() -> Mapping[str, str]:
    """Field -> key of all parts, but for bounds, whose unit depends on the actuator."""
    kinds = (*KINDS[Profile].values(), *TABLES.values(), *KINDS[Actuator].values())
    keys = {field: key for kind in kinds for field, key in field_keys(kind).items()}
    return MappingProxyType({**keys, "inner_radius": "inner_radius_m", "activation_bounds": ""})


class Place(NamedTuple):
    """Where in a file a part stands."""

    path: str  # `actuators[0]`
    keys: Mapping[str, str] = MappingProxyType({})  # Field -> key of its table, where they differ
    table: Mapping[str, Any] = MappingProxyType({})  # What the file says there


def in_file_terms(
    error: InvalidDesign, source: str = "", places: Mapping[str, Place] = MappingProxyType({})
) -> InvalidDesign:
    """The same faults under the keys of a file and in its units.

    `places` are those of the parts in the file; without them only the field at the end is renamed.
    """
    faults = [_in_file_terms(fault, places) for fault in error.faults]
    return InvalidDesign(one_a_path(faults), source)


def one_a_path(faults: Iterable[Fault]) -> list[Fault]:
    """The first fault of each path."""
    first: dict[str, Fault] = {}
    for fault in faults:
        first.setdefault(fault.path, fault)
    return [*first.values()]


def _in_file_terms(fault: Fault, places: Mapping[str, Place]) -> Fault:
    written = [_written(path, places) for path in fault.path.split(", ")]
    names, values = [name for name, _ in written], [value for _, value in written]
    allowed, value = fault.allowed, fault.value
    if isinstance(allowed, Range) and allowed.unit == "rad":
        allowed = allowed.in_degrees()
    if any(given is not MISSING for given in values):
        values = [None if given is MISSING else given for given in values]
        value = values[0] if len(values) == 1 else tuple(values)
    elif allowed != fault.allowed or names[0].endswith("_deg"):
        value = _shown_degrees(value)
    if isinstance(allowed, str) and places:  # which calls other fields by their names
        said = [path.rpartition(".")[2] for path in fault.path.split(", ")]
        keys = _every_key()
        others = {field: keys[field] for field in keys if "_" in field or field in said}
        allowed = re.sub(r"\w+", lambda word: others.get(word[0]) or word[0], allowed)
        allowed = re.sub("(Samples|AlongArm) along the arm(, or None)?", "a table", allowed)
    return Fault(", ".join(names), value, allowed)


def _written(path: str, places: Mapping[str, Place]) -> tuple[str, Any]:
    """The path in a file of the path of a field, or of an element of one, and what is there."""
    owners = [owner for owner in places if not owner or f"{path}.".startswith(f"{owner}.")]
    if not owners:
        head, dot, field = path.rpartition(".")
        return head + dot + (_every_key().get(field) or field), MISSING
    place = places[max(owners, key=len)]
    inside = path[len(max(owners, key=len)) :].lstrip(".")
    field = re.match(r"\w*", inside)[0]  # pyright: ignore[reportOptionalSubscript]
    rest = inside.removeprefix(field)
    key = field if field in place.table else place.keys.get(field, field)
    value = MISSING if rest else place.table.get(key, MISSING)
    return f"{place.path}.{key}{rest}".rstrip("."), value


def _shown_degrees(value: object) -> object:
    if isinstance(value, tuple):
        return tuple(_shown_degrees(item) for item in value)
    return float(f"{math.degrees(value):.12g}") if isinstance(value, float) else value


class WrittenFloat(float):
    """A number that remembers how it was written, so that degrees convert without a lost digit."""

    def __new__(cls, text: str) -> WrittenFloat:
        number = super().__new__(cls, text)
        number.text = text
        return number

    text: str


def radians(degrees: Any) -> float:
    """Degrees as `math.radians` has them, those of many digits by exact decimals."""
    text = degrees if isinstance(degrees, str) else getattr(degrees, "text", repr(degrees))
    text = text.replace("_", "")
    digits = text.lower().partition("e")[0].lstrip("+-0.").replace(".", "")
    short = len(digits) < _LONG and math.isfinite(float(text))
    if short or not Decimal(text).is_finite():
        return math.radians(float(text))
    return float(Decimal(text) * _PI / 180)


def degrees_text(angle: float) -> str:
    """The shortest number of degrees that converts to exactly this angle [rad]."""
    if angle == 0:
        return repr(float(angle))
    degrees = Decimal(angle) * 180 / _PI
    for digits in range(1, 26):
        text = f"{degrees:.{digits}g}"
        if -6 < Decimal(text).adjusted() < 16:
            text = f"{Decimal(text):f}"
        if radians(text) == angle:
            return text if "." in text or "e" in text else f"{text}.0"
    return repr(math.degrees(angle))


_NAMES: Mapping[type, str] = {
    kind: name for kinds in KINDS.values() for name, kind in kinds.items()
}
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
    for each in arm["surroundings"]:
        blocks.append(["[[surroundings]]", region_line(each.region), *_lines(each)])
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
