"""Numbers of design files: their ranges and units, as pydantic checks and a JSON schema tells them.

A key and its unit are the alias of a field; what validation returns is in SI units.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any

from pydantic import GetCoreSchemaHandler, GetJsonSchemaHandler, PlainValidator, WithJsonSchema
from pydantic_core import CoreSchema, PydanticCustomError, core_schema

from softreach.arm.actuator_checks import bounds_faults, which_ring_faults
from softreach.arm.file.degrees import radians
from softreach.arm.variable import Variable
from softreach.support.errors import Fault, Range

__all__ = ["Bounds", "Quantity", "RingName", "refused"]


@dataclass(frozen=True)
class Quantity:
    """Metadata of a number: what is allowed, in SI units; angles are in degrees in the file."""

    allowed: Range
    meaning: str = ""

    @classmethod
    def of(cls, kind: Any, field: str, allowed: Range | None = None) -> Quantity:
        """That of a variable of a kind of profile, section, material or actuator."""
        found: Variable = next(one for one in kind.variables if one.field == field)
        allowed = found.allowed if allowed is None else allowed
        unit = {"rad": "deg", "": "-"}.get(allowed.unit, allowed.unit)
        return cls(allowed, f"{found.symbol}: {found.meaning} [{unit}]")

    @property
    def shown(self) -> Range:
        """What is allowed, in the unit of the file."""
        return self.allowed.in_degrees() if self.allowed.unit == "rad" else self.allowed

    def __get_pydantic_core_schema__(
        self, source: Any, handler: GetCoreSchemaHandler
    ) -> CoreSchema:
        """The type of the number, then its range."""
        return core_schema.no_info_wrap_validator_function(self._checked, handler(source))

    def __get_pydantic_json_schema__(
        self, schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """The type of the number and its limits."""
        json = {**handler(schema), **_limits(self.shown)}
        return {**json, "description": self.meaning} if self.meaning else json

    def _checked(self, value: Any, handler: Any) -> float:
        number = handler(value)
        if self.allowed.unit == "rad":
            number = radians(value)
        if not self.allowed.admits(number):
            raise PydanticCustomError("fault", "out of range", {"allowed": self.shown})
        return float(number) if isinstance(number, float) else number


def refused(fault: Fault) -> PydanticCustomError:
    """A fault as pydantic collects it; its path is a key below the place where it is found."""
    context = {"key": fault.path, "allowed": fault.allowed}
    return PydanticCustomError("fault", "is refused", context)


def _limits(allowed: Range) -> dict[str, float]:
    low = "exclusiveMinimum" if allowed.open_low else "minimum"
    high = "exclusiveMaximum" if allowed.open_high else "maximum"
    return {
        key: end for key, end in ((low, allowed.low), (high, allowed.high)) if abs(end) < math.inf
    }


def _bounds(value: Any) -> Any:
    if faults := bounds_faults(value, None):
        raise PydanticCustomError("fault", "is refused", {"allowed": faults[0].allowed})
    return value


def _ring_name(value: Any) -> Any:
    if faults := which_ring_faults(value):
        raise PydanticCustomError("fault", "is refused", {"allowed": faults[0].allowed})
    return value


_PAIR = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}

Bounds = Annotated[
    Any,
    PlainValidator(_bounds),
    WithJsonSchema({"anyOf": [_PAIR, {"type": "array", "items": _PAIR, "minItems": 1}]}),
]
"""(lower, upper) for all bundles, or one such pair for each."""

RingName = Annotated[
    Any, PlainValidator(_ring_name), WithJsonSchema({"type": ["integer", "string"]})
]
"""Index or name of a ring."""
