"""Text of a search: objectives with errors, free parameters in their ranges, what is missed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from softreach.optimization.free_parameters import FreeParameter
from softreach.optimization.objectives import Goal, Value
from softreach.optimization.problem import NEAR
from softreach.support.errors import counted
from softreach.support.quantity import columns, quantity
from softreach.support.units import LengthUnit, as_unit, handy_unit, readable_unit

if TYPE_CHECKING:
    from softreach.optimization.result import Search

__all__ = [
    "front_rows",
    "missed_text",
    "objective_rows",
    "parameter_rows",
    "remarks",
    "shown_unit",
    "summary_text",
    "value_text",
    "verdict",
]

_MOST_ROWS = 12


def shown_unit(search: Search, unit: LengthUnit | None = None) -> LengthUnit:
    """The unit asked for, that of the design, or one that is handy."""
    if unit is not None:
        return unit
    attributes = search.attributes
    length = float(str(attributes["length"]))
    return as_unit(str(attributes["display_unit"]) or handy_unit(length), length)


def summary_text(search: Search, unit: LengthUnit | None = None) -> str:
    """All that a search came to, in lines.

    Args:
        search: The search.
        unit: Of lengths; None for that of the design, or one that is handy.
    """
    unit = shown_unit(search, unit)
    lines = [f"{verdict(search)}; {counted(search.designs, 'design')}, {search.seconds:.1f} s"]
    lines += columns([*objective_rows(search, unit)]) if search.best.objectives else ()
    lines += columns([("free", "best", "range"), *parameter_rows(search, unit)])
    if len(search.front) > 1:
        rows = list(front_rows(search, unit))
        lines += columns(rows[: _MOST_ROWS + 1])
        if (more := len(rows) - 1 - _MOST_ROWS) > 0:
            lines.append(f"... and {counted(more, 'more design')}")
    return "\n  ".join([*lines, *missed_text(search), *remarks(search)])


def verdict(search: Search) -> str:
    """The outcome in a few words."""
    needs, best = search.problem.requirements, search.best
    count = len(needs.targets) + len(needs.keeps) + len(needs.limits.given) + len(needs.measures)
    if math.isinf(best.excess) or best.fault:
        return "Search: no design that can be judged was found"
    if search.verdict != "met":
        number = len(best.missed if search.verdict == "missed" else best.undecided)
        return f"Search: requirements {search.verdict}, {number} of {count} by the best design"
    front = (
        f"front of {counted(len(search.front), 'design')}"
        if len(search.goals) > 1
        else "best design"
    )
    return f"Search: {front}" + (f", {counted(count, 'requirement')} met" if count else "")


def objective_rows(search: Search, unit: LengthUnit) -> Iterator[tuple[str, str]]:
    """Sense with name, and value ± error, of each objective of the best."""
    for goal, value in zip(search.goals, search.best.objectives, strict=True):
        yield goal_text(goal), value_text(goal, value, unit)


def goal_text(goal: Goal) -> str:
    """An objective with its sense."""
    return f"{'largest' if goal.sense > 0 else 'least'} {goal.name}"


def value_text(goal: Goal, value: Value, unit: LengthUnit) -> str:
    """A value of an objective in a unit that people read, with its error."""
    if not math.isfinite(value.value):
        return "-"
    name, size = readable_unit(goal.objective.unit, value.value, unit)
    return quantity(value.value / size, name, value.error / size)


def parameter_rows(search: Search, unit: LengthUnit) -> Iterator[tuple[str, str, str]]:
    """Name, value of the best and range of each free parameter, then those tied to them."""
    values, ends = search.best.values, search.at_ends
    for parameter in search.problem.parameters.free:
        name, value = parameter.name, values[parameter.name]
        end = f", at its {ends[name]} end" if name in ends else ""
        yield name, number_text(parameter, value, unit) + end, range_text(parameter, unit)
    free = {parameter.name: parameter for parameter in search.problem.parameters.free}
    for tie in search.problem.parameters.ties:
        value = tie.factor * float(values[tie.of]) + tie.constant
        yield tie.name, number_text(free[tie.of], value, unit), f"follows {tie.of}"


def number_text(parameter: FreeParameter, value: float | str, unit: LengthUnit) -> str:
    """A value of a free parameter in a unit that people read."""
    if isinstance(value, str):
        return value
    name, size = readable_unit(parameter.unit, value, unit)
    text = f"{value / size:.6g}"
    return f"{text}{name}" if name == "°" else f"{text} {name}".rstrip()


def range_text(parameter: FreeParameter, unit: LengthUnit) -> str:
    """The range or the choices in words."""
    if parameter.choices:
        return f"one of {', '.join(number_text(parameter, x, unit) for x in parameter.choices)}"
    _, size = readable_unit(parameter.unit, parameter.high, unit)
    return f"{parameter.low / size:.6g} to {number_text(parameter, parameter.high, unit)}"


def front_rows(search: Search, unit: LengthUnit) -> Iterator[Sequence[str]]:
    """Heading, then number, objectives ± errors and free parameters of each design of the front."""
    free = search.problem.parameters.free
    yield ("front", *map(goal_text, search.goals), *(parameter.name for parameter in free))
    for number, each in enumerate(search.front, 1):
        values = each.objectives or [Value(math.nan)] * len(search.goals)
        pairs = zip(search.goals, values, strict=True)
        cells = [value_text(goal, value, unit) for goal, value in pairs]
        cells += [number_text(parameter, each.values[parameter.name], unit) for parameter in free]
        yield (str(number), *cells)


def missed_text(search: Search) -> Iterator[str]:
    """Requirements that the best design misses or leaves undecided, each with its gap."""
    if search.best.fault:
        yield search.best.fault.splitlines()[0]
        return
    if search.met:
        return
    for finding in sorted(search.findings, key=lambda each: -each.excess):
        if not finding.met:
            yield f"{finding.verdict.upper()}  {finding.name}: {finding.text}"


def remarks(search: Search) -> Iterator[str]:
    """Counts of designs by how they were judged, and how sure the best is."""
    problem, judged = search.problem, search.judged
    ways = [f"{judged['bounds']} by bounds alone"] if judged["bounds"] else []
    ways += [f"{judged['coarse']} on coarse sets (to {problem.coarse:g})"] * bool(judged["coarse"])
    ways.append(f"{judged['full']} to full accuracy ({problem.accuracy:g})")
    shown = "; numbers shown are of full accuracy" if search.best.fidelity == "full" else ""
    yield f"judged: {', '.join(ways)}{shown}"
    # Agreement of polishes from designs apart, whose spread is that of searches by other seeds.
    count, near = search.restarts
    if search.goals and search.best.is_feasible:
        text = (
            f"how sure: {near} of {counted(count, 'restart')} ended within {100 * NEAR:g} % of it"
        )
        doubt = "" if near > 1 else ": other seeds may find better designs; allow for more designs"
        yield text + doubt
