"""Files of version 1: one ring of one material, a linear taper, fibers, and kinds of one's own."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from typing import Any, Literal

from pydantic import ValidationError

from softreach.arm.actuator_checks import fiber_faults
from softreach.arm.actuators import Actuator, FiberArchitecture
from softreach.arm.actuators.actuator import actuator_kinds
from softreach.arm.checks import name_faults, tube_faults
from softreach.arm.file.degrees import Written, radians
from softreach.arm.file.document import Parts
from softreach.arm.file.own_kind import made_own_kind
from softreach.arm.file.table import Table
from softreach.arm.file.terms import in_keys, pydantic_fault
from softreach.arm.material import Material
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring, Section
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["ROOT_KEYS", "parts_of_version_1"]


class _FiberTable(Table):
    """The keys of [[fibers]] and their types; the design itself checks ranges."""

    name: str = ""
    helical_angle_deg: float | None = None
    revolution_deg: float | None = None
    offset_deg: float = 0.0
    extent_deg: float
    bundles: int = 1


class _DesignTable(Table):
    """The keys of a design file and their types."""

    version: Literal[1] = 1
    length_m: float
    outer_radius_m: float
    inner_radius_m: float | None = None
    inner_ratio: float | None = None
    taper_deg: float = 0.0
    poisson_ratio: float = 0.5
    activation_bounds: list[float] | list[list[float]] | None = None
    fibers: list[_FiberTable] | None = None
    actuators: list[dict[str, Any]] | None = None


ROOT_KEYS = frozenset(_DesignTable.model_fields)
"""What stands outside of all tables, and their names."""

_NO_FIBERS = "must hold one [[fibers]] table or more"


def parts_of_version_1(document: dict[str, Any], source: str) -> Parts:
    """What a file of version 1 describes.

    Args:
        document: Its tables.
        source: What errors call it.

    Raises:
        InvalidDesign: Every fault of the text, with its key, value and what is allowed.
    """
    faults = list(_table_faults(document))
    faults += _physics_faults(document, {fault.path for fault in faults})
    if faults:
        raise InvalidDesign(faults, source)
    fibers = [FiberArchitecture(**_in_si(table)) for table in document.get("fibers", [])]
    others = [
        _own_kind(table, f"actuators[{k}]", source)
        for k, table in enumerate(document.get("actuators", []))
    ]
    return _tube(_in_si(document), (*fibers, *others))


def _tube(values: Mapping[str, Any], actuators: tuple[Actuator, ...]) -> Parts:
    """A tapered tube of one material."""
    ratio, outer = values.get("inner_ratio"), values["outer_radius"]
    ring = Ring(
        inner_ratio=values["inner_radius"] / outer if ratio is None else ratio,
        material=Material(poisson_ratio=values.get("poisson_ratio", 0.5)),
    )
    profile = LinearTaper(
        length=values["length"], outer_radius=outer, taper=values.get("taper", 0.0)
    )
    section = Section(rings=(ring,))
    return Parts(profile, section, actuators, values.get("activation_bounds"))


def _own_kind(table: dict[str, Any], path: str, source: str) -> Actuator:
    """An actuator by the name of its class: its fields, in SI units."""
    kind, known = table.get("kind"), actuator_kinds()
    if not isinstance(kind, str) or kind not in known:
        allowed = f"must be a kind of actuator that is imported: {', '.join(known)}"
        raise InvalidDesign([Fault(f"{path}.kind", kind, allowed)], source)
    try:
        return made_own_kind(known[kind], table)
    except InvalidDesign as error:
        faults = [fault._replace(path=f"{path}.{fault.path}".rstrip(".")) for fault in error.faults]
        raise InvalidDesign(faults, source) from None


def _table_faults(document: Mapping[str, Any]) -> Iterator[Fault]:
    """Keys that are unknown or missing, and values of another type."""
    try:
        _DesignTable.model_validate(document)
    except ValidationError as error:
        for problem in error.errors(include_url=False):
            yield _as_fault(problem)


def _as_fault(problem: Any) -> Fault:
    location = [part for part in problem["loc"] if not str(part).startswith("list[")]
    fault = pydantic_fault({**problem, "loc": location})
    if problem["type"] == "extra_forbidden":
        return fault._replace(allowed=f"unknown key{_nearest(location)}")
    return fault


def _nearest(location: list[Any]) -> str:
    table = _FiberTable if location[0] == "fibers" and len(location) > 1 else _DesignTable
    close = difflib.get_close_matches(str(location[-1]), table.model_fields, n=1)
    known = ", ".join(table.model_fields)
    return f'; did you mean "{close[0]}"?' if close else f"; known keys: {known}"


def _physics_faults(document: Mapping[str, Any], blamed: set[str]) -> Iterator[Fault]:
    """Ranges and relations, over every value that its type does not already disqualify."""
    unsound = {_field(path.partition("[")[0]) for path in blamed} - {"fibers"}
    values = _in_si({key: document[key] for key in document if key in _DesignTable.model_fields})
    sound = {name: value for name, value in values.items() if name not in unsound}
    tables = sound.pop("fibers", None)
    yield from (in_keys(fault) for fault in tube_faults(sound))
    if not tables and not document.get("actuators"):
        yield Fault("fibers", None if tables is None else tables, _NO_FIBERS)
    if (document.get("inner_radius_m") is None) == (document.get("inner_ratio") is None):
        yield Fault("inner_radius_m", None, "give exactly one of inner_radius_m and inner_ratio")
    tables = tables if isinstance(tables, list) else []
    for k, table in enumerate(tables):
        if isinstance(table, dict):
            yield from _fiber_table_faults(table, f"fibers[{k}].", blamed)
    yield from name_faults([isinstance(t, dict) and t.get("name") for t in tables], "fibers")


def _fiber_table_faults(table: dict[str, Any], prefix: str, blamed: set[str]) -> Iterator[Fault]:
    known = {key: table.get(key, field.default) for key, field in _FiberTable.model_fields.items()}
    sound = _in_si({key: known[key] for key in known if prefix + key not in blamed})
    yield from (in_keys(fault, prefix) for fault in fiber_faults(sound))


def _in_si(table: Mapping[str, Any]) -> dict[str, Any]:
    return {_field(key): _si(key, value) for key, value in table.items()}


def _field(key: str) -> str:
    return key.removesuffix("_m").removesuffix("_deg")


def _si(key: str, value: Any) -> Any:
    """A value in SI units; anything else is left as it is, for the checks to report."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    if key.endswith("_deg"):
        return radians(value)
    return float(value) if isinstance(value, Written) else value
