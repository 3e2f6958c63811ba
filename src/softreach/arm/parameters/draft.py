"""Changes of an arm, gathered before any of its parts is made again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators import Actuator, FiberArchitecture
from softreach.arm.along import AlongArm
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters.parts import WHOLE, actuator_key, parts, prefix_of
from softreach.arm.section import Section
from softreach.support.errors import Fault, InvalidDesign

__all__ = ["ActuatorDraft", "Draft", "PartDraft"]

Part = TypeVar("Part")


@dataclass
class PartDraft:
    """Changes of one part."""

    start: Any
    """What the changes start from."""
    fields: dict[str, Any] = field(default_factory=dict)
    """Field -> new value."""
    series: dict[str, dict[int, float]] = field(default_factory=dict)
    """Path of a series -> place in it -> new value."""

    def made(self, **others: Any) -> Any:
        """The changed part, with other parts in some fields."""
        changes = others | self._changes()
        return self.start.replace(**changes) if changes else self.start

    def _changes(self) -> dict[str, Any]:
        """New values of fields; what is changed in a series wins over a new value for all of it."""
        changes: dict[str, Any] = {}
        for path, numbers in self.series.items():
            name, _, inner = path.partition(".")
            whole = changes.get(name, getattr(self.start, name))
            values = list(getattr(whole, inner) if inner else whole)
            for place, number in numbers.items():
                values[place] = number
            changes[name] = _along(whole, name, inner, values) if inner else tuple(values)
        return self.fields | changes


@dataclass
class ActuatorDraft(PartDraft):
    """Changes of one actuator."""

    winding: float | None = None
    """Revolution that it gets unless its own parameters say how it winds [rad]."""
    bounds: dict[tuple[int, int | None], float] = field(default_factory=dict)
    """0 for lower or 1 for upper, and a bundle or None for all of them -> new value."""

    def _changes(self) -> dict[str, Any]:
        changes = super()._changes()
        if self.winding is not None and not changes.keys() & {"revolution", "helical_angle"}:
            changes["revolution"] = self.winding
        bounds = self._bounds(changes.get("bundles", self.start.bundles))
        return changes if bounds is None else changes | {"activation_bounds": bounds}

    def _bounds(self, bundles: Any) -> Any:
        """New bounds, or None if they stay as they are.

        Each bundle keeps its own while their number stays the same; else all have the first's.
        """
        start: NDArray[np.float64] = self.start.bounds
        if not isinstance(bundles, int) or bundles < 1:
            return None
        if not self.bounds:
            return None if bundles == len(start) else tuple(start[0].tolist())
        bounds = start.copy() if bundles == len(start) else start[:1].repeat(bundles, axis=0)
        for (side, bundle), value in self.bounds.items():
            if bundle is not None and bundle >= bundles:
                allowed = f"has no bundle, as their number becomes {bundles}"
                raise InvalidDesign([Fault("activation_bounds", value, allowed)])
            bounds[slice(None) if bundle is None else bundle, side] = value
        return tuple((low, high) for low, high in bounds.tolist())


class Draft:
    """An arm that is being changed.

    Its parts are made, and checked, when all changes are known: a change may be valid only together
    with others.
    """

    def __init__(self, arm: Manipulator) -> None:
        """Begin without a change."""
        self.arm = arm
        self.parts = {
            key: (ActuatorDraft if isinstance(part, Actuator) else PartDraft)(part)
            for key, part in parts(arm).items()
        }
        self._faults: list[Fault] = []
        self._asked: dict[str, dict[Any, tuple[str, float]]] = {}

    def actuator(self, key: str) -> ActuatorDraft:
        """The changes of an actuator."""
        draft = self.parts[key]
        assert isinstance(draft, ActuatorDraft)
        return draft

    def set_field(self, name: str, key: str, path: str, value: float) -> None:
        """Note a new value of a field, under the name by which it was asked for."""
        self.parts[key].fields[path] = value
        self._asked[prefix_of(key, path) + path] = {None: (name, value)}

    def set_element(self, name: str, key: str, path: str, place: int, value: float) -> None:
        """Note a new value in a series."""
        self.parts[key].series.setdefault(path, {})[place] = value
        self._asked.setdefault(prefix_of(key, path) + path, {})[place] = name, value

    def set_bound(self, name: str, key: str, side: int, bundle: int | None, value: float) -> None:
        """Note a new bound of one bundle, or of all."""
        self.actuator(key).bounds[side, bundle] = value
        asked = self._asked.setdefault(f"{prefix_of(key)}activation_bounds", {})
        asked[side, bundle] = name, value

    def wind(self, name: str, key: str, revolution: float) -> None:
        """Give an actuator another revolution, which its own parameters may still override."""
        self.actuator(key).winding = revolution
        self._asked.setdefault(f"{prefix_of(key)}revolution", {None: (name, revolution)})

    def keep_revolutions(self) -> None:
        """State the revolutions of helical fibers, so that their angles follow the profile.

        Angles that are given along the arm stay.
        """
        for fiber in self.arm.actuators:
            if not isinstance(fiber, FiberArchitecture) or isinstance(
                fiber.helical_angle, AlongArm
            ):
                continue
            draft = self.actuator(actuator_key(fiber))
            if fiber.helical_angle and draft.winding is None:
                draft.winding = fiber.revolution_on(self.arm.profile, self.arm.section)

    def refuse(self, fault: Fault) -> None:
        """Note a change that is wrong whatever the others are."""
        self._faults.append(fault)

    def made(self) -> Manipulator:
        """The changed arm.

        Raises:
            InvalidDesign: The arm cannot exist; the error names every fault by the parameter that
                was asked for.
        """
        changes: dict[str, Any] = {
            field: self._section() if field == "section" else self._made(field)
            for field in WHOLE
            if field in self.parts
        }
        keys = [actuator_key(one) for one in self.arm.actuators]
        changes["actuators"] = tuple(self._made(key) for key in keys)
        if not self._faults:
            made = self._tried("", lambda: self.arm.replace(**changes))
            if made is not None:
                return made
        raise InvalidDesign(
            list({(one.path, str(one.allowed)): one for one in self._faults}.values())
        )

    def _section(self) -> Section | None:
        before, rings = len(self._faults), []
        for k in range(len(self.arm.section.rings)):
            material = self._made(f"rings[{k}].material")
            rings.append(self._made(f"rings[{k}]", **({"material": material} if material else {})))
        core = self._made("core") if "core" in self.parts else None
        if len(self._faults) == before:
            return self._made("section", rings=tuple(rings), core=core)
        self._check_fields("section")
        return None

    def _check_fields(self, key: str) -> None:
        """Judge new values by themselves, where the parts around them are faulty."""
        draft = self.parts[key]
        for variable in draft.start.variables:
            value = draft.fields.get(variable.field)
            if value is not None and not variable.allowed.admits(value):
                self.refuse(Fault(variable.field, value, variable.allowed))

    def _made(self, key: str, **others: Any) -> Any:
        return self._tried(key, lambda: self.parts[key].made(**others))

    def _tried(self, key: str, make: Callable[[], Part]) -> Part | None:
        """The part, or None and its faults."""
        try:
            return make()
        except InvalidDesign as error:
            self._faults += [self._as_asked(key, fault) for fault in error.faults]
            return None

    def _as_asked(self, key: str, fault: Fault) -> Fault:
        """The fault under the names and with the value that were asked for."""
        paths = [prefix_of(key, path) + path if key else path for path in fault.path.split(", ")]
        asked = [tuple(self._asked.get(path, {}).values()) or ((path, None),) for path in paths]
        names = dict.fromkeys(name for each in asked for name, _ in each)
        single = asked[0][0][1] if len(names) == 1 else None
        value = fault.value if single is None else single
        return Fault(", ".join(names), value, fault.allowed)


def _along(whole: AlongArm, field: str, inner: str, values: list[float]) -> AlongArm:
    """The function along the arm with other stations or values."""
    try:
        return whole.replace(**{inner: tuple(values)})
    except InvalidDesign as error:
        faults = [fault._replace(path=f"{field}.{fault.path}") for fault in error.faults]
        raise InvalidDesign(faults) from None
