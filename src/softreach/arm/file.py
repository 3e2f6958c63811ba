"""Designs as TOML files: lengths in meters, angles in degrees, the unit in every key."""

from __future__ import annotations

import difflib
import json
import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from decimal import Decimal
from typing import Any

from pydantic import BaseModel, ConfigDict, ValidationError

from softreach.arm.actuators import Actuator, FiberArchitecture
from softreach.arm.actuators.actuator import actuator_kinds
from softreach.arm.checks import fiber_faults, name_faults, tube_faults
from softreach.arm.profile import LinearTaper, Profile
from softreach.arm.section import Section
from softreach.errors import Fault, InvalidDesign, Range

__all__ = ["in_file_terms", "parse", "render"]

_PI = Decimal("3.14159265358979323846264338327950288420")
_LONG = 17  # digits from which a number of degrees is read exactly


class _Model(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


class _FiberTable(_Model):
    """The keys of [[fibers]] and their types; the design itself checks ranges."""

    name: str = ""
    helical_angle_deg: float | None = None
    revolution_deg: float | None = None
    offset_deg: float = 0.0
    extent_deg: float
    bundles: int = 1


class _DesignTable(_Model):
    """The keys of a design file and their types."""

    length_m: float
    outer_radius_m: float
    inner_radius_m: float | None = None
    inner_ratio: float | None = None
    taper_deg: float = 0.0
    poisson_ratio: float = 0.5
    activation_bounds: list[float] | list[list[float]] = [-5 / 3, 0.0]
    fibers: list[_FiberTable] = []
    actuators: list[dict[str, Any]] = []


_NO_FIBERS = "must hold one [[fibers]] table or more"


class _Decimal(float):
    """A number that remembers how it was written, so that degrees convert without a lost digit."""

    def __new__(cls, text: str) -> _Decimal:
        number = super().__new__(cls, text)
        number.text = text
        return number

    text: str


def parse(text: str, source: str) -> tuple[dict[str, Any], list[Actuator]]:
    """The fields of a tapered tube in SI units, and its actuators, from TOML text.

    Args:
        text: The text of a design file.
        source: What errors call it.

    Raises:
        InvalidDesign: Every fault of the text, with its key, value and what is allowed.
    """
    try:
        document = tomllib.loads(text, parse_float=_Decimal)
    except tomllib.TOMLDecodeError as error:
        raise InvalidDesign([Fault("TOML", str(error), "must be valid TOML")], source) from None
    faults = list(_table_faults(document))
    faults += _physics_faults(document, {fault.path for fault in faults})
    if faults:
        raise InvalidDesign(faults, source)
    actuators: list[Actuator] = [
        FiberArchitecture(**_in_si(table)) for table in document.pop("fibers", [])
    ]
    for k, table in enumerate(document.pop("actuators", [])):
        actuators.append(_own_kind(table, f"actuators[{k}]", source))
    tube = _in_si(document)
    if (ratio := tube.pop("inner_ratio", None)) is not None:
        tube["inner_radius"] = ratio * tube["outer_radius"]
        return {**tube, "inner_ratio": ratio}, actuators
    return tube, actuators


def _own_kind(table: dict[str, Any], path: str, source: str) -> Actuator:
    """An actuator of a kind defined outside softreach: its fields, in SI units."""
    values = {key: _plain(value) for key, value in table.items()}
    kind, known = values.pop("kind", None), actuator_kinds()
    if not isinstance(kind, str) or kind not in known:
        allowed = f"must be a kind of actuator that is imported: {', '.join(known)}"
        raise InvalidDesign([Fault(f"{path}.kind", kind, allowed)], source)
    try:
        return known[kind](**values)
    except TypeError as error:
        raise InvalidDesign([Fault(path, kind, f"has other fields: {error}")], source) from None
    except InvalidDesign as error:
        faults = [fault._replace(path=f"{path}.{fault.path}") for fault in error.faults]
        raise InvalidDesign(faults, source) from None


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return tuple(_plain(item) for item in value)
    return float(value) if isinstance(value, _Decimal) else value


def render(profile: Profile, section: Section, actuators: Sequence[Actuator]) -> str:
    """TOML text of a design, every number such that it reads back to the same one.

    Raises:
        InvalidDesign: A profile that design files have no keys for, or an actuator that is not
            made of plain values.
    """
    if not isinstance(profile, LinearTaper):
        raise InvalidDesign([Fault("profile", profile, "has no keys in a design file")])
    ring = section.rings[0]
    lines = [
        f"length_m = {profile.length!r}",
        f"outer_radius_m = {profile.outer_radius!r}",
        _inner_line(profile.outer_radius, ring.inner_ratio),
        f"taper_deg = {_degrees_text(profile.taper)}",
        f"poisson_ratio = {ring.material.poisson_ratio!r}",
    ]
    if not all(isinstance(actuator, FiberArchitecture) for actuator in actuators):
        return "\n".join([*lines, *_actuator_lines(actuators)]) + "\n"
    lines.append(f"activation_bounds = {json.dumps(_common_bounds(actuators))}")
    for fiber in actuators:
        lines += ["", "[[fibers]]", *_fiber_lines(vars(fiber))]
    return "\n".join(lines) + "\n"


def _inner_line(outer: float, ratio: float) -> str:
    """The radius that, over the outer one, gives the ratio to the last bit; else the ratio."""
    radius = low = high = ratio * outer
    near = [radius]
    for _ in range(2):
        low, high = math.nextafter(low, 0.0), math.nextafter(high, math.inf)
        near += [low, high]
    exact = next((value for value in near if value / outer == ratio), None)
    return f"inner_ratio = {ratio!r}" if exact is None else f"inner_radius_m = {exact!r}"


def _common_bounds(actuators: Sequence[Actuator]) -> list[Any]:
    """One pair if all bundles share it, else one for each."""
    pairs = [pair for actuator in actuators for pair in actuator.bounds.tolist()]
    return pairs[0] if all(pair == pairs[0] for pair in pairs) else pairs


def _actuator_lines(actuators: Sequence[Actuator]) -> Iterator[str]:
    """A table for each actuator: its kind and its fields, as they are in Python."""
    for actuator in actuators:
        yield from ("", "[[actuators]]", f"kind = {json.dumps(type(actuator).__name__)}")
        for name in (field.name for field in fields(actuator)):  # pyright: ignore[reportArgumentType]
            if (value := getattr(actuator, name)) is not None:
                yield f"{name} = {_value_text(actuator, name, value)}"


def _value_text(actuator: Actuator, name: str, value: Any) -> str:
    try:
        return _toml(value)
    except (TypeError, ValueError):
        kind = type(actuator).__name__
        allowed = "must be a number, text or a sequence of these to fit in a design file"
        raise InvalidDesign([Fault(f"{kind}.{name}", value, allowed)]) from None


def _toml(value: Any) -> str:
    """Text, numbers and sequences of them as JSON, which is TOML too but for one character."""
    return json.dumps(value, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")


def in_file_terms(error: InvalidDesign, source: str) -> InvalidDesign:
    """The same faults under the file's keys and in its units."""
    return InvalidDesign([_in_file_terms(fault, "") for fault in error.faults], source)


def _fiber_lines(fiber: Mapping[str, Any]) -> Iterator[str]:
    if fiber["name"]:
        yield f"name = {_toml(fiber['name'])}"
    for field in ("helical_angle", "revolution", "offset", "extent"):
        if fiber[field] is not None:
            yield f"{field}_deg = {_degrees_text(fiber[field])}"
    yield f"bundles = {fiber['bundles']}"


def _table_faults(document: Mapping[str, Any]) -> Iterator[Fault]:
    """Keys that are unknown or missing, and values of another type."""
    try:
        _DesignTable.model_validate(document)
    except ValidationError as error:
        for problem in error.errors(include_url=False):
            yield _as_fault(problem)


def _as_fault(problem: Any) -> Fault:
    location = [part for part in problem["loc"] if not str(part).startswith("list[")]
    path = _dotted(location)
    if problem["type"] == "missing":
        return Fault(path, None, "required key is missing")
    if problem["type"] == "extra_forbidden":
        return Fault(path, problem["input"], f"unknown key{_nearest(location)}")
    message = str(problem["msg"]).replace("Input should be", "must be")
    return Fault(path, problem["input"], message)


def _nearest(location: list[Any]) -> str:
    table = _FiberTable if location[0] == "fibers" and len(location) > 1 else _DesignTable
    close = difflib.get_close_matches(str(location[-1]), table.model_fields, n=1)
    known = ", ".join(table.model_fields)
    return f'; did you mean "{close[0]}"?' if close else f"; known keys: {known}"


def _dotted(location: list[Any]) -> str:
    text = "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location)
    return text.lstrip(".")


def _physics_faults(document: Mapping[str, Any], blamed: set[str]) -> Iterator[Fault]:
    """Ranges and relations, over every value that its type does not already disqualify."""
    unsound = {path.partition("[")[0] for path in blamed} - {"fibers"}
    values = _in_si({key: document[key] for key in document if key in _DesignTable.model_fields})
    sound = {name: value for name, value in values.items() if _key(name) not in unsound}
    tables = sound.pop("fibers", None)
    yield from (_in_file_terms(fault, "") for fault in tube_faults(sound))
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
    yield from (_in_file_terms(fault, prefix) for fault in fiber_faults(sound))


def _in_si(table: Mapping[str, Any]) -> dict[str, Any]:
    return {_field(key): _si(key, value) for key, value in table.items()}


_KEYS = {
    key.removesuffix("_m").removesuffix("_deg"): key
    for table in (_DesignTable, _FiberTable)
    for key in table.model_fields
}


def _key(path: str) -> str:
    """The key of a field, behind the name of the actuator that it belongs to, if any."""
    owner, dot, field = path.rpartition(".")
    return owner + dot + _KEYS.get(field, field)


def _field(key: str) -> str:
    return key.removesuffix("_m").removesuffix("_deg")


def _si(key: str, value: Any) -> Any:
    """A value in SI units; anything else is left as it is, for the checks to report."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return value
    if key.endswith("_deg"):
        return _radians(getattr(value, "text", repr(value)).replace("_", ""))
    return float(value) if isinstance(value, _Decimal) else value


def _radians(text: str) -> float:
    """Degrees as people write them convert like `math.radians`; longer ones by exact decimals.

    Floating-point degrees miss one angle in ten by a unit in the last place; twenty digits do not.
    """
    digits = text.lower().partition("e")[0].lstrip("+-0.").replace(".", "")
    short = len(digits) < _LONG and math.isfinite(float(text))
    if short or not Decimal(text).is_finite():
        return math.radians(float(text))
    return float(Decimal(text) * _PI / 180)


def _degrees_text(angle: float) -> str:
    """The shortest number of degrees that converts to exactly this angle."""
    degrees = Decimal(angle) * 180 / _PI
    texts = (_decimal_text(f"{degrees:.{digits}g}") for digits in range(1, 26))
    return next((text for text in texts if _radians(text) == angle), repr(math.degrees(angle)))


def _decimal_text(number: str) -> str:
    """A TOML float, without an exponent unless it is far from 1."""
    plain = -6 < Decimal(number).adjusted() < 16
    text = f"{Decimal(number):f}" if plain else number
    return text if "." in text or "e" in text else f"{text}.0"


def _in_file_terms(fault: Fault, prefix: str) -> Fault:
    """The same fault under the file's key and in the file's unit."""
    names = ", ".join(prefix + _key(name) for name in fault.path.split(", "))
    if isinstance(fault.allowed, Range) and fault.allowed.unit == "rad":
        return Fault(names, _shown_degrees(fault.value), fault.allowed.in_degrees())
    value = _shown_degrees(fault.value) if names.endswith("_deg") else fault.value
    return Fault(names, value, fault.allowed)


def _shown_degrees(value: object) -> object:
    if isinstance(value, tuple):
        return tuple(_shown_degrees(item) for item in value)
    return float(f"{math.degrees(value):.12g}") if isinstance(value, float) else value
