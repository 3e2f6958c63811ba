"""Several designs in a table: the parameters in which they differ, and what they reach."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters import changed, parameters
from softreach.studio.markup import Part, Strong, paragraph, table
from softreach.studio.shown_parameters import ShownParameter, named_parameters, slider_parameters
from softreach.studio.snapshots import Numbers
from softreach.support.errors import SoftreachError

_EQUAL = 1e-9  # relative difference that is rounding
_FINEST = 1e-6  # error of what is shown: six digits after the point are enough
_MINUS = "\N{MINUS SIGN}"
_UNR = "UNR [%]"
_MOST = 24
"""Columns of parameters; designs that differ in more are other arms altogether."""

Value = float | None


class Candidate(NamedTuple):
    """One of the designs."""

    name: str
    design: Manipulator
    numbers: Numbers | None


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """A table; None where a design has no such value, or it is not known."""

    names: tuple[str, ...]
    """Of the designs."""
    titles: tuple[str, ...]
    """Of the columns, with units."""
    values: tuple[tuple[Value, ...], ...]
    """For every design one of every column."""
    errors: tuple[tuple[Value, ...], ...]
    """The largest errors of the values, where they have one."""
    differ_otherwise: bool
    """True if they differ in more than the numbers of the table."""

    def difference(self, row: int, column: int) -> Value:
        """From the first design; None where either is not known."""
        value, first = self.values[row][column], self.values[0][column]
        return None if value is None or first is None else value - first


class _Column(NamedTuple):
    title: str
    values: list[Value]
    errors: list[Value]


def compared(candidates: Sequence[Candidate]) -> Comparison:
    """Put designs beside the first of them."""
    designs = [candidate.design for candidate in candidates]
    shown, explained = _shown_parameters(designs)
    columns = [*_reach_columns(candidates), *shown]
    return Comparison(
        names=tuple(candidate.name for candidate in candidates),
        titles=tuple(column.title for column in columns),
        values=tuple(zip(*(column.values for column in columns), strict=True)),
        errors=tuple(zip(*(column.errors for column in columns), strict=True)),
        differ_otherwise=not explained,
    )


def comparison_html(comparison: Comparison) -> str:
    """The table; under each value how far it is from that of the first design."""
    rows = [
        [[Strong(name)], *(_cell(comparison, k, j) for j in range(len(comparison.titles)))]
        for k, name in enumerate(comparison.names)
    ]
    more = (
        paragraph("Some differ in more than these numbers.") if comparison.differ_otherwise else ""
    )
    return table(["design", *comparison.titles], rows) + more


def _cell(comparison: Comparison, row: int, column: int) -> list[Part]:
    value, difference = comparison.values[row][column], comparison.difference(row, column)
    if value is None:
        return ["–"]
    error, first = comparison.errors[row][column], comparison.values[0][column]
    percent = comparison.titles[column] == _UNR
    lines: list[Part] = [_digits(value, error, "", ".2f" if percent else ".5g")]
    if row and difference is not None:
        before = comparison.errors[0][column]
        both = None if error is None or before is None else error + before
        lines.append(_change(difference, both, first, "+.2f" if percent else "+.4g"))
    return lines


def _change(difference: float, error: Value, first: Value, usual: str) -> str:
    if difference == 0:
        return "="
    text = _digits(difference, error, "+", usual)
    if error is None or not first:
        return text
    return f"{text} ({_digits(100 * difference / first, 100 * error / first, '+', usual)} %)"


def _digits(value: float, error: Value, sign: str, usual: str) -> str:
    """A number to the first digit of its error; as usual without one."""
    if error is not None and 0 < (error := max(error, _FINEST)) < math.inf:
        usual = f"{sign}.{max(0, -math.floor(math.log10(error)))}f"
    return f"{value:{usual}}".replace("-", _MINUS)


def _reach_columns(candidates: Sequence[Candidate]) -> list[_Column]:
    """Volume, area or length, whatever each has, in the unit of the first design, and UNR."""
    numbers = [candidate.numbers for candidate in candidates]
    kinds = dict.fromkeys((each.size.name, each.size.power) for each in numbers if each is not None)
    unit, columns = candidates[0].design.length_unit, []
    for name, power in kinds or {("volume", 3): None}:
        sizes = [each.size if each and each.size.name == name else None for each in numbers]
        title, scale = (unit.label(name, power), unit.scale(power)) if power else (name, 1.0)
        values = [None if size is None else size.value / scale for size in sizes]
        errors = [None if size is None else size.error / scale for size in sizes]
        columns.append(_Column(title, values, errors))
    shares = [None if each is None else _finite(100 * each.unreachability) for each in numbers]
    if any(share is not None for share in shares):
        columns.append(_Column(_UNR, shares, [None] * len(shares)))
    return columns


def _shown_parameters(designs: Sequence[Manipulator]) -> tuple[list[_Column], bool]:
    """Columns of sliders that differ, then of other parameters; and whether they tell all."""
    shown = _differing([_by_name(slider_parameters(design)) for design in designs])
    if _explained(designs, [name for name, _ in shown]):
        return [column for _, column in shown], True
    known = {name for name, _ in shown}
    every = _differing([_by_name(named_parameters(design)) for design in designs])
    others = [(name, column) for name, column in every if name not in known]
    return [column for _, column in [*shown, *others][:_MOST]], False


def _by_name(shown: Iterable[ShownParameter]) -> dict[str, ShownParameter]:
    return {parameter.name: parameter for parameter in shown}


def _differing(designs: Sequence[dict[str, ShownParameter]]) -> list[tuple[str, _Column]]:
    columns = []
    for name in dict.fromkeys(name for design in designs for name in design):
        title = next(design[name].label for design in designs if name in design)
        values = [_finite(design[name].shown) if name in design else None for design in designs]
        if not all(_same(values[0], value) for value in values):
            columns.append((name, _Column(title, values, [None] * len(values))))
    return columns


def _explained(designs: Sequence[Manipulator], names: Sequence[str]) -> bool:
    """True if the first design becomes each of the others by these parameters alone."""
    first = designs[0]
    for other in designs[1:]:
        try:
            goal = parameters(other)
            near = changed(first, {name: goal[name].value(other) for name in names})
        except (KeyError, SoftreachError):
            return False
        if _shape(near) != _shape(other):
            return False
        if _differing([_by_name(named_parameters(arm)) for arm in (near, other)]):
            return False
    return True


def _shape(arm: Manipulator) -> object:
    """Kinds and names of the parts: all that is no number."""
    rings = tuple((ring.name, ring.material) for ring in arm.section.rings)
    parts = tuple((type(actuator), actuator.name) for actuator in arm.actuators)
    return type(arm.profile), rings, parts, arm.loads is None


def _same(value: Value, other: Value) -> bool:
    if value is None or other is None:
        return value is other
    return abs(value - other) <= _EQUAL * max(abs(value), abs(other))


def _finite(value: float) -> Value:
    return float(value) if math.isfinite(value) else None
