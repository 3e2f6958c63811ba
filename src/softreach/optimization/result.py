"""Result of a search: the best designs with their numbers, and all that was judged."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np

from softreach.arm.manipulator import Manipulator
from softreach.optimization.objectives import Goal
from softreach.optimization.problem import NEAR, Candidate, Problem
from softreach.requirements.checks import Check
from softreach.requirements.findings import Finding, Verdict
from softreach.schema import provenance
from softreach.support.arguments import as_flag
from softreach.support.errors import SoftreachError
from softreach.support.report import Report
from softreach.support.units import LengthUnit, as_unit, handy_unit
from softreach.support.versions import versions

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

__all__ = ["Search"]

_AT_END = 1e-3  # of a range


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Search:
    """The best designs of a search."""

    problem: Problem
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
    """Time of this run, without those that it went on from."""
    seed: int
    sampler: str
    """Sampler of Optuna, as chosen."""

    @property
    def best(self) -> Candidate:
        """The first of the front."""
        return self.front[0]

    @property
    def verdict(self) -> Verdict:
        """Of the best under all requirements: met, missed or undecided."""
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
        best = np.array(self.problem.costs(self.best))
        ends = [each for each in self.candidates if each.designs > 1 and each.is_feasible]
        apart = [np.abs(np.array(self.problem.costs(each)) - best) for each in ends]
        return len(ends), sum(bool((each <= NEAR * np.abs(best)).all()) for each in apart)

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
        ways = [each.fidelity for each in self.candidates]
        ways += [each.fidelity for each in self.finalists if each.fidelity == "full"]
        return {word: ways.count(word) for word in ("bounds", "coarse", "full")}

    @property
    def at_ends(self) -> dict[str, str]:
        """Free parameters of the best at an end of their range, which a wider one would move.

        Name -> "lower" or "upper".
        """
        ends = {}
        for parameter in self.problem.parameters.free:
            if parameter.choices:
                continue
            value, near = float(self.best.values[parameter.name]), parameter.high - parameter.low
            if value <= parameter.low + _AT_END * near:
                ends[parameter.name] = "lower"
            elif value >= parameter.high - _AT_END * near:
                ends[parameter.name] = "upper"
        return ends

    @property
    def provenance(self) -> dict[str, str]:
        """Version, objectives and numbers of designs behind the result."""
        judged = ", ".join(f"{count} {word}" for word, count in self.judged.items())
        goals = [f"{'max' if goal.sense > 0 else 'min'}imize {goal.name}" for goal in self.goals]
        return {
            "softreach_version": str(versions()["softreach_version"]),
            "objectives": ", ".join(goals) or "none",
            "designs": f"{self.designs}, judged by {judged}",
            "accuracy": f"{self.problem.accuracy:g}, on the way {self.problem.coarse:g}",
            "sampler": self.sampler,
            "seed": str(self.seed),
            "digest": self.problem.digest,
        }

    @property
    def goals(self) -> tuple[Goal, ...]:
        """Objectives with their senses."""
        return self.problem.goals

    def to_dataset(self) -> xr.Dataset:
        """All designs over `design`: those on the way in their order, then those at full accuracy.

        Values over `parameter`, where a choice counts from 0, and over `objective`; `front` says
        which make up the front, and `coarse_design` which earlier design one at full accuracy is.
        """
        import xarray as xr

        every = self.every
        free, goals = self.problem.parameters.free, self.goals
        names = self.problem.parameters.names
        places = {_key(each, names): k for k, each in enumerate(self.candidates)}
        ways = len(self.candidates)
        coarse = [-1] * ways + [places.get(_key(each, names), -1) for each in self.finalists]
        values = [[p.number(each.values[p.name]) for p in free] for each in every]
        pairs = [each.objectives or [(math.nan, math.nan)] * len(goals) for each in every]
        shape = len(every), len(goals), 2
        numbers = np.array([[[*pair] for pair in row] for row in pairs], float).reshape(shape)
        looked_at = np.cumsum([each.designs for each in self.candidates], dtype=int)
        return xr.Dataset(
            {
                "value": (("design", "parameter"), np.array(values)),
                "objective_value": (("design", "objective"), numbers[..., 0]),
                "objective_error": (("design", "objective"), numbers[..., 1]),
                "excess": ("design", [each.excess for each in every], {"units": "1"}),
                "feasible": ("design", [each.is_feasible for each in every]),
                "front": ("design", [any(each is one for one in self.front) for each in every]),
                "fidelity": ("design", np.array([each.fidelity for each in every], dtype=str)),
                "looked_at": ("design", [*looked_at, *[self.designs] * len(self.finalists)]),
                "coarse_design": ("design", coarse),
                "fault": ("design", np.array([each.fault for each in every], dtype=str)),
            },
            {
                "parameter": [p.name for p in free],
                "parameter_unit": ("parameter", [p.unit for p in free]),
                "low": ("parameter", [p.number(p.ends[0]) for p in free]),
                "high": ("parameter", [p.number(p.ends[1]) for p in free]),
                "choices": ("parameter", [", ".join(map(str, p.choices)) for p in free]),
                "objective": np.array([goal.name for goal in goals], dtype=str),
                "objective_unit": ("objective", [goal.objective.unit for goal in goals]),
                "sense": ("objective", [goal.sense for goal in goals]),
            },
            {**self.attributes, **self.provenance, "finalists": len(self.finalists)},
        )

    @property
    def attributes(self) -> dict[str, object]:
        """Length of the best and the unit that it is shown in; those of the base without one."""
        try:
            arm = self.arm
        except SoftreachError:
            arm = next(iter(self.problem.parameters.bases.values()))
        return {**provenance(arm), "length": arm.length, "display_unit": arm.display_unit or ""}

    def save(
        self, folder: str | PathLike[str], *, unit: str | None = None, overwrite: bool = False
    ) -> None:
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
        from softreach.optimization.folder import save

        save(self, folder, unit, overwrite=overwrite)

    def table(self, *, every: bool = False, unit: str = "m") -> pd.DataFrame:
        """Parameters and objectives with their errors, a row for each design of the front.

        Args:
            every: All candidates instead, in their order.
            unit: Of lengths: m, cm, mm or L.
        """
        from softreach.optimization.report import table_of

        return table_of(self, as_unit(unit, self._length), every=as_flag("every", every))

    def report(self, unit: str | None = None) -> Report:
        """Numbers, requirements, front and pictures, to be printed, or saved as an .html file.

        Args:
            unit: Of lengths: m, cm, mm or L; None for that of the design, or one that is handy.
        """
        from softreach.optimization.report import report_of

        return report_of(self, self.unit if unit is None else as_unit(unit, self._length))

    @property
    def unit(self) -> LengthUnit:
        """Unit of lengths that the design is shown in, or one that is handy."""
        shown = str(self.attributes["display_unit"]) or handy_unit(self._length)
        return as_unit(shown, self._length)

    @property
    def _length(self) -> float:
        return float(str(self.attributes["length"]))

    @property
    def every(self) -> tuple[Candidate, ...]:
        """All designs: those on the way in their order, then those at full accuracy."""
        return (*self.candidates, *self.finalists)

    def __repr__(self) -> str:
        return str(self.report())

    def _repr_html_(self) -> str:
        """The best design beside the text, for notebooks."""
        from html import escape

        from softreach.arm.skin import arm_card

        try:
            card = arm_card(self.arm, self.arm.base)
        except SoftreachError:  # no arm can exist
            card = ""
        return f"{card}<pre>{escape(repr(self))}</pre>"


def _key(candidate: Candidate, names: Sequence[str]) -> tuple[float | str, ...]:
    return tuple(candidate.values[name] for name in names)
