"""Actuators of kinds that are defined outside softreach: their fields as they are in Python."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

from pydantic import ValidationError

from softreach.arm.actuators import Actuator
from softreach.arm.actuators.actuator import actuator_kinds
from softreach.arm.along import AlongArm
from softreach.arm.file.along import AlongTable, along_text
from softreach.arm.file.degrees import Written
from softreach.arm.file.toml_text import value_text
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["made_own_kind", "own_kind_lines", "own_kinds"]


def own_kinds() -> dict[str, type[Actuator]]:
    """Kinds that are imported and not softreach's, by the names of their classes."""
    known = actuator_kinds().items()
    return {name: kind for name, kind in known if kind.__module__.partition(".")[0] != "softreach"}


def made_own_kind(kind: type[Actuator], table: Mapping[str, Any]) -> Actuator:
    """An actuator from its fields, in SI units.

    Raises:
        InvalidDesign: Fields that it does not have or that are wrong.
    """
    values = {key: _plain(value) for key, value in table.items() if key != "kind"}
    try:
        return kind(**values)
    except TypeError as error:
        raise InvalidDesign([Fault("", kind.__name__, f"has other fields: {error}")]) from None


def own_kind_lines(actuator: Actuator) -> Iterator[str]:
    """The kind of an actuator and its fields.

    Raises:
        InvalidDesign: A field that is not made of plain values.
    """
    yield f"kind = {value_text(type(actuator).__name__)}"
    for name in (field.name for field in fields(actuator)):  # pyright: ignore[reportArgumentType]
        if (value := getattr(actuator, name)) is not None:
            yield f"{name} = {_text(actuator, name, value)}"


def _text(actuator: Actuator, name: str, value: Any) -> str:
    if isinstance(value, AlongArm):
        return along_text(value)
    try:
        return value_text(value)
    except (TypeError, ValueError):
        kind = type(actuator).__name__
        allowed = "must be a number, text or a sequence of these to fit in a design file"
        raise InvalidDesign([Fault(f"{kind}.{name}", value, allowed)]) from None


def _plain(value: Any) -> Any:
    """Lists as tuples, and what is given along the arm as a function."""
    if isinstance(value, dict):
        try:
            return AlongTable.model_validate(value).value()
        except ValidationError:
            return value
    if isinstance(value, list):
        return tuple(_plain(item) for item in value)
    return float(value) if isinstance(value, Written) else value
