"""Expressions with units, as they are typed into fields for numbers: "1/3", "pi/6 rad", "5 cm"."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple, NoReturn

from softreach.studio.widgets import TextKind, number_of, number_text, vector_of
from softreach.support.quantity import sizes_in

__all__ = ["number_kind", "unit_in", "vector_kind"]

_LONGEST = 100  # characters: nothing is nested deeper than Python can follow
_DIGITS = 15  # of what was converted from another unit
_UNIT_IN = re.compile(r"\[([^\]]+)\]$| / (L)$")
_NUMBER = re.compile(r"(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_NAME = re.compile(r"[^\W\d_]+|[°%]")
_SIGNS = str.maketrans({"\N{MINUS SIGN}": "-", "×": "*", "·": "*", "^": "**"})
_CONSTANTS = {"pi": math.pi, "π": math.pi}
_FUNCTIONS: Mapping[str, Callable[[float], float]] = {
    "sqrt": math.sqrt, "sin": math.sin, "cos": math.cos, "tan": math.tan,
}  # fmt: skip
_BRACKETED = re.compile(r"\s*[(\[]([^()\[\]]*)[)\]](.*)")
_MIXED = "a unit on each of them, or on none"


def unit_in(label: str) -> str:
    """The unit that a label names, as in "taper φ [deg]" and "target / L"; "" for none."""
    match = _UNIT_IN.search(label)
    return "" if match is None else match[1] or match[2]


def number_kind(unit: str, length: Callable[[], float]) -> TextKind:
    """Numbers and expressions in a unit, or with another one.

    Args:
        unit: Of what has none; "" for plain numbers.
        length: L [m] of the arm, which is a unit of lengths.
    """

    def value(text: str) -> float:
        return _Expression(text, _units(unit, length())).value.number

    demand = "a number or an expression such as 1/3" + _with_units(unit, length())
    return TextKind(demand, value, number_text, lambda text: number_of(text) is None)


def vector_kind(unit: str, length: Callable[[], float]) -> TextKind:
    """Three of them, as `number_kind`."""

    def value(text: str) -> tuple[float, ...]:
        return vector_of(text) or _vector(text, _units(unit, length()))

    demand = "three numbers, such as 0, 0, -9.81" + _with_units(unit, length())
    return TextKind(demand, value, _vector_text, lambda text: vector_of(text) is None)


def _vector_text(values: Iterable[float]) -> str:
    return ", ".join(map(number_text, values))


def _units(unit: str, length: float) -> Mapping[str, float]:
    """Units that may be typed, with their sizes in that of the field."""
    if not unit:
        return {"%": 0.01}
    if unit == "L":
        return {"L": 1.0} | {name: size / length for name, size in sizes_in("m").items()}
    sizes = sizes_in(unit)
    return sizes | {"L": length * sizes["m"]} if "m" in sizes else sizes


def _with_units(unit: str, length: float) -> str:
    """The units that may be typed in words, each size once."""
    if not unit:
        return ""
    names = {size: name for name, size in reversed([*_units(unit, length).items()]) if size != 1.0}
    *most, last = [*reversed(names.values())] or [""]
    others = f", or with {', '.join(most)} or {last}" if most else f", or with {last}"
    return f", in {unit}{others if last else ''}"


def _vector(text: str, units: Mapping[str, float]) -> tuple[float, ...]:
    """Three expressions, as numbers."""
    inner, unit = text, ""
    if match := _BRACKETED.fullmatch(text):  # as places of tips are written
        inner, unit = match.groups()
    mark = next((mark for mark in ";," if mark in inner), None)
    parts = [part + unit for part in inner.split(mark)]
    if len(parts) != 3:
        raise ValueError(f"these are {len(parts)}")
    values = [_Expression(part, units).value for part in parts]
    if len({value.has_unit for value in values if value.number}) > 1:
        raise ValueError(_MIXED)
    return tuple(value.number for value in values)


class _Value(NamedTuple):
    number: float
    """In the unit of the field."""
    has_unit: bool
    """True if one was typed."""


class _Expression:
    """Sums of products of powers, read from left to right; a unit stands behind what it is of."""

    def __init__(self, text: str, units: Mapping[str, float]) -> None:
        """Read a text.

        Args:
            text: What was typed.
            units: Those that it may have, with their sizes.

        Raises:
            ValueError: It is no such expression; the message says what is wrong.
        """
        if len(text) > _LONGEST:
            raise ValueError(f"at most {_LONGEST} characters")
        self._text, self._at, self._units = text.translate(_SIGNS).rstrip(), 0, units
        try:
            self.value = self._sum()
            if self._rest:
                self._refuse()
        except (ZeroDivisionError, OverflowError):
            raise ValueError("it is not finite") from None
        if not math.isfinite(self.value.number):
            raise ValueError("it is not finite")
        if self.value.has_unit:  # 2 deg are 2.0 deg, whatever their sizes in rad
            rounded = float(f"{self.value.number:.{_DIGITS}g}")
            self.value = self.value._replace(number=rounded)

    @property
    def _rest(self) -> str:
        return self._text[self._at :].lstrip()

    def _take(self, *marks: str) -> str:
        """The mark that comes next, if it is one of these; "" else."""
        mark = next((mark for mark in marks if self._rest.startswith(mark)), "")
        if mark:
            self._at = len(self._text) - len(self._rest) + len(mark)
        return mark

    def _refuse(self) -> NoReturn:
        if not self._rest:
            raise ValueError(
                "something is missing at its end" if self._text else "nothing is typed"
            )
        word = _NAME.match(self._rest) or _NUMBER.match(self._rest)
        raise ValueError(f"{word[0] if word else self._rest[0]} is not expected there")

    def _sum(self) -> _Value:
        total = self._product()
        while sign := self._take("+", "-"):
            term = self._product()
            if term.has_unit != total.has_unit:
                raise ValueError(_MIXED)
            total = total._replace(
                number=total.number + (term.number if sign == "+" else -term.number)
            )
        return total

    def _product(self) -> _Value:
        product = self._with_unit(self._signed())
        while mark := self._take("*", "/"):
            product = self._with_unit(_multiplied(product, self._signed(), mark))
        return product

    def _with_unit(self, value: _Value) -> _Value:
        """A value with the unit that is typed behind it, if there is one."""
        name = next(
            (name for name in sorted(self._units, key=len)[::-1] if self._is_next(name)), ""
        )
        if not name:
            return value
        self._take(name)
        if value.has_unit:
            raise ValueError(f"{name} is a second unit")
        return _Value(value.number * self._units[name], has_unit=True)

    def _is_next(self, name: str) -> bool:
        after = self._rest.removeprefix(name)
        return after != self._rest and not (after[:1].isalnum() and name[-1].isalnum())

    def _signed(self) -> _Value:
        if sign := self._take("+", "-"):
            value = self._signed()
            return value._replace(number=-value.number) if sign == "-" else value
        base = self._atom()
        if self._take("**"):
            exponent = self._signed()
            if base.has_unit or exponent.has_unit:
                raise ValueError("powers are of plain numbers")
            return _Value(_real(math.pow, base.number, exponent.number), has_unit=False)
        return base

    def _atom(self) -> _Value:
        if number := _NUMBER.match(self._rest):
            self._take(number[0])
            return _Value(float(number[0].replace(",", ".")), has_unit=False)
        if self._take("("):
            value = self._sum()
            if not self._take(")"):
                if self._rest:
                    self._refuse()
                raise ValueError(") is missing")
            return value
        name = _NAME.match(self._rest)
        if name is None or name[0] not in {**_CONSTANTS, **_FUNCTIONS}:
            self._refuse()
        self._take(name[0])
        if name[0] in _CONSTANTS:
            return _Value(_CONSTANTS[name[0]], has_unit=False)
        return self._called(name[0])

    def _called(self, name: str) -> _Value:
        """A function of what stands behind it in brackets: angles in radians, or with a unit."""
        outer, self._units = self._units, {} if name == "sqrt" else sizes_in("rad")
        if not self._rest.startswith("("):
            raise ValueError(f"( is missing behind {name}")
        argument = self._atom()
        self._units = outer
        return _Value(_real(_FUNCTIONS[name], argument.number), has_unit=False)


def _multiplied(one: _Value, other: _Value, mark: str) -> _Value:
    if other.has_unit and (one.has_unit or mark == "/"):
        raise ValueError("units are not multiplied with each other, nor divided by")
    combine = operator.mul if mark == "*" else operator.truediv
    return _Value(combine(one.number, other.number), one.has_unit or other.has_unit)


def _real(function: Callable[..., float], *arguments: float) -> float:
    try:
        return function(*arguments)
    except ValueError:  # of math: the root of a negative number
        raise ValueError("it is no real number") from None
