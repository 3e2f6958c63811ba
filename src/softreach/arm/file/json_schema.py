"""A JSON schema of design files, from which editors complete and check them."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import ConfigDict, Field, WithJsonSchema
from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from softreach.arm.file.actuator_tables import (
    ACTUATORS,
    ChamberTable,
    FiberTable,
    ObliqueTable,
    RadialTable,
    TendonTable,
)
from softreach.arm.file.body_tables import (
    LinearTable,
    MaterialTable,
    PiecewiseTable,
    RingTable,
    SampledTable,
    SectionTable,
)
from softreach.arm.file.layout import Layout
from softreach.arm.file.load_table import LoadTable
from softreach.arm.file.table import Table

__all__ = ["json_schema"]


class OwnTable(Table):
    """An actuator of a class of one's own: its fields, in SI units."""

    model_config = ConfigDict(extra="allow")

    kind: Annotated[str, WithJsonSchema({"type": "string", "not": {"enum": [*ACTUATORS]}})]


class _Design(Layout):
    """An arm for softreach: lengths in m, angles in degrees, the unit in every key."""

    profile: LinearTable | PiecewiseTable | SampledTable  # pyright: ignore
    materials: dict[str, MaterialTable] = Field(default={})  # pyright: ignore
    section: SectionTable = SectionTable()  # pyright: ignore
    rings: Annotated[list[RingTable], Field(min_length=1)]  # pyright: ignore
    actuators: list[  # pyright: ignore
        FiberTable | ObliqueTable | RadialTable | TendonTable | ChamberTable | OwnTable
    ]
    loads: LoadTable | None = None  # pyright: ignore


class _WithoutNull(GenerateJsonSchema):
    """TOML has no null: what is optional is left out."""

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        """The schema of what is not null."""
        return self.generate_inner(schema["schema"])


def json_schema() -> dict[str, Any]:
    """The JSON schema (draft 7) of design files of version 2."""
    found = _Design.model_json_schema(schema_generator=_WithoutNull)
    about = {"$schema": "http://json-schema.org/draft-07/schema#", "title": "softreach design"}
    return {**about, **_tidy(found)}


def _tidy(schema: Any) -> Any:
    """Without titles, which repeat the keys, and defaults that are absence."""
    if isinstance(schema, list):
        return [_tidy(one) for one in schema]
    if not isinstance(schema, dict):
        return schema
    return {
        key: {name: _tidy(one) for name, one in value.items()} if key in _BY_NAME else _tidy(value)
        for key, value in schema.items()
        if not (key == "title" or (key == "default" and value in (None, {})))
    }


_BY_NAME = ("properties", "$defs")
"""Where keys are names and not words of the schema."""
