"""The JSON schema of design files accepts what the reader accepts, and names wrong keys."""

from __future__ import annotations

import operator
import tomllib
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given

from softreach.arm.design_file.schema import json_schema
from tests.arm.drawn_arms import any_arms
from tests.arm.test_design_file import BODY, FIBER, FILES
from tests.arm.test_design_file_faults import BAD_FILE

SCHEMA = json_schema()

TYPES = {
    "object": dict,
    "array": list,
    "string": str,
    "number": (int, float),
    "integer": int,
}
SAYS_NOTHING = {"$schema", "$defs", "title", "description", "default", "examples"}


def accepts(schema: Any, value: Any) -> bool:
    """A JSON schema validator for the words that the schema uses; others are a KeyError."""
    return all(WORDS[word](schema, value) for word in schema if word not in SAYS_NOTHING)


def _has_type(schema: Any, value: Any) -> bool:
    names = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    return not isinstance(value, bool) and any(isinstance(value, TYPES[name]) for name in names)


def _properties(schema: Any, value: Any) -> bool:
    known = schema["properties"]
    return all(accepts(known[key], one) for key, one in value.items() if key in known)


def _additional(schema: Any, value: Any) -> bool:
    others = {key: one for key, one in value.items() if key not in schema.get("properties", {})}
    rule = schema["additionalProperties"]
    if isinstance(rule, bool):
        return rule or not others
    return all(accepts(rule, one) for one in others.values())


def _target(schema: Any) -> Any:
    name = schema["$ref"].removeprefix("#/$defs/")
    return SCHEMA["$defs"][name]


def _limit(word: str, holds: Any) -> Any:
    return lambda schema, value: not isinstance(value, int | float) or holds(value, schema[word])


WORDS = {
    "type": _has_type,
    "properties": lambda schema, value: not isinstance(value, dict) or _properties(schema, value),
    "additionalProperties": lambda schema, value: (
        not isinstance(value, dict) or _additional(schema, value)
    ),
    "required": lambda schema, value: (
        not isinstance(value, dict) or set(schema["required"]) <= value.keys()
    ),
    "items": lambda schema, value: (
        not isinstance(value, list) or all(accepts(schema["items"], one) for one in value)
    ),
    "minItems": lambda schema, value: (
        not isinstance(value, list) or len(value) >= schema["minItems"]
    ),
    "maxItems": lambda schema, value: (
        not isinstance(value, list) or len(value) <= schema["maxItems"]
    ),
    "minimum": _limit("minimum", operator.ge),
    "maximum": _limit("maximum", operator.le),
    "exclusiveMinimum": _limit("exclusiveMinimum", operator.gt),
    "exclusiveMaximum": _limit("exclusiveMaximum", operator.lt),
    "anyOf": lambda schema, value: any(accepts(one, value) for one in schema["anyOf"]),
    "oneOf": lambda schema, value: sum(accepts(one, value) for one in schema["oneOf"]) == 1,
    "allOf": lambda schema, value: all(accepts(one, value) for one in schema["allOf"]),
    "not": lambda schema, value: not accepts(schema["not"], value),
    "const": lambda schema, value: value == schema["const"],
    "enum": lambda schema, value: value in schema["enum"],
    "$ref": lambda schema, value: accepts(_target(schema), value),
}


@given(arm=any_arms())
def test_the_schema_accepts_every_saved_design(arm):
    assert accepts(SCHEMA, tomllib.loads(arm.to_toml()))


@pytest.mark.parametrize("path", sorted(FILES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_schema_accepts_the_designs_of_the_repository(path: Path):
    assert accepts(SCHEMA, tomllib.loads(path.read_text(encoding="utf-8")))


def test_the_schema_accepts_a_short_file():
    assert accepts(SCHEMA, tomllib.loads(BODY + FIBER))


@pytest.mark.parametrize(
    ("good", "bad"),
    [
        ("extent_deg", "extent"),
        ("20.0", "400.0"),
        ("20.0", "'wide'"),
        ("10.0", "-90"),
        ("inner_ratio = 0.5", "inner_ratio = 1.0"),
        ("inner_ratio = 0.5", ""),
        ("version = 2", ""),
        ("version = 2", "version = 3"),
        ("version = 2", "version = 2\nlength_m = 1.0"),
        ("outer_radius_m", "radii_m"),
        ("length_m = 1.0", "length_m = 0.0"),
        ("length_m", "kind = 'round', length_m"),
        ('"fiber"', '"tendon"'),
        ("10.0", "{ stations_over_length = [0, 1], value = [1, 2] }"),
        ("10.0", "{ stations_over_length = [0, 1], values = [1, 92] }"),
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(good, bad):
    assert good in BODY + FIBER
    assert not accepts(SCHEMA, tomllib.loads((BODY + FIBER).replace(good, bad, 1)))


def test_the_schema_refuses_a_file_full_of_faults():
    assert not accepts(SCHEMA, tomllib.loads(BAD_FILE))


def test_every_key_that_has_a_unit_says_what_it_is():
    tables = SCHEMA["$defs"].values()
    keys = {
        (key, one.get("description"))
        for table in tables
        for key, one in table["properties"].items()
    }
    units = ("_m", "_deg", "_pa", "_n", "_kg_m3")
    assert [key for key, meaning in keys if key.endswith(units) and not meaning] == []
