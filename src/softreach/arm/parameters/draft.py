"""Changes of numbers of an arm, gathered before any of its parts is made again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators import Actuator
from softreach.arm.along import AlongArm
from softreach.arm.manipulator import Manipulator
from softreach.arm.number import fields_of
from softreach.arm.section import Section
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["Draft", "PartKey", "Path", "part_of", "parts"]

Made = TypeVar("Made")

PartKey = tuple[str | int, ...]
"""("profile",), ("rings", 0, "material"), ("core",), ("actuators", "left"), ("loads",), ..."""

_BOUNDS = "activation_bounds"
_SIDES = ("lower", "upper")


class Path(NamedTuple):
    """Place of a number in an arm."""

    part: PartKey
    field: str
    """Of the part."""
    place: tuple[str | int, ...] = ()
    """In the field: (2,) of a series, ("values", 2) of a function along the arm; of bounds the
    side, 0 or 1, and a bundle where it is meant alone."""

    @property
    def owner(self) -> str:
        """Start of names of numbers of this part; "" for the arm itself."""
        kind, *path = self.part
        if kind in ("actuators", "drives"):
            return str(path[0])
        if kind == "markers":
            return f"markers.{path[0]}"
        if kind in ("rings", "rigid_pieces"):
            return "".join((f"{kind}[{path[0]}]", *(f".{step}" for step in path[1:])))
        of_arm = kind == "section" or (kind == "profile" and not self.place)
        return "" if of_arm else str(kind)

    @property
    def faulty(self) -> str:
        """Path of faults of the field, or of the series in it."""
        inner = [step for step in self.place if isinstance(step, str)]
        return ".".join(name for name in (self.owner, self.field, *inner) if name)

    @property
    def text(self) -> str:
        """The name without the owner."""
        if self.field == _BOUNDS:
            side, *bundle = self.place
            assert isinstance(side, int)
            return _SIDES[side] + "".join(f"[{number}]" for number in bundle)
        places = (f"[{step}]" if isinstance(step, int) else f".{step}" for step in self.place)
        return self.field + "".join(places)


def parts(arm: Manipulator) -> dict[PartKey, Any]:
    """Every part that has numbers, by its key."""
    keyed: dict[PartKey, Any] = {("profile",): arm.profile, ("section",): arm.section}
    if arm.loads is not None:
        keyed["loads",] = arm.loads
    if not arm.base.is_identity:
        keyed["base",] = arm.base
    if not arm.rest.is_straight:
        keyed["rest",] = arm.rest
    if arm.stations:
        keyed["stations",] = arm.stations
    keyed |= {("rigid_pieces", k): piece for k, piece in enumerate(arm.rigid_pieces)}
    keyed |= {("markers", marker.name): marker for marker in arm.markers}
    for k, ring in enumerate(arm.section.rings):
        keyed |= {("rings", k): ring, ("rings", k, "material"): ring.material}
    if arm.section.core is not None:
        keyed["core",] = arm.section.core
    if arm.section.measured is not None:
        keyed["measured",] = arm.section.measured
    keyed |= {("drives", drive.name): drive for drive in arm.drives}
    return keyed | {("actuators", actuator.name): actuator for actuator in arm.actuators}


def part_of(arm: Manipulator, key: PartKey) -> Any:
    """One part by its key."""
    return parts(arm)[key]


@dataclass
class _PartDraft:
    start: Any
    """The part before."""
    values: dict[tuple[str, tuple[str | int, ...]], float] = field(default_factory=dict)
    """Field and place -> new value."""

    def made(self, **others: Any) -> Any:
        changes = others | self.changes()
        return self.start.replace(**changes) if changes else self.start

    def changes(self) -> dict[str, Any]:
        """New values of fields; an element of a series wins over a new value for all of it."""
        fields = {name: value for (name, place), value in self.values.items() if not place}
        elements: dict[tuple[str, tuple[str | int, ...]], dict[str | int, float]] = {}
        for (name, place), value in self.values.items():
            if place and name != _BOUNDS:
                elements.setdefault((name, place[:-1]), {})[place[-1]] = value
        series: dict[str, Any] = {}
        for (name, inner), new in elements.items():
            before = series.get(name, getattr(self.start, name))
            numbers: Any = getattr(before, str(inner[0])) if inner else before
            numbers = tuple(new.get(k, number) for k, number in enumerate(numbers))
            series[name] = _along(before, name, str(inner[0]), numbers) if inner else numbers
        return fields | series


@dataclass
class _ActuatorDraft(_PartDraft):
    revolution: float | None = None
    """Revolution that it gets unless its own parameters say how it winds [rad]."""

    def changes(self) -> dict[str, Any]:
        """New values of fields, bounds for as many bundles as it has then."""
        changes = super().changes()
        if self.revolution is not None and not changes.keys() & {"revolution", "helical_angle"}:
            changes["revolution"] = self.revolution
        bounds = self._bounds(changes.get("bundles", self.start.bundles))
        return changes if bounds is None else changes | {"activation_bounds": bounds}

    def _bounds(self, bundles: Any) -> Any:
        """New bounds or None; where the number of bundles changes, all start from the first's."""
        start: NDArray[np.float64] = self.start.bounds
        if not isinstance(bundles, int) or bundles < 1:
            return None
        new: dict[Any, float] = {
            place: value for (name, place), value in self.values.items() if name == _BOUNDS
        }
        if not new:
            return None if bundles == len(start) else tuple(start[0].tolist())
        bounds = start.copy() if bundles == len(start) else start[:1].repeat(bundles, axis=0)
        for (side, *bundle), value in new.items():
            if bundle and bundle[0] >= bundles:
                allowed = f"has no bundle, as their number becomes {bundles}"
                raise InvalidDesign([Fault(_BOUNDS, value, allowed)])
            bounds[bundle[0] if bundle else slice(None), side] = value
        return tuple((low, high) for low, high in bounds.tolist())


class Draft:
    """An arm that is being changed.

    Its parts are made, and checked, when all changes are known: a change may be valid only together
    with others.
    """

    def __init__(self, arm: Manipulator) -> None:
        self.arm = arm
        self._parts = {
            key: (_ActuatorDraft if isinstance(part, Actuator) else _PartDraft)(part)
            for key, part in parts(arm).items()
        }
        self._faults: list[Fault] = []
        self._requests: dict[str, dict[Any, tuple[str, float]]] = {}

    def set(self, name: str, path: Path, value: float) -> None:
        """Note a new value, under the name by which it was requested."""
        self._parts[path.part].values[path.field, path.place] = value
        self._requests.setdefault(path.faulty, {})[path.place] = name, value

    def wind(self, name: str, part: PartKey, revolution: float) -> None:
        """Give an actuator another revolution, which its own parameters may still override."""
        self._actuator(part).revolution = revolution
        path = Path(part, "revolution")
        self._requests.setdefault(path.faulty, {path.place: (name, revolution)})

    def keep_revolutions(self) -> None:
        """State the revolutions of helical fibers, so that their angles follow the profile.

        Angles that are given along the arm stay.
        """
        for fiber in self.arm.fibers:
            draft = self._actuator(("actuators", fiber.name))
            winds = fiber.helical_angle and not isinstance(fiber.helical_angle, AlongArm)
            if winds and draft.revolution is None:
                draft.revolution = fiber.revolution_on(self.arm.profile, self.arm.section)

    def refuse(self, fault: Fault) -> None:
        """Note a change that is wrong whatever the others are."""
        self._faults.append(fault)

    def made(self) -> Manipulator:
        """The changed arm.

        Raises:
            InvalidDesign: The arm cannot exist; the error names every fault by the parameter that
                was requested.
        """
        changes: dict[str, Any] = {"profile": self._made(("profile",)), "section": self._section()}
        if self.arm.loads is not None:
            changes["loads"] = self._made(("loads",))
        for part in ("base", "rest", "stations"):
            if (part,) in self._parts:
                changes[part] = self._made((part,))
        pieces = (self._made(("rigid_pieces", k)) for k in range(len(self.arm.rigid_pieces)))
        changes["rigid_pieces"] = tuple(pieces)
        markers = (self._made(("markers", marker.name)) for marker in self.arm.markers)
        changes["markers"] = tuple(markers)
        keys = [("actuators", actuator.name) for actuator in self.arm.actuators]
        changes["actuators"] = tuple(self._made(key) for key in keys)
        changes["drives"] = tuple(self._made(("drives", drive.name)) for drive in self.arm.drives)
        if not self._faults:
            made = self._tried(None, lambda: self.arm.replace(**changes))
            if made is not None:
                return made
        raise InvalidDesign(
            list({(fault.path, str(fault.allowed)): fault for fault in self._faults}.values())
        )

    def _actuator(self, key: PartKey) -> _ActuatorDraft:
        draft = self._parts[key]
        assert isinstance(draft, _ActuatorDraft)
        return draft

    def _section(self) -> Section | None:
        before, rings = len(self._faults), []
        for k in range(len(self.arm.section.rings)):
            material = self._made(("rings", k, "material"))
            rings.append(self._made(("rings", k), **({"material": material} if material else {})))
        core = self._made(("core",)) if ("core",) in self._parts else None
        measured = self._made(("measured",)) if ("measured",) in self._parts else None
        if len(self._faults) == before:
            return self._made(("section",), rings=tuple(rings), core=core, measured=measured)
        for (name, _), value in self._parts["section",].values.items():
            # by themselves, as the parts around them are faulty
            self._faults += fields_of(Section)[name].faults(value)
        return None

    def _made(self, key: PartKey, **others: Any) -> Any:
        return self._tried(key, lambda: self._parts[key].made(**others))

    def _tried(self, key: PartKey | None, make: Callable[[], Made]) -> Made | None:
        """The part, or None and its faults; None as a key for the arm itself."""
        try:
            return make()
        except InvalidDesign as error:
            self._faults += [self._as_requested(key, fault) for fault in error.faults]
            return None

    def _as_requested(self, key: PartKey | None, fault: Fault) -> Fault:
        """The fault under the names and with the value that were requested."""
        paths = [self._path(key, field) for field in fault.path.split(", ")]
        requests = [
            tuple(self._requests.get(path, {}).values()) or ((path, None),) for path in paths
        ]
        names = dict.fromkeys(name for each in requests for name, _ in each)
        single = requests[0][0][1] if len(names) == 1 else None
        value = fault.value if single is None else single
        return Fault(", ".join(names), value, fault.allowed)

    def _path(self, key: PartKey | None, field: str) -> str:
        if key is None:
            return field
        number = fields_of(type(self._parts[key].start)).get(field)
        is_series = number is not None and number.shape in ("series", "stations", "several")
        return Path(key, field, (0,) if is_series else ()).faulty


def _along(before: AlongArm, field: str, inner: str, numbers: tuple[Any, ...]) -> AlongArm:
    try:
        return before.replace(**{inner: numbers})
    except InvalidDesign as error:
        faults = [fault._replace(path=f"{field}.{fault.path}") for fault in error.faults]
        raise InvalidDesign(faults) from None
