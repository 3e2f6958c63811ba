"""One table of a design file at a time: what it describes, and all that is wrong with it."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, TypeVar

from pydantic import ValidationError

from softreach.arm.file.layout import unknown_key
from softreach.arm.file.table import Table
from softreach.arm.file.terms import dotted, pydantic_fault
from softreach.support.errors import Fault, InvalidDesign, Range

__all__ = ["TableReader"]

AnyTable = TypeVar("AnyTable", bound=Table)
Made = TypeVar("Made")

_RESTS_ON = {
    "activation_bounds": {"bundles"},
    "end_over_length": {"start_over_length"},
    "inner_ratio": {"outer_ratio"},
    "radii": {"stations_over_length"},
    "taper": {"length", "outer_radius"},
}
"""Fields -> others that decide whether they are right."""


class TableReader:
    """Reads tables and keeps their faults."""

    def __init__(self) -> None:
        """Begin without a fault."""
        self.faults: list[Fault] = []

    def read(
        self, table: type[AnyTable], raw: Any, path: str, make: Callable[[AnyTable], Made]
    ) -> Made | None:
        """What a table describes; None where it has faults, which are kept.

        Args:
            table: Its keys.
            raw: What the file holds.
            path: Where that is.
            make: From the checked table to what it describes.
        """
        checked, blamed = self.checked(table, raw, path)
        if checked is None:
            return None
        try:
            made = make(checked)
        except InvalidDesign as error:
            keys = table.keys()
            right = (one for one in error.faults if not _doubtful(one, blamed))
            self.faults += [_in_keys(fault, keys, raw, path) for fault in right]
            return None
        return None if blamed else made

    def checked(
        self, table: type[AnyTable], raw: Any, path: str
    ) -> tuple[AnyTable | None, set[str]]:
        """The table, with examples in place of what is wrong, and the fields that are wrong."""
        try:
            return table.model_validate(raw), set()
        except ValidationError as error:
            problems = error.errors(include_url=False)
        self.faults += [_below(path, _fault(table, problem)) for problem in problems]
        if not isinstance(raw, dict):
            return None, set()
        wrong = {problem["loc"][0] for problem in problems}
        sound = {key: value for key, value in raw.items() if key not in wrong}
        sound |= {key: value for key, value in table.examples().items() if key in wrong}
        try:
            return table.model_validate(sound), {
                field for field, key in table.keys().items() if key in wrong
            }
        except ValidationError:
            return None, set()


def _fault(table: type[Table], problem: Any) -> Fault:
    if problem["type"] == "extra_forbidden":
        location = list(problem["loc"])
        return Fault(dotted(location), problem["input"], unknown_key(table, location))
    return pydantic_fault(problem)


def _below(path: str, fault: Fault) -> Fault:
    return fault._replace(path=".".join(part for part in (path, fault.path) if part))


def _doubtful(fault: Fault, blamed: Iterable[str]) -> bool:
    """Whether a fault concerns values that are wrong anyway."""
    fields = set(fault.path.split(", "))
    return bool(
        (fields | {one for field in fields for one in _RESTS_ON.get(field, ())}) & {*blamed}
    )


def _in_keys(fault: Fault, keys: Mapping[str, str], raw: Mapping[str, Any], path: str) -> Fault:
    """The fault under the keys of the table, with the values as the file has them."""
    fields = fault.path.split(", ")
    if not set(fields) <= keys.keys():
        return _below(path, fault)
    names = [keys[field] for field in fields]
    given = tuple(raw.get(name) for name in names)
    allowed = fault.allowed
    if isinstance(allowed, Range):
        allowed = allowed.in_degrees() if allowed.unit == "rad" else allowed
    else:
        allowed = re.sub(r"\w+", lambda word: keys.get(word[0], word[0]), allowed)
    value = given[0] if len(given) == 1 else given
    if isinstance(value, tuple) and all(one is None for one in value):
        value = None
    return Fault(", ".join(f"{path}.{name}" for name in names), value, allowed)
