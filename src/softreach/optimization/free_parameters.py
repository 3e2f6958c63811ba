"""Free parameters of a search: ranges, choices, ties, and the arm with given values of them."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from softreach.arm.manipulator import Manipulator, a_manipulator
from softreach.arm.number import fields_of
from softreach.arm.parameters import Parameter, changed, parameters_by_every_name, unknown_parameter
from softreach.arm.section import named_material
from softreach.arm.tables import check_extension
from softreach.support.arguments import as_given, as_mapping, plain
from softreach.support.arrays import Array
from softreach.support.errors import InvalidInput, NotPossible
from softreach.support.lazy import lazy
from softreach.support.quantity import read_quantity

Values = Mapping[str, float | str]  # Free parameter -> its value [SI unit], or the chosen name

BUNDLES, DESIGN, MATERIAL = "bundles", "design", "material"
"""Choices that are no parameters: how many bundles, which of several designs, of what material."""

_TIE = re.compile(
    r"\s*(?P<sign>[+-]?)\s*(?:(?P<factor>\d[\d.eE]*)\s*\*)?\s*(?P<name>[^\s*+-][^*+]*?)"
    r"\s*(?:(?P<way>[+-])\s*(?P<constant>\d[\w.%°]*))?\s*"
)
_TIES = 'another free parameter with a factor and a constant, such as "-left.revolution + 90deg"'


@dataclass(frozen=True, kw_only=True)
class FreeParameter:
    """A number in a range, or a choice."""

    name: str
    unit: str  # SI unit; "1" for none
    low: float = np.nan  # Least value of a range
    high: float = np.nan  # Largest value of a range
    choices: tuple[float | str, ...] = ()  # Values to choose from, instead of a range
    whole: bool = False  # It counts something

    @property
    def is_real(self) -> bool:
        """True of a number that can change a little."""
        return not self.choices and not self.whole

    def at(self, place: float) -> float | str | int:
        """Its value at a place between 0 and 1 of its range or choices."""
        if self.choices:
            return self.choices[min(int(place * len(self.choices)), len(self.choices) - 1)]
        if self.whole:
            low, high = int(self.low), int(self.high)
            return min(low + int(place * (high - low + 1)), high)
        return self.low + place * (self.high - self.low)

    @property
    def ends(self) -> tuple[float | str, float | str]:
        """Least and largest value; first and last choice."""
        return (self.choices[0], self.choices[-1]) if self.choices else (self.low, self.high)

    def number(self, value: float | str) -> float:
        """A value as a number: that of a choice counts from 0."""
        return float(self.choices.index(value)) if self.choices else float(value)


@dataclass(frozen=True)
class Tie:
    """A parameter that follows from a free one: value = factor · free + constant."""

    name: str
    of: str
    factor: float
    constant: float


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeParameters:
    """All free parameters of a search, and the arm with given values of them."""

    bases: Mapping[str, Manipulator]
    """The designs that others are variations of, by name; "" for a single one."""
    free: tuple[FreeParameter, ...]
    ties: tuple[Tie, ...] = ()

    def __len__(self) -> int:
        return len(self.free)

    @property
    def base(self) -> Manipulator:
        """The first of the designs."""
        return next(iter(self.bases.values()))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the free parameters."""
        return tuple(parameter.name for parameter in self.free)

    @lazy
    def real(self) -> tuple[FreeParameter, ...]:
        """Those that can change a little, which a polish moves."""
        return tuple(parameter for parameter in self.free if parameter.is_real)

    @property
    def bounds(self) -> Array:
        """Ends of the ranges of the real ones, shape (n, 2)."""
        return np.array([(p.low, p.high) for p in self.real], float).reshape(-1, 2)

    def arm(self, values: Values) -> Manipulator:
        """The design with these values and ties, checked for inputs that shorten it to nothing."""
        arm = self.bases[str(values[DESIGN])] if DESIGN in values else self.base
        for name, make in _CHOICES.items():
            if name in values:
                arm = make(arm, values[name])
        numbers = {name: value for name, value in values.items() if name not in _WORDS}
        for tie in self.ties:
            numbers[tie.name] = tie.factor * float(numbers[tie.of]) + tie.constant
        if DESIGN in values or BUNDLES in values:  # another one may lack some
            known = parameters_by_every_name(arm)
            numbers = {name: value for name, value in numbers.items() if name in known}
        made = changed(arm, {name: float(value) for name, value in numbers.items()})
        check_extension(made)
        return made

    def moved(self, values: Values, reals: Array) -> dict[str, float | str]:
        """The values with others of the real parameters, in their order."""
        return {**values, **dict(zip((p.name for p in self.real), reals.tolist(), strict=True))}

    def reals(self, values: Values) -> Array:
        """Values of the real parameters, shape (n,)."""
        return np.array([float(values[p.name]) for p in self.real])

    def start(self) -> dict[str, float | str] | None:
        """Values of the first base, within the ranges; None where it does not tell them."""
        known, values = parameters_by_every_name(self.base), {}
        for name, each in zip(self.names, self.free, strict=True):
            if name in _WORDS:
                values[name] = each.choices[0]
                continue
            value = known[name].value(self.base) if name in known else np.nan
            if not np.isfinite(value):
                return None
            values[name] = float(np.clip(value, each.low, each.high))
            if each.choices:
                values[name] = min(each.choices, key=lambda x, value=value: abs(float(x) - value))
        return values


def free_parameters(
    base: Manipulator | Mapping[str, Manipulator],
    free: Mapping[str, Any],
    choices: Mapping[str, Sequence[Any]] | None = None,
) -> FreeParameters:
    """Free parameters from what a user gives to `search`."""
    bases = as_mapping("base", base, a_manipulator) if isinstance(base, Mapping) else {}
    bases = bases or {"": a_manipulator("base", base)}
    given = as_mapping("free", free, lambda _, value: value)
    picks = {} if choices is None else as_mapping("choices", choices, lambda _, value: value)
    known = known_parameters(bases.values(), picks.get(BUNDLES, ()))
    for name in (*given, *(name for name in picks if name not in _WORDS)):
        if name not in known:
            raise unknown_parameter(name, known)
    texts = {name: text for name, text in given.items() if isinstance(text, str)}
    parts = [_ranged(known, name, ends) for name, ends in given.items() if name not in texts]
    if len(bases) > 1:
        parts.append(FreeParameter(name=DESIGN, unit="1", choices=tuple(bases)))
    parts += [_choice(known, bases, name, values) for name, values in picks.items()]
    names = [parameter.name for parameter in parts]
    if twice := [name for name in names if names.count(name) > 1]:
        raise InvalidInput("free", twice[0], "given once")
    if not parts:
        raise InvalidInput("free", "none", "one parameter or more with a range or choices")
    ties = tuple(_tie(known, names, name, text) for name, text in texts.items())
    return FreeParameters(bases=bases, free=tuple(parts), ties=ties)


def known_parameters(arms: Iterable[Manipulator], counts: Any) -> dict[str, Parameter]:
    """Parameters that any of the designs has, also with numbers of bundles to choose from."""
    counted = counts if isinstance(counts, list | tuple) else ()
    known: dict[str, Parameter] = {}
    for arm in arms:
        for variant in (arm, *(_with_bundles(arm, count) for count in counted)):
            known = {**parameters_by_every_name(variant), **known}
    return known


def _ranged(known: Mapping[str, Parameter], name: str, ends: Any) -> FreeParameter:
    parameter = known[name]
    try:
        low, high = (float(plain(end)) for end in ends)
    except (TypeError, ValueError):
        allowed = "a range (low, high), or text that ties it to a free parameter"
        raise InvalidInput(f"free {name}", as_given(ends), allowed) from None
    whole = parameter.whole
    low, high = (float(np.ceil(low)), float(np.floor(high))) if whole else (low, high)
    if not low < high:  # NaN too
        raise InvalidInput(f"free {name}", (low, high), "a range (low, high) with low < high")
    for end in (low, high):
        if not parameter.range._replace(whole=False).admits(end):
            raise InvalidInput(f"free {name}", end, f"in its range: {parameter.range.text}")
    return FreeParameter(name=name, unit=parameter.unit, low=low, high=high, whole=whole)


def _choice(
    known: Mapping[str, Parameter], bases: Mapping[str, Manipulator], name: str, values: Any
) -> FreeParameter:
    several = isinstance(values, list | tuple | np.ndarray)
    picks = tuple(plain(value) for value in values) if several else ()
    if not picks or len({*picks}) < len(picks):
        allowed = "a list of different values to choose from"
        raise InvalidInput(f"choices {name}", as_given(values), allowed)
    if name == DESIGN:
        raise InvalidInput("choices", DESIGN, "given as base: a dictionary of designs by name")
    for value in picks:
        if name in _CHOICES:
            for arm in bases.values():
                _CHOICES[name](arm, value)
        elif isinstance(value, bool) or not isinstance(value, int | float):
            raise InvalidInput(f"choices {name}", as_given(value), "numbers")
    unit = "1" if name in _CHOICES else known[name].unit
    return FreeParameter(name=name, unit=unit, choices=picks)


def _tie(known: Mapping[str, Parameter], free: list[str], name: str, text: str) -> Tie:
    unit, match = known[name].unit, _TIE.fullmatch(text)
    if match is None or match["name"] not in free:
        allowed = f"{_TIES}; free are {', '.join(free) or 'none'}"
        raise InvalidInput(f"free {name}", as_given(text), allowed)
    try:
        factor = float(match["factor"] or 1.0) * (-1.0 if match["sign"] == "-" else 1.0)
        text_of = match["constant"] or "0"
        is_plain = not text_of.strip("0123456789.eE")
        constant = float(text_of) if is_plain else read_quantity(text_of, unit)
    except ValueError:
        raise InvalidInput(f"free {name}", as_given(text), _TIES) from None
    if name in free:
        raise InvalidInput("free", name, "given once")
    return Tie(name, match["name"], factor, -constant if match["way"] == "-" else constant)


def _with_bundles(arm: Manipulator, count: Any) -> Manipulator:
    """Copies of the first actuator, evenly spread around the arm."""
    first = arm.actuators[0]
    if isinstance(count, bool) or not isinstance(count, int) or count < 1:
        raise InvalidInput(f"choices {BUNDLES}", as_given(count), "whole numbers of 1 or more")
    if arm.drives or "offset" not in fields_of(type(first)):
        what = "arms with drives" if arm.drives else f"{first.name}, which has no offset"
        raise NotPossible(f"the number of bundles cannot be chosen for {what}")
    offset = float(first.value_on("offset", arm.profile, arm.section))
    turns = enumerate(((offset + 2.0 * np.pi * np.arange(count) / count) % (2.0 * np.pi)).tolist())
    copies = (first.replace(name=f"{first.name} {k + 1}", offset=turn) for k, turn in turns)
    return arm.replace(actuators=tuple(copies))


def _of_material(arm: Manipulator, name: Any) -> Manipulator:
    material, section = named_material(name), arm.section
    rings = tuple(ring.replace(material=material) for ring in section.rings)
    return arm.replace(section=section.replace(rings=rings, core=None))


_CHOICES = {BUNDLES: _with_bundles, MATERIAL: _of_material}
_WORDS = (*_CHOICES, DESIGN)
NAMED_CHOICES = tuple(_CHOICES)  # Choices that are no parameters
