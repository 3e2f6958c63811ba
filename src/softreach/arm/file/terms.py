"""Faults under the names and in the units of design files."""

from __future__ import annotations

import math
from typing import Any

from softreach.arm.file.actuator_tables import ACTUATORS
from softreach.arm.file.body_tables import PROFILES, MaterialTable, RingTable, SectionTable
from softreach.arm.file.load_table import LoadTable
from softreach.support.errors import Fault, InvalidDesign, Range

__all__ = ["dotted", "in_file_terms", "in_keys", "pydantic_fault"]

_KEYS = {"inner_radius": "inner_radius_m"} | {
    field: key
    for table in (
        *PROFILES.values(),
        MaterialTable,
        RingTable,
        SectionTable,
        LoadTable,
        *ACTUATORS.values(),
    )
    for field, key in table.keys().items()
    if field != "activation_bounds"  # whose unit depends on the actuator
}

_ALLOWED = {
    "dict_type": "must be a table",
    "model_type": "must be a table",
    "list_type": "must be a list",
    "too_short": "must not be empty",
    "string_type": "must be text",
}
"""What to say of problems that pydantic tells in words of its own."""


def in_file_terms(error: InvalidDesign, source: str) -> InvalidDesign:
    """The same faults under the file's keys and in its units."""
    return InvalidDesign([in_keys(fault) for fault in error.faults], source)


def in_keys(fault: Fault, prefix: str = "") -> Fault:
    """The same fault under the file's key and in the file's unit.

    Args:
        fault: A fault of fields by their names in Python.
        prefix: What stands before them in the file.
    """
    names = ", ".join(prefix + _key(name) for name in fault.path.split(", "))
    if isinstance(fault.allowed, Range) and fault.allowed.unit == "rad":
        return Fault(names, _shown_degrees(fault.value), fault.allowed.in_degrees())
    value = _shown_degrees(fault.value) if names.endswith("_deg") else fault.value
    return Fault(names, value, fault.allowed)


def pydantic_fault(problem: Any) -> Fault:
    """What pydantic found in a table, but for unknown keys; the path begins in the table."""
    context, location = problem.get("ctx", {}), list(problem["loc"])
    if problem["type"] == "missing":
        return Fault(dotted(location), None, "required key is missing")
    if problem["type"] == "fault":
        below = [context["key"]] if "key" in context else []
        value = problem["input"]
        shown = value.get(context["key"]) if below and isinstance(value, dict) else value
        return Fault(dotted([*location, *below]), shown, context["allowed"])
    if context.get("min_length", 0) > 1 or "max_length" in context:
        return Fault(dotted(location), problem["input"], _length_allowed(context))
    if problem["type"] == "string_type" and location[-1:] == ["<plain>"]:
        allowed = "must be the name of a material, or a table of its values"
        return Fault(dotted(location), problem["input"], allowed)
    message = str(problem["msg"]).replace("Input should be", "must be")
    allowed = _ALLOWED.get(problem["type"], message)
    return Fault(dotted(location), problem["input"], allowed)


def _length_allowed(context: dict[str, Any]) -> str:
    """How long a list must be that is too short or too long."""
    if "min_length" in context:
        return f"must have at least {context['min_length']} values"
    return f"must have at most {context['max_length']} values"


def dotted(location: list[Any]) -> str:
    """A path such as `fibers[0].extent_deg`; the branches of unions are left out."""
    parts = [part for part in location if str(part) not in ("<plain>", "<table>")]
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts)
    return text.lstrip(".")


def _key(path: str) -> str:
    """The key of a field, behind the name of the part that it belongs to, if any."""
    owner, dot, field = path.rpartition(".")
    return owner + dot + _KEYS.get(field, field)


def _shown_degrees(value: object) -> object:
    if isinstance(value, tuple):
        return tuple(_shown_degrees(item) for item in value)
    return float(f"{math.degrees(value):.12g}") if isinstance(value, float) else value
