"""Result of a search: the best designs with their numbers, and all that was judged."""

import math
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, get_args

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.arm.number import unit_suffix
from softreach.arm.parameters import with_suffix
from softreach.optimization.free_parameters import FreeParameter
from softreach.optimization.problem import NEAR, Candidate, Fidelity, Goal, Problem
from softreach.requirements.checks import Check
from softreach.requirements.findings import Finding, Verdict
from softreach.schema import provenance
from softreach.support.arguments import as_flag, as_path
from softreach.support.arrays import Array, over
from softreach.support.errors import SoftreachError, check_installed, counted
from softreach.support.files.atomic import StrPath, check_place
from softreach.support.files.text import write_table, write_text
from softreach.support.lazy import DataFrame, Dataset
from softreach.support.report import Report, Reported, Section
from softreach.support.units import LengthUnit, as_unit, readable, readable_unit
from softreach.support.versions import versions
from softreach.workspace.measure import Estimate

_AT_END = 1e-3  # of a range
_FOUND = "# Found by a search of softreach"
_FILES = ("best.toml", "front.csv", "candidates.csv", "report.html")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Search(Reported):
    """The best designs of a search."""

    problem: Problem
    """Parameters, requirements and goals of the search."""
    front: tuple[Candidate, ...]
    """Designs that no other beats in every objective, judged to full accuracy; for one objective
    the best alone. Without a design that meets all requirements, the one that misses least."""
    finalists: tuple[Candidate, ...]
    """All designs that were judged to full accuracy, those of the front among them."""
    candidates: tuple[Candidate, ...]
    """Everything that was judged on the way: by bounds alone, or on coarse sets."""
    designs: int
    """Designs that were looked at, those of polishes too."""
    seconds: float
    """Time of this run [s], without those that it went on from."""
    seed: int
    """Seed of the sampler."""
    sampler: str
    """Sampler of Optuna, as chosen."""

    @property
    def best(self) -> Candidate:
        """The first of the front."""
        return self.front[0]

    @property
    def verdict(self) -> Verdict:
        """Verdict on the best design under all requirements: met, missed or undecided."""
        if self.best.is_feasible:
            return "undecided" if self.best.undecided else "met"
        return "undecided" if {*self.best.missed} <= {*self.best.undecided} else "missed"

    @property
    def met(self) -> bool:
        """True if the best meets all requirements."""
        return self.verdict == "met"

    @property
    def restarts(self) -> tuple[int, int]:
        """Polishes from designs apart that meet all, and those within a tenth of the best."""
        if not (self.goals and self.best.is_feasible):
            return 0, 0
        ends = [each for each in self.candidates if each.designs > 1 and each.is_feasible]
        best, *costs = (np.array(self.problem.costs(each)) for each in (self.best, *ends))
        return len(ends), sum(np.allclose(each, best, rtol=NEAR, atol=0.0) for each in costs)

    @property
    def arm(self) -> Manipulator:
        """The design of the best."""
        return self.arms[0]

    @cached_property
    def arms(self) -> tuple[Manipulator, ...]:
        """The designs of the front.

        Raises:
            InvalidDesign: None that can exist was met.
        """
        return tuple(self.problem.parameters.arm(each.values) for each in self.front)

    @cached_property
    def check(self) -> Check:
        """The best against all requirements, to full accuracy."""
        return self.problem.case(self.best.values, self.problem.accuracy).check

    @cached_property
    def findings(self) -> tuple[Finding, ...]:
        """Findings of the check; empty where no such arm can exist, or nothing holds it."""
        try:
            return self.check.findings
        except SoftreachError:
            return ()

    @property
    def judged(self) -> dict[str, int]:
        """Number of candidates by what they were judged by: "bounds", "coarse", "full"."""
        ways = [each.fidelity for each in self.every]
        return {word: ways.count(word) for word in get_args(Fidelity)}

    @property
    def at_ends(self) -> dict[str, str]:
        """Free parameters of the best at an end of their range, which a wider one would move.

        Name -> "lower" or "upper".
        """
        ends = {}
        for p in (p for p in self.problem.parameters.free if not p.choices):
            value, near = float(self.best.values[p.name]), _AT_END * (p.high - p.low)
            if not p.low + near < value < p.high - near:
                ends[p.name] = "lower" if value <= p.low + near else "upper"
        return ends

    @property
    def provenance(self) -> dict[str, str]:
        """Version, objectives and numbers of designs behind the result."""
        judged = ", ".join(f"{count} {word}" for word, count in self.judged.items())
        goals = [f"{'max' if goal.sense > 0 else 'min'}imize {goal.name}" for goal in self.goals]
        about = {
            "softreach_version": str(versions()["softreach_version"]),
            "objectives": ", ".join(goals) or "none",
            "designs": f"{self.designs}, judged by {judged}",
            "accuracy": f"{self.problem.accuracy:g}, on the way {self.problem.coarse:g}",
        }
        return about | {
            "sampler": self.sampler,
            "seed": str(self.seed),
            "digest": self.problem.digest,
        }

    @property
    def goals(self) -> tuple[Goal, ...]:
        """Objectives with their senses."""
        return self.problem.goals

    def to_dataset(self) -> Dataset:
        """All designs over `design`: those on the way in their order, then those at full accuracy.

        Values over `parameter`, where a choice counts from 0, and over `objective`; `front` says
        which make up the front.
        """
        import xarray as xr

        every, free, goals = self.every, self.problem.parameters.free, self.goals
        arm, numbers = self.shown, self._numbers(every)
        about = {
            **provenance(arm),
            "length": arm.length,
            "display_unit": arm.display_unit or "",
            **self.provenance,
            "finalists": len(self.finalists),
        }
        looked_at = np.cumsum([each.designs for each in self.candidates], dtype=int)
        looked_at = [*looked_at, *[self.designs] * len(self.finalists)]
        rows = np.array([[p.number(each.values[p.name]) for p in free] for each in every])
        at = ("design", "objective")
        values = over(("design", "parameter"), value=rows)
        values |= over(at, objective_value=numbers[..., 0], objective_error=numbers[..., 1])
        values |= over("design", "1", excess=[each.excess for each in every])
        values |= over("design", feasible=[each.is_feasible for each in every])
        values |= over("design", front=[self._is_in_front(each) for each in every])
        values |= over("design", fidelity=np.array([each.fidelity for each in every], dtype=str))
        values |= over("design", fault=np.array([each.fault for each in every], dtype=str))
        values |= over("design", looked_at=looked_at)
        low, high = ([p.number(p.ends[k]) for p in free] for k in range(2))
        choices = [", ".join(map(str, p.choices)) for p in free]
        names = {"parameter": [p.name for p in free]}
        names |= over("parameter", parameter_unit=[p.unit for p in free], low=low, high=high)
        names |= over("parameter", choices=choices)
        names |= {"objective": np.array([goal.name for goal in goals], dtype=str)}
        names |= over("objective", objective_unit=[goal.objective.unit for goal in goals])
        names |= over("objective", sense=[goal.sense for goal in goals])
        return xr.Dataset(values, names, about)

    @property
    def shown(self) -> Manipulator:
        """The design of the best; its base where no such arm can exist."""
        try:
            return self.arm
        except SoftreachError:
            return self.problem.parameters.base

    def save(self, folder: StrPath, *, unit: str | None = None, overwrite: bool = False) -> None:
        """Write the best designs, tables of the front and of all candidates, and a report.

        `best.toml`, or `front_01.toml` and so on for several objectives, `front.csv`,
        `candidates.csv` and `report.html`; older ones of a search are replaced.

        Args:
            folder: The folder; it is made if it is not there.
            unit: Of lengths in tables and report: m, cm, mm or L; None for m in tables and a handy
                one in the report.
            overwrite: Whether they may replace any file.

        Raises:
            InvalidInput: Something else is there.
            NotWritten: They cannot be written.
            MissingExtra: matplotlib or Jinja2 is not installed.
        """
        place, overwrite = Path(as_path("folder", folder)), as_flag("overwrite", overwrite)
        check_folder(place, overwrite=overwrite)
        width, names = max(2, len(str(len(self.front)))), ["best.toml"]
        if len(self.goals) > 1:
            names = [f"front_{number:0{width}}.toml" for number, _ in enumerate(self.front, 1)]
        for name, each in zip(names, self.front, strict=True):
            with suppress(SoftreachError):  # no such arm can exist
                write_text(place / name, self._design_text(each), overwrite=overwrite)
        # Designs of an older search would be taken for designs of this one.
        for path in (*place.glob("front_*.toml"), place / "best.toml") if overwrite else ():
            with suppress(OSError):
                if path.name not in names and path.read_text("utf-8").startswith(_FOUND):
                    path.unlink()
        for name, every in (("front.csv", False), ("candidates.csv", True)):
            table = self.table(every=every, unit=unit or "m")
            write_table(place / name, table, overwrite=overwrite)
        self.report(unit).save(place / "report.html", overwrite=overwrite)

    def _design_text(self, each: Candidate) -> str:
        arm, unit = self.problem.parameters.arm(each.values), self.shown.length_unit
        pairs = zip(self.goals, each.objectives, strict=bool(each.objectives))
        numbers = {goal.name: _value_text(goal, value, unit) for goal, value in pairs}
        head = f"{_FOUND}{'' if each.is_feasible else '; it does not meet all requirements'}."
        lines = (f"# {key}: {text}" for key, text in [*numbers.items(), *self.provenance.items()])
        return "\n".join([head, *lines]) + f"\n\n{arm.file_text}"

    def table(self, *, every: bool = False, unit: str = "m") -> DataFrame:
        """Parameters and objectives with their errors, a row for each design of the front.

        Args:
            every: All candidates instead, in their order.
            unit: Of lengths: m, cm, mm or L.
        """
        import pandas as pd

        length = as_unit(unit, self.shown.length)
        designs = self.every if as_flag("every", every) else self.front
        columns: dict[str, Any] = {"design": range(1, len(designs) + 1)}
        columns["front"] = [int(self._is_in_front(each)) for each in designs]
        columns["fidelity"] = [each.fidelity for each in designs]
        columns["feasible"] = [int(each.is_feasible) for each in designs]
        columns["excess"] = [each.excess for each in designs]
        numbers = self._numbers(designs)
        for k, goal in enumerate(self.goals):
            suffix, size = _written_unit(goal.objective.unit, length)
            for word, column in zip(("", "_error"), numbers[:, k].T / size, strict=True):
                columns[f"{goal.name}{word}{suffix}"] = column
        for p in self.problem.parameters.free:
            suffix, size = _written_unit(p.unit, length)
            values = (each.values[p.name] for each in designs)
            values = (x if isinstance(x, str) else x / size for x in values)
            columns[with_suffix(p.name, suffix)] = list(values)
        columns["missed"] = ["; ".join(each.missed) for each in designs]
        return pd.DataFrame(columns | {"fault": [each.fault for each in designs]})

    def report(self, unit: str | None = None) -> Report:
        """Numbers, requirements, front and pictures, to be printed, or saved as an .html file.

        Args:
            unit: Of lengths: m, cm, mm or L; None for that of the design, or one that is handy.
        """
        arm = self.shown
        shown = arm.length_unit if unit is None else as_unit(unit, arm.length)
        missed = sorted((x for x in self.findings if not x.met), key=lambda each: -each.excess)
        fault = self.best.fault.splitlines()[:1] if self.best.fault else map(str, missed)
        head = ("requirement", "", "of the best design")
        rows = [(each.name, each.word, each.text) for each in self.findings]
        try:
            design = self.arm.to_toml()
        except SoftreachError as error:
            design = str(error)
        return Report(
            title="Search of designs",
            verdict=_verdict(self),
            state=self.verdict,
            facts=[*_remarks(self), *fault],
            sections=[
                _best(self, shown),
                Section(title="Requirements", head=head, rows=rows, printed=0),
                *_front(self, shown),
                Section(title="Pictures", figures=lambda: _figures(self, shown)),
                Section(title="Provenance", rows=[*self.provenance.items()], printed=0),
                Section(title="The best design", text=design),
                Section(title="The requirements", text=self.problem.requirements.to_toml()),
            ],
        )

    @property
    def every(self) -> tuple[Candidate, ...]:
        """All designs: those on the way in their order, then those at full accuracy."""
        return (*self.candidates, *self.finalists)

    def _is_in_front(self, candidate: Candidate) -> bool:
        return any(candidate is each for each in self.front)

    def _numbers(self, designs: Sequence[Candidate]) -> Array:
        """Objectives with their errors, NaN where there are none, shape (design, goal, 2)."""
        lacks = [Estimate(math.nan)] * len(self.goals)
        pairs = [each.objectives or lacks for each in designs]
        return np.array(pairs, float).reshape(len(designs), len(self.goals), 2)


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder that the files of a search could not be written to."""
    check_installed("matplotlib", "jinja2")
    for name in _FILES:
        check_place(folder / name, overwrite=overwrite, name="out")


def _best(search: Search, unit: LengthUnit) -> Section:
    pairs = zip(search.goals, search.best.objectives, strict=bool(search.best.objectives))
    rows = [(_goal_text(goal), _value_text(goal, value, unit), "") for goal, value in pairs]
    values, at_ends, parameters = search.best.values, search.at_ends, search.problem.parameters
    free = {parameter.name: parameter for parameter in parameters.free}
    for name, each in free.items():
        if each.choices:
            reach = f"one of {', '.join(_number_text(each, x, unit) for x in each.choices)}"
        else:
            low = each.low / readable_unit(each.unit, each.high, unit)[1]
            reach = f"{low:.5g} to {readable(each.high, each.unit, unit)}"
        end = f", at its {at_ends[name]} end" if name in at_ends else ""
        rows.append((name, _number_text(each, values[name], unit) + end, reach))
    for tie in parameters.ties:
        value = tie.factor * float(values[tie.of]) + tie.constant
        rows.append((tie.name, _number_text(free[tie.of], value, unit), f"follows {tie.of}"))
    ends = ", ".join(f"{name} at its {end} end" for name, end in at_ends.items())
    note = f"At an end of their range: {ends}. A wider range may be better." if ends else ""
    return Section(title="Best design", head=("number", "best", "range"), rows=rows, note=note)


def _front(search: Search, unit: LengthUnit) -> Iterator[Section]:
    goals, free = search.goals, search.problem.parameters.free
    rows = []
    for number, each in enumerate(search.front, 1):
        pairs = zip(goals, each.objectives or [Estimate(math.nan)] * len(goals), strict=True)
        numbers = (_number_text(p, each.values[p.name], unit) for p in free)
        rows.append((str(number), *(_value_text(*pair, unit) for pair in pairs), *numbers))
    if len(rows) > 1:
        head = ("front", *map(_goal_text, goals), *(p.name for p in free))
        note = "No design beats one of these in every objective; each is judged to full accuracy."
        yield Section(title="Front", head=head, rows=rows, note=note)


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


def _value_text(goal: Goal, value: Estimate, unit: LengthUnit) -> str:
    if not math.isfinite(value.value):
        return "-"
    return readable(value.value, goal.objective.unit, unit, value.error)


def _number_text(parameter: FreeParameter, value: float | str, unit: LengthUnit) -> str:
    return value if isinstance(value, str) else readable(value, parameter.unit, unit)


def _remarks(search: Search) -> Iterator[str]:
    problem, judged = search.problem, search.judged
    yield f"{counted(search.designs, 'design')}, {search.seconds:.1f} s"
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

    judged = "Designs that were judged, in their order or by their objectives"
    best = "the free parameters of the best in their ranges"
    yield plot_search(search, unit=unit), f"{judged}, and {best}."
    if search.problem.requirements.targets or search.problem.requirements.keeps:
        with suppress(SoftreachError):  # nothing holds it under its loads
            caption = "The best design at the places that it must reach."
            yield plot_check(search.check, unit=unit).figure, caption


def _written_unit(unit: str, length: LengthUnit) -> tuple[str, float]:
    """Suffix of a column, and the size of its unit; pressures stay in Pa."""
    if unit in ("m", "m2", "m3"):
        name, size = readable_unit(unit, 0.0, length)
        return f"_{name.replace('²', '2').replace('³', '3')}", size
    return unit_suffix(unit).replace("/", "_per_"), math.radians(1.0) if unit == "rad" else 1.0
