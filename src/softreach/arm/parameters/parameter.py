"""Design parameters: their names and units, their values on an arm, and how they change one."""

from __future__ import annotations

import dataclasses
import math
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from softreach.arm.actuators import Actuator, FiberArchitecture
from softreach.arm.along import AlongArm
from softreach.arm.drives import Drive
from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.material import Material
from softreach.arm.number import Number, fields_of
from softreach.arm.parameters.draft import Draft, PartKey, Path, part_of, parts
from softreach.arm.profile import LinearTaper
from softreach.arm.section import Ring
from softreach.arm.stations import PLACE, Located, Stations
from softreach.support.arguments import plain
from softreach.support.errors import Fault, Range

__all__ = ["OwnParameter", "Parameter", "parameters"]

_NAN = float("nan")
_ROUNDING = 1e-12  # of an angle that follows from another one
_SIDES = (("min", "lowest activation"), ("max", "highest activation"))


@dataclass(frozen=True, kw_only=True)
class Parameter(ABC):
    """A number in which designs can differ."""

    name: str
    """`taper`, `left.offset`, or `rings[0].material.young_modulus`."""
    owner: str = ""
    """The part that it belongs to, such as `left` or `rings[0].material`; "" for the whole arm."""
    number: Number
    """Its declaration."""

    @property
    def unit(self) -> str:
        """Unit of its values: "m", "rad", "Pa", "kg/m³", "N", or "1"."""
        return self.number.unit or "1"

    @property
    def symbol(self) -> str:
        """Symbol in formulas."""
        return self.number.symbol

    @property
    def meaning(self) -> str:
        """Meaning in a few words."""
        return self.number.meaning

    @property
    def range(self) -> Range:
        """Values that it may have."""
        return self.number.allowed

    @property
    def whole(self) -> bool:
        """It counts something."""
        return self.range.whole

    @property
    def field(self) -> str:
        """The name without its owner."""
        return self.name.removeprefix(f"{self.owner}.") if self.owner else self.name

    def value(self, arm: Manipulator) -> float:
        """Its value on an arm [unit].

        NaN where the arm does not give it as one number: a modulus that is left out, an angle that
        changes along the arm, or what differs between the parts that share it. It can be set all
        the same.
        """
        first, *others = self.values(arm)
        same = all(math.isclose(first, other, rel_tol=_ROUNDING) for other in others)
        return first if same else _NAN

    @abstractmethod
    def values(self, arm: Manipulator) -> tuple[float, ...]:
        """Its value in each part that shares it [unit]."""

    @abstractmethod
    def change(self, draft: Draft, value: float) -> None:
        """Note the change to this value [unit]."""

    def shift(self, draft: Draft, amount: float) -> None:
        """Note that its value grows by this [unit], in each part from the part's own."""
        self.change(draft, self.value(draft.arm) + amount)


@dataclass(frozen=True, kw_only=True)
class OwnParameter(Parameter):
    """A number of one part: a field, a place in a series, or a bound."""

    path: Path

    def values(self, arm: Manipulator) -> tuple[float, ...]:
        """Value in the part of this arm; a bound of all its bundles in each."""
        part, (_, field, place) = part_of(arm, self.path.part), self.path
        if field == "activation_bounds":
            side, *bundle = place
            return tuple(part.bounds[bundle or slice(None), side].tolist())
        if place:
            *inner, k = place
            series = getattr(part, field)
            return (float(getattr(series, str(inner[0]))[k] if inner else series[k]),)
        if isinstance(part, Located):
            return (_float(part.value_on(field, arm.profile, arm.section)),)
        return (_float(getattr(part, field)),)

    def change(self, draft: Draft, value: float) -> None:
        """Change it; an element alone must be admitted, as its series names no places."""
        if self.path.place and (limits := self.number.refusal(plain(value))):
            draft.refuse(Fault(self.name, value, limits))
            return
        counted = self.whole and float(value).is_integer()
        draft.set(self.name, self.path, int(value) if counted else value)

    def shift(self, draft: Draft, amount: float) -> None:
        """Shift it; a bound of several bundles in each."""
        values, path = self.values(draft.arm), self.path
        if len(values) == 1:
            super().shift(draft, amount)
            return
        for k, value in enumerate(values):
            draft.set(self.name, path._replace(place=(*path.place, k)), value + amount)


@dataclass(frozen=True, kw_only=True)
class _Place(OwnParameter):
    """The place of a named station: what begins, ends or stands there moves with it."""

    def values(self, arm: Manipulator) -> tuple[float, ...]:
        return (arm.stations[self.path.field],)


@dataclass(frozen=True, kw_only=True)
class _OfDrive(OwnParameter):
    def values(self, arm: Manipulator) -> tuple[float, ...]:
        return (part_of(arm, self.path.part).value_of(self.path.field),)


@dataclass(frozen=True, kw_only=True)
class _Taper(OwnParameter):
    """The taper angle: when it changes, revolutions stay and helical angles follow."""

    def change(self, draft: Draft, value: float) -> None:
        draft.keep_revolutions()
        super().change(draft, value)


@dataclass(frozen=True, kw_only=True)
class _Shared(Parameter):
    parts: tuple[Parameter, ...]

    def values(self, arm: Manipulator) -> tuple[float, ...]:
        return tuple(value for part in self.parts for value in part.values(arm))

    def change(self, draft: Draft, value: float) -> None:
        for part in self.parts:
            dataclasses.replace(part, name=self.name).change(draft, value)

    def shift(self, draft: Draft, amount: float) -> None:
        for part in self.parts:
            dataclasses.replace(part, name=self.name).shift(draft, amount)


@dataclass(frozen=True, kw_only=True)
class _OuterRadius(Parameter):
    """The radius at the base of a profile given by radii: all of them keep their proportions."""

    def values(self, arm: Manipulator) -> tuple[float, ...]:
        """R2(0) [m]."""
        return (float(arm.profile.radius(0.0)),)

    def change(self, draft: Draft, value: float) -> None:
        radii: tuple[float, ...] = getattr(draft.arm.profile, "radii")  # noqa: B009
        scaled = [value if k == 0 else radius * value / radii[0] for k, radius in enumerate(radii)]
        for limits in filter(None, map(self.number.refusal, map(plain, scaled))):
            draft.refuse(Fault(self.name, value, limits))
            return
        for k, radius in enumerate(scaled):
            draft.set(self.name, Path(("profile",), "radii", (k,)), radius)


@dataclass(frozen=True, kw_only=True)
class _Revolution(Parameter):
    """Revolution of all that is helical, each in its sense; angles along the arm stay as given."""

    def values(self, arm: Manipulator) -> tuple[float, ...]:
        """|Ω| of all helical fibers and tendons [rad]; 0 without one."""
        return tuple(abs(turn) for turn in _revolutions(arm).values() if turn) or (0.0,)

    def change(self, draft: Draft, value: float) -> None:
        for part, turn in _revolutions(draft.arm).items():
            if turn:
                draft.wind(self.name, part, math.copysign(value, turn))

    def shift(self, draft: Draft, amount: float) -> None:
        for part, turn in _revolutions(draft.arm).items():
            if turn:
                draft.wind(self.name, part, turn + math.copysign(1.0, turn) * amount)


def parameters(arm: Manipulator) -> dict[str, Parameter]:
    """Every parameter of an arm by its name.

    Those of the whole arm come first: fields of profile and section, `revolution` (of all that is
    helical, each in its own sense), `radius_ratio` where all rings begin at one, `poisson_ratio` of
    all materials; `extent`, `lower` and `upper` (the bounds of activations) of all actuators that
    have them. Then come those of single parts, by their path: `profile.radii[1]`,
    `rings[0].inner_ratio`, `rings[0].material.young_modulus`, `core.density`, and of actuators by
    their name: `left.offset`, `left.helical_angle.values[2]`, `left.lower[1]`.
    """
    arm = a_manipulator("arm", arm)
    own = [parameter for key, part in parts(arm).items() for parameter in _of_part(key, part)]
    of_body = [parameter for parameter in own if parameter.path.part[0] != "drives"]
    every = [*_of_arm(arm, of_body), *(parameter for parameter in own if parameter.owner)]
    return {parameter.name: parameter for parameter in every}


def _of_arm(arm: Manipulator, own: list[OwnParameter]) -> Iterator[Parameter]:
    plain = {parameter.name: parameter for parameter in own if not parameter.owner}
    if any(parameter.path.field == "revolution" and parameter.unit == "rad" for parameter in own):
        turn = fields_of(FiberArchitecture)["revolution"]
        meaning = "revolution of all that is helical, each in its own sense"
        yield _Revolution(name="revolution", number=dataclasses.replace(turn, meaning=meaning))
    if (taper := plain.pop("taper", None)) is not None:
        yield _Taper(name="taper", number=taper.number, path=taper.path)
    body = [parameter for parameter in own if parameter.path.part[0] in ("rings", "core")]
    inner = tuple(parameter for parameter in body if parameter.path.field == "inner_ratio")
    if len({parameter.value(arm) for parameter in inner}) == 1:
        ratio = fields_of(Ring)["inner_ratio"]
        ratio = dataclasses.replace(ratio, meaning="inner over outer radius")
        yield _Shared(name="radius_ratio", number=ratio, parts=inner)
    if "outer_radius" not in plain and isinstance(getattr(arm.profile, "radii", None), tuple):
        yield _OuterRadius(name="outer_radius", number=fields_of(LinearTaper)["outer_radius"])
    yield from plain.values()
    poisson = tuple(parameter for parameter in body if parameter.path.field == "poisson_ratio")
    number = fields_of(Material)["poisson_ratio"]
    yield _Shared(name="poisson_ratio", number=number, parts=poisson)
    by_field: dict[str, list[OwnParameter]] = {}
    for parameter in own:
        by_field.setdefault(parameter.path.text, []).append(parameter)
    for field in ("extent", "lower", "upper"):
        same = tuple(by_field.get(field, ()))
        if len({parameter.unit for parameter in same}) == 1:
            yield _Shared(name=field, number=same[0].number, parts=same)


def _of_part(key: PartKey, part: Any) -> Iterator[OwnParameter]:
    """Its numbers, first those that stand alone, and the bounds of an actuator."""
    yield from _of_names(key, part)
    numbers = fields_of(type(part)).values()
    for number in numbers:
        if number.shape == "single":
            yield _own(Path(key, number.field), number)
    for number in numbers:
        for place, element in _elements(number, getattr(part, number.field)):
            yield _own(Path(key, number.field, place), element)
    if isinstance(part, Actuator):
        yield from _bounds(key, part)


def _of_names(key: PartKey, part: Any) -> Iterator[OwnParameter]:
    """Places of stations, and numbers of a drive for each of its bundles."""
    if isinstance(part, Stations):
        for name in part:
            yield _Place(
                name=f"stations.{name}", owner="stations", number=PLACE, path=Path(key, name)
            )
    if isinstance(part, Drive):
        for name, number in part.numbers.items():
            path = Path(key, name)
            yield _OfDrive(name=f"{part.name}.{name}", owner=part.name, number=number, path=path)


def _elements(number: Number, value: Any) -> Iterator[tuple[tuple[str | int, ...], Number]]:
    """Places in a series or a function along the arm; of stations only those between the ends."""
    if isinstance(value, AlongArm):
        inner = fields_of(type(value))["stations_over_length"]
        for place, element in _elements(inner, value.stations_over_length):
            yield (inner.field, *place), element
        yield from ((("values", k), _element(number, k)) for k in range(len(value.values)))
    elif isinstance(value, tuple):
        ends = (1, len(value) - 1) if number.shape == "stations" else (0, len(value))
        yield from (((k,), _element(number, k)) for k in range(*ends))


def _element(number: Number, k: int) -> Number:
    return dataclasses.replace(
        number,
        symbol=f"{number.symbol}[{k}]",
        meaning=f"{number.meaning}, number {k}",
        shape="single",
        along=None,
        pair=False,
    )


def _bounds(key: PartKey, actuator: Actuator) -> Iterator[OwnParameter]:
    unit = "" if actuator.unit == "1" else actuator.unit
    bundles = [(), *((k,) for k in range(actuator.bundles))] if actuator.bundles > 1 else [()]
    for side, (end, meaning) in enumerate(_SIDES):
        for bundle in bundles:
            symbol = f"{end} {actuator.symbol}" + "".join(f"[{k}]" for k in bundle)
            number = Number(symbol=symbol, meaning=meaning, allowed=Range(unit=unit))
            yield _own(Path(key, "activation_bounds", (side, *bundle)), number)


def _own(path: Path, number: Number) -> OwnParameter:
    name = f"{path.owner}.{path.text}" if path.owner else path.text
    return OwnParameter(name=name, owner=path.owner, number=number, path=path)


def _revolutions(arm: Manipulator) -> dict[PartKey, float]:
    """Ω of all that winds by a single number [rad], by its key."""
    return {
        ("actuators", actuator.name): _float(
            actuator.value_on("revolution", arm.profile, arm.section)
        )
        for actuator in arm.actuators
        if "revolution" in (numbers := fields_of(type(actuator)))
        and numbers["revolution"].unit == "rad"
        and not any(isinstance(getattr(actuator, field), AlongArm) for field in numbers)
    }


def _float(value: Any) -> float:
    return float(value) if isinstance(value, int | float | np.number) else _NAN
