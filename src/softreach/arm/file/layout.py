"""The tables of a design file of version 2, and where a key that is elsewhere belongs."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field

from softreach.arm.file.actuator_tables import ACTUATORS
from softreach.arm.file.along import AlongTable
from softreach.arm.file.body_tables import PROFILES, InlineMaterial, RingTable, SectionTable
from softreach.arm.file.load_table import LoadTable, PointLoadTable
from softreach.arm.file.table import Table

__all__ = ["Layout", "unknown_key"]

_TableOf = dict[str, Any]


class Layout(Table):
    """What stands at the top of a file; what is in the tables is read one by one."""

    version: Literal[2] = Field(description="Version of the format")
    profile: _TableOf = Field(description="Length and outer radius along the arm")
    materials: dict[str, _TableOf] = Field(
        default={}, description="Materials by name; others are looked up in the library"
    )
    section: _TableOf = Field(default={}, description="The inside of the arm")
    rings: Annotated[list[_TableOf], Field(min_length=1)] = Field(
        description="Layers that actuators live in"
    )
    actuators: list[_TableOf] = Field(
        description="What drives the arm, in the order of the activations; [] for a passive rod"
    )
    loads: _TableOf | None = Field(default=None, description="What acts on the arm beside them")


def unknown_key(table: type[Table], location: list[Any]) -> str:
    """What to say of a key that a table does not have.

    Args:
        table: The table.
        location: Where the key is, from there.
    """
    key = str(location[-1])
    if len(location) > 1:
        inside: dict[Any, type[Table]] = {
            "material": InlineMaterial,
            "core": InlineMaterial,
            "point_loads": PointLoadTable,
        }
        table = inside.get(location[0], AlongTable)
    elif table is Layout and (place := _place(key)):
        return f"unknown key; {place}"
    keys = table.keys()
    close = [keys[key]] if key in keys else difflib.get_close_matches(key, keys.values(), n=1)
    known = ", ".join(keys.values())
    return (
        f'unknown key; did you mean "{close[0]}"?' if close else f"unknown key; known keys: {known}"
    )


def _place(key: str) -> str:
    """Where a key belongs that is not one of the top."""
    if key.removesuffix("s") in ACTUATORS:
        return f'write [[actuators]] with kind = "{key.removesuffix("s")}"'
    homes: Mapping[str, type[Table]] = {
        "[profile]": PROFILES["linear"],
        "[section]": SectionTable,
        "[[rings]]": RingTable,
        "[materials.NAME]": InlineMaterial,
        "[loads]": LoadTable,
    }
    found = (home for home, table in homes.items() if key in table.keys().values())
    home = next(found, "")
    return f"it belongs in {home}" if home else ""
