"""A JSON schema of design files, from which editors complete and check them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from softreach.arm.actuators import Actuator
from softreach.arm.along import Samples
from softreach.arm.base import POINTS
from softreach.arm.design_file.keys import (
    ACTUATORS,
    KINDS,
    LAYOUT,
    PROFILES,
    Block,
    Key,
    in_file_units,
    keys_of,
)
from softreach.arm.drives import Drive
from softreach.arm.loads import PointLoad
from softreach.arm.material import Material
from softreach.arm.number import Number
from softreach.arm.section import Measured, Ring
from softreach.arm.stations import Marker, RigidPiece
from softreach.support.errors import Range
from softreach.support.units import UNITS

_Schema = dict[str, Any]

_NUMBERS: _Schema = {"type": "array", "items": {"type": "number"}}
_PAIR: _Schema = {**_NUMBERS, "minItems": 2, "maxItems": 2}
_PAIRS: _Schema = {"type": "array", "items": _PAIR, "minItems": 1}
_TRIPLE: _Schema = {**_NUMBERS, "minItems": 3, "maxItems": 3}
_ROTATION: _Schema = {"type": "array", "items": _TRIPLE, "minItems": 3, "maxItems": 3}
_BY_NAME: _Schema = {"type": "object", "additionalProperties": {"type": "number"}}
_TEXT: _Schema = {"type": "string"}


def json_schema() -> dict[str, Any]:
    """The JSON schema (draft 7) of design files of version 2."""
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "softreach design",
        "description": "An arm: lengths in m, angles in degrees, the unit in every key.",
        **_object(
            {name: _block(name, block) for name, block in LAYOUT.items()},
            [name for name, block in LAYOUT.items() if block.required],
        ),
        "$defs": _definitions(),
    }


def _definitions() -> dict[str, _Schema]:
    definitions = {
        "material": _table(Material, "Isotropic elastic material", without=("name",)),
        "inline_material": _table(Material, "Material where it is used"),
        "ring": _table(Ring, "Layer between two radii"),
        "measured": _table(Measured, "What was measured, in place of what follows from materials"),
        "drive": _table(Drive, "Input that activates bundles"),
        "point_load": _table(PointLoad, "Force and moment on one section"),
        "rigid_piece": _table(RigidPiece, "Stretch that neither bends nor changes its length"),
        "marker": _table(Marker, "Point that goes with a section; it changes nothing"),
        "own_actuator": _own("Actuator", ACTUATORS, "kind"),
        "own_profile": _own("Profile", PROFILES, "kind", "length"),
    }
    definitions |= {
        name: _table(LAYOUT[name].kind, LAYOUT[name].about)
        for name in ("section", "loads", "base", "rest")
    }
    return definitions | {
        name: _table(kind, kind.__doc__ or "", kind=name)
        for name, kind in {**PROFILES, **ACTUATORS}.items()
    }


def _block(name: str, block: Block) -> _Schema:
    about = {"description": block.about}
    unit = {"enum": [*UNITS], "description": "Unit of lengths; L is the arm's"}
    others: dict[str, _Schema] = {
        "version": {"const": 2},
        "materials": {"type": "object", "additionalProperties": _of("material")},
        "stations": {
            "type": "object",
            "additionalProperties": {"type": "number", "minimum": 0},
        },
        "point": _TEXT,
        "display": _object({"unit": unit}, []),
    }
    if name in others:
        return about | others[name]
    one = _of(name if block.shape is dict else name.removesuffix("s"))
    if block.kind in KINDS:
        own = f"own_{block.kind.__name__.lower()}"
        one = {"anyOf": [_of(kind) for kind in (*KINDS[block.kind], own)]}
    if block.shape is dict:
        return about | one if block.kind in KINDS else one
    least = {"minItems": 1} if name == "rings" else {}
    return about | {"type": "array", "items": one} | least


def _of(name: str) -> _Schema:
    return {"$ref": f"#/$defs/{name}"}


def _own(part: str, kinds: Mapping[str, type], *required: str) -> _Schema:
    return {
        "description": f"{part} of a class of one's own: its fields, in SI units",
        "type": "object",
        "properties": {"kind": {**_TEXT, "not": {"enum": [*kinds]}}},
        "required": [*required],
        "additionalProperties": True,
    }


def _object(properties: Mapping[str, _Schema], required: list[str]) -> _Schema:
    return {
        "type": "object",
        "properties": dict(properties),
        "required": required,
        "additionalProperties": False,
    }


def _table(
    part: type, description: str, *, kind: str = "", without: tuple[str, ...] = ()
) -> _Schema:
    keys = {name: key for name, key in keys_of(part).items() if name not in without}
    properties = {"kind": {"const": kind}} if kind else {}
    properties |= {name: _value(part, key) for name, key in keys.items()}
    required = [name for name, key in keys.items() if key.required]
    if kind and kind != "linear":  # which is the default
        required.insert(0, "kind")
    table = _object(properties, required)
    return {"description": description.partition("\n")[0], **table}


def _value(part: type, key: Key) -> _Schema:
    if key.of_names:
        return {**_TEXT, "description": f"Name of a station, in place of {key.field}_m"}
    if key.number is not None:
        return _number(key.number)
    if key.field == "activation_bounds":
        assert issubclass(part, Actuator)
        unit = "-" if part.unit == "1" else part.unit
        about = f"{part.activation.capitalize()} [{unit}]: (lower, upper) for all bundles, or one"
        return {"description": f"{about} such pair for each", "anyOf": [_PAIR, _PAIRS]}
    others: dict[str, _Schema] = {
        "ring": {"type": ["integer", "string"], "description": "Index or name of its ring"},
        "material": {"anyOf": [_TEXT, _of("inline_material")]},
        "measured": _of("measured"),
        "core": {"anyOf": [_TEXT, _of("inline_material")]},
        "points": {
            "description": "The way the straight arm points, or a rotation",
            "anyOf": [{"enum": [*POINTS]}, _ROTATION, {**_NUMBERS, "minItems": 3, "maxItems": 4}],
        },
        "bounds": _PAIR,
        "gains": _BY_NAME,
        "offsets": _BY_NAME,
        "point_loads": {"type": "array", "items": _of("point_load")},
    }
    return others.get(key.field, _TEXT)


def _number(number: Number) -> _Schema:
    allowed = in_file_units(number.allowed)
    assert isinstance(allowed, Range)
    about = {"description": f"{number.symbol}: {number.meaning} [{allowed.unit or '-'}]"}
    single = {"type": "integer" if allowed.whole else "number", **_limits(allowed)}
    if number.shape == "triple":
        return {**about, **_TRIPLE}
    if number.shape == "stations":
        return {**about, **_NUMBERS}
    if number.shape == "series":
        return {**about, "type": "array", "items": single}
    if number.along is None:
        return {**about, **single}
    kinds = ["cubic", "linear", *(() if number.along is Samples else ("constant",))]
    properties = {
        "stations_over_length": _NUMBERS,
        "values": {"type": "array", "items": single},
        "interpolation": {"enum": kinds},
    }
    along = _object(properties, ["stations_over_length", "values"])
    if number.shape == "along":
        return {**about, **along}
    pair = [{"type": "array", "items": single, "minItems": 2, "maxItems": 2}] if number.pair else []
    return {**about, "anyOf": [single, *pair, along]}


def _limits(allowed: Range) -> dict[str, float]:
    low = "exclusiveMinimum" if allowed.open_low else "minimum"
    high = "exclusiveMaximum" if allowed.open_high else "maximum"
    ends = ((low, allowed.low), (high, allowed.high))
    return {word: end for word, end in ends if abs(end) < math.inf}
