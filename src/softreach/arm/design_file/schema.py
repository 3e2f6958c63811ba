"""A JSON schema of design files, from which editors complete and check them."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from softreach.arm.actuators import Actuator
from softreach.arm.along import Samples
from softreach.arm.base import POINTS
from softreach.arm.design_file.keys import KINDS, LAYOUT, TABLES, Block, Key, keys_of
from softreach.arm.material import Material
from softreach.arm.number import Number
from softreach.arm.profile import Profile
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
    required = [name for name, block in LAYOUT.items() if block.required]
    return {
        "$schema": "http://json-schema.org/draft-07/schema#",
        "title": "softreach design",
        "description": "An arm: lengths in m, angles in degrees, the unit in every key.",
        **_object({name: _block(name, block) for name, block in LAYOUT.items()}, required),
        "$defs": {
            **{name: _table(kind) for name, kind in TABLES.items()},
            "material": _table(Material, without=("name",)),
            "inline_material": _table(Material),
            **{n: _table(part, kind=n) for kinds in KINDS.values() for n, part in kinds.items()},
            "own_actuator": _own(Actuator, "kind"),
            "own_profile": _own(Profile, "kind", "length"),
        },
    }


def _block(name: str, block: Block) -> _Schema:
    about = {"description": block.about}
    unit = {"enum": [*UNITS], "description": "Unit of lengths; L is the arm's"}
    others: dict[str, _Schema] = {
        "version": {"const": 2},
        "materials": {"type": "object", "additionalProperties": _of("material")},
        "stations": {"type": "object", "additionalProperties": {"type": "number", "minimum": 0}},
        "point": _TEXT,
        "display": _object({"unit": unit}, []),
    }
    if name in others:
        return about | others[name]
    table = _of(name if block.shape is dict else name.removesuffix("s"))
    if block.kind in KINDS:
        own = f"own_{block.kind.__name__.lower()}"
        table = {"anyOf": [_of(kind) for kind in (*KINDS[block.kind], own)]}
    if block.shape is dict:
        return about | table if block.kind in KINDS else table
    least = {"minItems": 1} if name == "rings" else {}
    return about | {"type": "array", "items": table} | least


def _of(name: str) -> _Schema:
    return {"$ref": f"#/$defs/{name}"}


def _own(of: type, *required: str) -> _Schema:
    return {
        "description": f"{of.__name__} of a class of one's own: its fields, in SI units",
        "type": "object",
        "properties": {"kind": {**_TEXT, "not": {"enum": [*KINDS[of]]}}},
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


def _table(part: type, *, kind: str = "", without: tuple[str, ...] = ()) -> _Schema:
    keys = {name: key for name, key in keys_of(part).items() if name not in without}
    properties = {"kind": {"const": kind}} if kind else {}
    properties |= {name: _value(part, key) for name, key in keys.items()}
    required = ["kind"] if kind and kind != "linear" else []  # which is the default
    required += [name for name, key in keys.items() if key.required]
    about = (part.__doc__ or "").partition("\n")[0]
    return {"description": about, **_object(properties, required)}


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
    allowed = number.allowed.in_degrees() if number.unit == "rad" else number.allowed
    about: _Schema = {"description": f"{number.symbol}: {number.meaning} [{allowed.unit or '-'}]"}
    single: _Schema = {"type": "integer" if allowed.whole else "number"}
    if allowed.low > -math.inf:
        single["exclusiveMinimum" if allowed.open_low else "minimum"] = allowed.low
    if allowed.high < math.inf:
        single["exclusiveMaximum" if allowed.open_high else "maximum"] = allowed.high
    series: _Schema = {"type": "array", "items": single}
    shapes = {"triple": _TRIPLE, "stations": _NUMBERS, "series": series}
    if number.each:
        return about | {"anyOf": [single, series]}
    if number.shape in shapes or number.along is None:
        return about | shapes.get(number.shape, single)
    kinds = ["cubic", "linear", *(() if number.along is Samples else ("constant",))]
    properties = {
        "stations_over_length": _NUMBERS,
        "values": series,
        "interpolation": {"enum": kinds},
    }
    along = _object(properties, ["stations_over_length", "values"])
    if number.shape == "along":
        return about | along
    pair = [{**series, "minItems": 2, "maxItems": 2}] if number.pair else []
    return about | {"anyOf": [single, *pair, along]}
