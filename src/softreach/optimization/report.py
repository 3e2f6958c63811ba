"""A search as report and table: the best in its ranges, what is missed, all that was judged."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

from softreach.arm.number import unit_suffix
from softreach.arm.written import with_suffix
from softreach.optimization.free_parameters import FreeParameter
from softreach.optimization.objectives import Goal, Value
from softreach.optimization.problem import NEAR
from softreach.support.errors import SoftreachError, counted
from softreach.support.report import Report, Section
from softreach.support.units import LengthUnit, readable, readable_unit

if TYPE_CHECKING:
    import pandas as pd

    from softreach.optimization.result import Search

__all__ = ["report_of", "table_of", "value_text"]

_PICTURE = (
    "Designs that were judged, in their order or by their objectives, and the free parameters "
    "of the best in their ranges."
)


def report_of(search: Search, unit: LengthUnit) -> Report:
    """All that a search came to, with lengths in a unit."""
    best, goals = search.best, search.goals
    rows = [
        (_goal_text(goal), value_text(goal, value, unit), "")
        for goal, value in zip(goals, best.objectives, strict=bool(best.objectives))
    ]
    ends = ", ".join(f"{name} at its {end} end" for name, end in search.at_ends.items())
    note = f"At an end of their range: {ends}. A wider one may be better." if ends else ""
    missed = sorted((x for x in search.findings if not x.met), key=lambda each: -each.excess)
    try:
        design = search.arm.to_toml()
    except SoftreachError as error:
        design = str(error)
    return Report(
        title="Search of designs",
        verdict=_verdict(search),
        state=search.verdict,
        facts=[
            f"{counted(search.designs, 'design')}, {search.seconds:.1f} s",
            *_remarks(search),
            *(best.fault.splitlines()[:1] if best.fault else map(str, missed)),
        ],
        sections=[
            Section(
                title="Best design",
                head=("number", "best", "range"),
                rows=[*rows, *_parameter_rows(search, unit)],
                note=note,
            ),
            Section(
                title="Requirements",
                head=("requirement", "", "of the best design"),
                rows=[(each.name, each.word, each.text) for each in search.findings],
                is_printed=False,
            ),
            *_front(search, unit),
            Section(title="Pictures", figures=lambda: _figures(search, unit)),
            Section(title="Provenance", rows=[*search.provenance.items()], is_printed=False),
            Section(title="The best design", text=design),
            Section(title="The requirements", text=search.problem.requirements.to_toml()),
        ],
    )


def _front(search: Search, unit: LengthUnit) -> Iterator[Section]:
    goals, free = search.goals, search.problem.parameters.free
    rows = []
    for number, each in enumerate(search.front, 1):
        pairs = zip(goals, each.objectives or [Value(math.nan)] * len(goals), strict=True)
        numbers = (_number_text(p, each.values[p.name], unit) for p in free)
        rows.append((str(number), *(value_text(*pair, unit) for pair in pairs), *numbers))
    if len(rows) > 1:
        yield Section(
            title="Front",
            head=("front", *map(_goal_text, goals), *(p.name for p in free)),
            rows=rows,
            note="Designs that no other one beats in every objective, each judged to full "
            "accuracy.",
        )


def _verdict(search: Search) -> str:
    needs, best = search.problem.requirements, search.best
    count = len(needs.targets) + len(needs.keeps) + len(needs.limits.given) + len(needs.measures)
    if math.isinf(best.excess) or best.fault:
        return "Search: no design that can be judged was found"
    if search.verdict != "met":
        number = len(best.missed if search.verdict == "missed" else best.undecided)
        return f"Search: requirements {search.verdict}, {number} of {count} by the best design"
    several = len(search.goals) > 1
    front = f"front of {counted(len(search.front), 'design')}" if several else "best design"
    return f"Search: {front}" + (f", {counted(count, 'requirement')} met" if count else "")


def _goal_text(goal: Goal) -> str:
    return f"{'largest' if goal.sense > 0 else 'least'} {goal.name}"


def value_text(goal: Goal, value: Value, unit: LengthUnit) -> str:
    """A value of an objective in a unit that people read, with its error."""
    if not math.isfinite(value.value):
        return "-"
    return readable(value.value, goal.objective.unit, unit, value.error)


def _parameter_rows(search: Search, unit: LengthUnit) -> Iterator[Sequence[str]]:
    """Value of the best and range of each free parameter, then those tied to them."""
    values, ends, parameters = search.best.values, search.at_ends, search.problem.parameters
    free = {parameter.name: parameter for parameter in parameters.free}
    for name, each in free.items():
        if each.choices:
            reach = f"one of {', '.join(_number_text(each, x, unit) for x in each.choices)}"
        else:
            low = each.low / readable_unit(each.unit, each.high, unit)[1]
            reach = f"{low:.5g} to {readable(each.high, each.unit, unit)}"
        end = f", at its {ends[name]} end" if name in ends else ""
        yield name, _number_text(each, values[name], unit) + end, reach
    for tie in parameters.ties:
        value = tie.factor * float(values[tie.of]) + tie.constant
        yield tie.name, _number_text(free[tie.of], value, unit), f"follows {tie.of}"


def _number_text(parameter: FreeParameter, value: float | str, unit: LengthUnit) -> str:
    return value if isinstance(value, str) else readable(value, parameter.unit, unit)


def _remarks(search: Search) -> Iterator[str]:
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
        said = f"{near} of {counted(count, 'restart')} ended within {100 * NEAR:g} % of it"
        doubt = "" if near > 1 else ": other seeds may find better designs; allow for more designs"
        yield f"how sure: {said}{doubt}"


def _figures(search: Search, unit: LengthUnit) -> Iterator[tuple[Any, str]]:
    from softreach.plot.arm import plot_check
    from softreach.plot.results import plot_search

    yield plot_search(search, unit=unit), _PICTURE
    if search.problem.requirements.targets or search.problem.requirements.keeps:
        with suppress(SoftreachError):  # nothing holds it under its loads
            caption = "The best design at the places that it must reach."
            yield plot_check(search.check, unit=unit).figure, caption


def table_of(search: Search, unit: LengthUnit, *, every: bool) -> pd.DataFrame:
    """A row for each design of the front, or for `every` one, with units in names of columns."""
    import pandas as pd

    records = []
    for number, each in enumerate(search.every if every else search.front, 1):
        record: dict[str, Any] = {
            "design": number,
            "front": int(any(each is one for one in search.front)),
            "fidelity": each.fidelity,
            "feasible": int(each.is_feasible),
            "excess": each.excess,
        }
        objectives = each.objectives or [Value(math.nan)] * len(search.goals)
        for goal, value in zip(search.goals, objectives, strict=True):
            suffix, size = _written_unit(goal.objective.unit, unit)
            record[f"{goal.name}{suffix}"] = value.value / size
            record[f"{goal.name}_error{suffix}"] = value.error / size
        for parameter in search.problem.parameters.free:
            suffix, size = _written_unit(parameter.unit, unit)
            value = each.values[parameter.name]
            value = value if isinstance(value, str) else value / size
            record[with_suffix(parameter.name, suffix)] = value
        records.append(record | {"missed": "; ".join(each.missed), "fault": each.fault})
    return pd.DataFrame.from_records(records)


def _written_unit(unit: str, length: LengthUnit) -> tuple[str, float]:
    """Suffix of a column, and the size of its unit; pressures stay in Pa."""
    if unit == "Pa":
        return "_pa", 1.0
    name, size = readable_unit(unit, 0.0, length)
    if unit not in ("m", "m2", "m3"):
        return unit_suffix(unit).replace("/", "_per_"), size
    return f"_{name.replace('²', '2').replace('³', '3')}", size
