"""Parts of an arm: frozen values whose numbers are checked when they are made."""

from __future__ import annotations

import dataclasses
from typing import Any, Self, dataclass_transform

from softreach.arm.number import fields_of, number, stations
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["Part"]


@dataclass_transform(
    frozen_default=True,
    kw_only_default=True,
    field_specifiers=(number, stations, dataclasses.field),
)
class Part:
    """Base of all parts of an arm, which are frozen dataclasses.

    Raises:
        InvalidDesign: A field is not what it must be; the error names every fault.
    """

    def __post_init__(self) -> None:
        if faults := self._faults():
            raise InvalidDesign(faults)
        for declared in fields_of(type(self)).values():
            object.__setattr__(self, declared.field, declared.normal(getattr(self, declared.field)))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed, checked like a new one."""
        return dataclasses.replace(self, **changes)  # pyright: ignore[reportArgumentType]

    def _faults(self) -> list[Fault]:
        """Everything wrong with its fields; kinds add their own."""
        numbers = fields_of(type(self)).values()
        faults = [
            fault for number in numbers for fault in number.faults(getattr(self, number.field))
        ]
        name = getattr(self, "name", "")
        return faults if isinstance(name, str) else [*faults, Fault("name", name, "must be text")]
