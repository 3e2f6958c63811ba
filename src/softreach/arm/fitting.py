"""Parts of a design put together: their names and places, and faults of what does not fit."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from softreach.arm.actuators import Actuator
from softreach.arm.actuators.actuator import MOST_BUNDLES, MOST_TURN
from softreach.arm.base import Base
from softreach.arm.loads import Loads
from softreach.arm.marker import Marker
from softreach.arm.profile import Profile
from softreach.arm.rest_shape import RestShape
from softreach.arm.rigid import RigidPiece
from softreach.arm.section import Section, name_faults
from softreach.arm.stations import Located, Stations, placed
from softreach.support.errors import Fault, InvalidDesign, Range
from softreach.support.units import UNITS

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = [
    "fit_faults",
    "inner_radius_faults",
    "kind_faults",
    "named_actuators",
    "named_stations",
    "part_faults",
    "part_or_faults",
    "placed_parts",
    "shared_names",
]

Made = TypeVar("Made")


def part_or_faults(faults: list[Fault], kind: type[Made], **values: Any) -> Made | None:
    """A part, or None and its faults added to a list."""
    try:
        return kind(**values)
    except InvalidDesign as error:
        faults += error.faults
        return None


def inner_radius_faults(inner: Any, outer: Any) -> list[Fault]:
    """Faults of the radius where the ring of fibers begins."""
    allowed = Range(0.0, unit="m")
    if not allowed.admits(inner):
        return [Fault("inner_radius", inner, allowed)]
    if not allowed.admits(outer) or inner < outer:
        return []
    return [Fault("inner_radius", inner, f"must be below outer_radius = {outer:g} m")]


def part_faults(arm: Manipulator) -> Iterator[Fault]:
    """Parts of the wrong type."""
    if not isinstance(arm.profile, Profile):
        yield Fault("profile", arm.profile, "must be a Profile, such as LinearTaper")
    if not isinstance(arm.section, Section):
        yield Fault("section", arm.section, "must be a Section")
    if not isinstance(arm.loads, Loads | None):
        yield Fault("loads", arm.loads, "must be Loads or None")
    if not isinstance(arm.base, Base):
        yield Fault("base", arm.base, 'must be a Base, such as Base(points="down")')
    if not isinstance(arm.rest, RestShape):
        yield Fault("rest", arm.rest, "must be a RestShape, such as RestShape(curvature_x=2.0)")
    for name, kind in (("rigid_pieces", RigidPiece), ("markers", Marker)):
        parts = getattr(arm, name)
        if not isinstance(parts, tuple | list) or not all(isinstance(x, kind) for x in parts):
            yield Fault(name, parts, f"must be {kind.__name__}s")
    unit = arm.display_unit
    if unit is not None and not (isinstance(unit, str) and unit in UNITS):
        yield Fault("display_unit", unit, f"must be one of {', '.join(UNITS)}")
    yield from kind_faults(arm.actuators)


def kind_faults(actuators: Any) -> Iterator[Fault]:
    """Faults of what is no sequence of actuators, or holds too many bundles."""
    if not isinstance(actuators, Sequence) or isinstance(actuators, str):
        yield Fault("actuators", actuators, "must be a sequence of actuators")
        return
    wrong = [k for k, part in enumerate(actuators) if not isinstance(part, Actuator)]
    for k in wrong:
        allowed = "must be an actuator, such as FiberArchitecture"
        yield Fault(f"actuators[{k}]", actuators[k], allowed)
    if not wrong and (count := sum(part.bundles for part in actuators)) > MOST_BUNDLES:
        yield Fault("actuators", f"{count} bundles", f"must be at most {MOST_BUNDLES} in all")


def named_stations(places: Any) -> Stations:
    """Stations by name, with their faults under the arm's path."""
    try:
        return places if isinstance(places, Stations) else Stations(places)
    except InvalidDesign as error:
        paths = [f"stations.{fault.path}".rstrip(".") for fault in error.faults]
        raise InvalidDesign(list(map(_renamed, error.faults, paths))) from None


LocatedPart = TypeVar("LocatedPart", bound=Located)


def placed_parts(
    parts: Iterable[LocatedPart], stations: Mapping[str, float], owners: Iterable[str]
) -> tuple[LocatedPart, ...]:
    """The parts where the stations that they name are; faults begin with their owners."""
    made, faults = [], []
    for part, owner in zip(parts, owners, strict=True):
        try:
            made.append(placed(part, stations))
        except InvalidDesign as error:
            faults += [_renamed(fault, f"{owner}.{fault.path}") for fault in error.faults]
    if faults:
        raise InvalidDesign(faults)
    return tuple(made)


def _renamed(fault: Fault, path: str) -> Fault:
    return fault._replace(path=path)


def fit_faults(arm: Manipulator) -> Iterator[Fault]:
    """Faults that keep actuators and loads from acting on this profile and section."""
    for name, z in arm.stations.items():
        if z > arm.length:
            yield Fault(f"stations.{name}", z, f"must be on the arm, at most {arm.length:g} m")
    others = {f"rigid_pieces[{k}]": piece for k, piece in enumerate(arm.rigid_pieces)}
    others |= {f"markers.{marker.name}": marker for marker in arm.markers}
    for owner, part in others.items():
        for fault in part.place_faults(arm.length):
            yield _renamed(fault, f"{owner}.{fault.path}")
    rest = arm.rest.curvature(np.linspace(0.0, 1.0, 65))
    turn = arm.length * float(np.linalg.norm(rest, axis=1).mean())
    if turn > MOST_TURN:
        most = f"{MOST_TURN / math.tau:g} turns, {MOST_TURN / arm.length:.4g} 1/m"
        yield Fault("rest", f"{turn / math.tau:.4g} turns", f"must wind the arm by at most {most}")
    if arm.loads is not None:
        yield from arm.loads.section_faults(arm.section, arm.length)
    for actuator in arm.actuators:
        parts = arm.profile, arm.section
        faults = actuator.place_faults(arm.length) or actuator.section_faults(*parts)
        faults = [*faults, *_far_faults(actuator, arm.profile)]
        yield from (
            fault
            if fault.path.startswith(("rings", "core"))
            else fault._replace(path=f"{actuator.name}.{fault.path}")
            for fault in faults
        )


def _far_faults(actuator: Actuator, profile: Profile) -> Iterator[Fault]:
    """Distances and radii beyond the length of the arm: millimeters taken for meters."""
    radius = float(np.max(profile.radius(np.linspace(0.0, profile.length, 65))))
    allowed = f"must be at most the length of the arm, {profile.length:g} m"
    for name in ("distance", "distance_ratio", "radius", "radius_ratio"):
        value: Any = getattr(actuator, name, None)
        values: Any = getattr(value, "values", value)
        scale = radius if name.endswith("ratio") else 1.0
        if value is not None and scale * np.max(values) > profile.length:
            yield Fault(name, values, allowed)


def named_actuators(actuators: Sequence[Actuator]) -> Iterator[Actuator]:
    """The actuators, those without a name called "fiber 1", "fiber 2", ... by their places."""
    taken = {actuator.name for actuator in actuators}
    for place, actuator in enumerate(actuators, start=1):
        if actuator.name:
            yield actuator
            continue
        names = (f"{actuator.default_name} {number}" for number in itertools.count(place))
        name = next(name for name in names if name not in taken)
        taken.add(name)
        yield actuator.replace(name=name)


def shared_names(arm: Manipulator) -> Iterator[Fault]:
    """Names that two actuators, two bundles or two markers share."""
    yield from name_faults([marker.name for marker in arm.markers], "markers")
    names = [actuator.name for actuator in arm.actuators]
    yield from (faults := list(name_faults(names, "actuators")))
    names = arm.bundle_names
    if not faults and len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        yield Fault("actuators", twice, "names two bundles: rename an actuator")
