"""`softreach check` and `search`: a design against what it is for, and designs that meet it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import softreach as sr
from softreach.cli import options
from softreach.cli.console import as_read, console, fields_of, for_machines
from softreach.cli.options import UNCHANGED, Changes, Number, Whole, design_from, shown_in
from softreach.support import progress
from softreach.support.files.text import read_text
from softreach.support.units import to_degrees

_EXIT = {"met": 0, "missed": 1, "undecided": 3}  # verdict -> exit code; 2 is that of wrong input


def check(
    design: options.Design,
    needs: Path,
    /,
    *,
    accuracy: Number = 1e-2,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    view: options.View = None,
    output: options.Output = options.DEFAULT,
) -> int:
    """Check a design against requirements: met or missed, and by how much.

    Judges places to reach, regions to stay in or to avoid, payloads, limits and
    measures; prints how far each is missed, which bounds hold the arm back and
    what would help. A requirement is undecided if its margin is smaller than the
    error of that. The exit code is 0 if all is met, 1 if something is missed, and
    3 if something is undecided.

    Example: softreach check arm.toml needs.toml --out check.png

    Args:
        needs: Requirements (.toml).
        accuracy: Accuracy of coverages and volumes.
        out: Draw the arm at the places (.png .pdf .svg).
    """
    arm = design_from(design, changes, output.unit)
    options.check_picture(out, output.overwrite, view=view)
    requirements = sr.Requirements.load(needs, length=arm.length)
    with progress.bar("checking", None) as step:
        result = sr.check(arm, requirements, accuracy=accuracy, progress=step)
    if output.json:
        console.json(_checked(result))
    else:
        console.line(result)
    if out is not None:
        axes: Any = sr.plot.plot_check(result, view=view or "oblique", unit=arm.length_unit)
        options.save_picture(axes.figure, out, output.overwrite)
    return _EXIT[result.verdict]


def _checked(result: sr.requirements.Check) -> dict[str, Any]:
    names = ("met", "verdict", "excess", "places", "gaps", "poses", "effort")
    fields = fields_of({name: getattr(result, name) for name in names}, "places", "gaps")
    fields["direction_errors"] = to_degrees(result.direction_errors), "deg"
    known: Any = {
        "payloads_kg": result.payloads,
        "findings": [{**vars(each), "met": each.met} for each in result.findings],
        "coverages": [coverage._asdict() for coverage in result.coverages],
    }
    return for_machines(fields, result.arm.length) | known


def search(
    needs: Path,
    /,
    *,
    point: str | None = None,
    designs: Annotated[Whole | None, Parameter(name=("--designs", "-n"))] = None,
    seed: Whole | None = None,
    storage: Path | None = None,
    out: options.Place = Path("best"),
    output: options.Output = options.DEFAULT,
) -> int:
    """Search for the best designs that meet requirements.

    Writes the designs as files, with tables and a report. After an interruption the
    same command continues. The exit code is 0 if the best meets all requirements,
    1 if it misses one, and 3 if one is undecided.

    Example: softreach search needs.toml --seed 1 --out best

    Args:
        needs: Requirements (.toml), with a table [search].
        point: Marker that counts as the tip, such as that of a tool.
        designs: Number of designs to look at, instead of what the file says, or 200.
        seed: Seed of the search, instead of what the file says.
        storage: Journal of all designs, to resume a search or to share it
            with other seeds. FOLDER/search.journal if left out.
        out: Folder for the designs, tables and report.
    """
    from softreach.optimization.result import check_folder
    from softreach.optimization.search_file import read_search
    from softreach.requirements.requirements import LONGEST

    text, given = read_text("requirements", needs, LONGEST), {"designs": designs, "seed": seed}
    designs_from = partial(design_from, changes=Changes(point=point))
    asked = read_search(text, needs.parent, designs_from, str(needs))
    asked |= {name: value for name, value in given.items() if value is not None}
    base = asked["base"]
    arm = shown_in(output.unit, next(iter(base.values())) if isinstance(base, Mapping) else base)
    check_folder(out, overwrite=output.overwrite)
    if storage is None:
        out.mkdir(parents=True, exist_ok=True)
        storage = out / "search.journal"
    watch = _Watch()
    with progress.bar(watch.label, asked.get("designs", 200)) as step:
        result = sr.search(**asked, storage=storage, follow=watch, progress=step)
    if output.json:
        console.json(_found(result, out))
    else:
        console.line(result.report(arm.length_unit.name))
    result.save(out, unit=arm.display_unit, overwrite=output.overwrite)
    return _EXIT[result.verdict]


class _Watch:
    _met, _excess = 0, math.inf

    def __call__(self, candidate: sr.optimization.Candidate) -> None:
        self._met += candidate.is_feasible
        if candidate.fidelity != "bounds":  # whose excess is at least that, and may be more
            self._excess = min(self._excess, candidate.excess or math.inf)

    def label(self) -> str:
        if self._met:
            return f"searching, {self._met} meet all"
        return "searching" + f", best misses {self._excess:.3g}" * math.isfinite(self._excess)


def _found(result: sr.optimization.Search, out: Path) -> dict[str, Any]:
    front = []
    for each in result.front:
        known = {"excess": each.excess, "missed": dict(each.missed), "fault": each.fault}
        pairs = zip(result.goals, each.objectives, strict=bool(each.objectives))
        known["objectives"] = [
            {"objective": goal.name, **value._asdict(), "unit": goal.objective.unit}
            for goal, value in pairs
        ]
        known["parameters"] = []
        for p in result.problem.parameters.free:
            value = each.values[p.name]
            read, unit = (value, "") if isinstance(value, str) else as_read(value, p.unit)
            known["parameters"].append({"parameter": p.name, "value": read, "unit": unit})
        front.append(known)
    names = ("met", "verdict", "restarts", "designs", "judged", "seconds", "at_ends")
    findings = [{**vars(each), "met": each.met} for each in result.findings]
    named = {name: getattr(result, name) for name in names}
    return {**named, "front": front, "findings": findings, "folder": str(out)}
