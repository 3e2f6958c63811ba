"""Files of a search: design files, tables of the front and of all candidates, a report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from softreach.arm.number import unit_suffix
from softreach.arm.parameters import with_suffix
from softreach.optimization.problem import Candidate
from softreach.optimization.report import (
    front_rows,
    missed_text,
    objective_rows,
    parameter_rows,
    remarks,
    shown_unit,
    value_text,
    verdict,
)
from softreach.support.arguments import as_flag, as_path
from softreach.support.errors import SoftreachError, counted
from softreach.support.files.atomic import check_place, writing
from softreach.support.files.formats import TABLES, format_of
from softreach.support.report import REPORT, Section, check_libraries, figure_source, write_page
from softreach.support.units import LengthUnit, as_unit, readable_unit

if TYPE_CHECKING:
    from softreach.optimization.result import Search

__all__ = ["check_folder", "save", "write_report", "write_table"]

_FOUND = "# Found by a search of softreach"

_FILES = ("best.toml", "front.csv", "candidates.csv", "report.html")


def check_folder(folder: Path, *, overwrite: bool) -> None:
    """Refuse a folder that the files of a search could not be written to.

    Raises:
        InvalidInput: Something else is there.
        NotWritten: Nothing can be written there.
        MissingExtra: matplotlib or Jinja2 is not installed.
    """
    check_libraries()
    for name in _FILES:
        check_place(folder / name, overwrite=overwrite, name="out")


def save(search: Search, folder: str | PathLike[str], unit: str | None, *, overwrite: bool) -> None:
    """Write all files of a search into a folder."""
    place, overwrite = Path(as_path("folder", folder)), as_flag("overwrite", overwrite)
    check_folder(place, overwrite=overwrite)
    count = len(search.front)
    width = max(2, len(str(count)))
    several = [f"front_{number:0{width}}.toml" for number in range(1, count + 1)]
    names = several if len(search.goals) > 1 else ["best.toml"]
    for name, each in zip(names, search.front, strict=True):
        if (text := _design_text(search, each)) is not None:
            with writing(place / name, overwrite=overwrite) as file:
                file.write(text.encode())
    # Designs of an older search would be taken for designs of this one.
    for path in (*place.glob("front_*.toml"), place / "best.toml") if overwrite else ():
        with suppress(OSError):
            if path.name not in names and path.read_text("utf-8").startswith(_FOUND):
                path.unlink()
    search.save_table(place / "front.csv", unit=unit or "m", overwrite=overwrite)
    search.save_table(place / "candidates.csv", every=True, unit=unit or "m", overwrite=overwrite)
    search.save_report(place / "report.html", unit=unit, overwrite=overwrite)


def _design_text(search: Search, each: Candidate) -> str | None:
    """A design file whose first lines say where it comes from; None if no such arm can exist."""
    try:
        arm = search.problem.parameters.arm(each.values)
    except SoftreachError:
        return None
    unit = shown_unit(search)
    objectives = (
        f"{goal.name}: {value_text(goal, value, unit)}"
        for goal, value in zip(search.goals, each.objectives, strict=bool(each.objectives))
    )
    lines = [
        f"{_FOUND}{'' if each.is_feasible else '; it does not meet all requirements'}.",
        *objectives,
        *(f"{key}: {text}" for key, text in search.provenance.items()),
    ]
    head = "\n".join(line if line.startswith("#") else f"# {line}" for line in lines)
    return f"{head}\n\n{arm.file_text}"


def write_report(
    search: Search, path: str | PathLike[str], unit: str | None, *, overwrite: bool
) -> None:
    """Write the numbers, requirements, front and pictures of a search as one HTML file."""
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    format_of(path, REPORT)
    check_libraries()
    length = float(str(search.attributes["length"]))
    shown = shown_unit(search, None if unit is None else as_unit(unit, length))
    sections = [Section(points=[*missed_text(search)]), *_sections(search, shown)]
    page, title = "softreach search", "Search of designs"
    facts = f"{counted(search.designs, 'design')}, {search.seconds:.1f} s. "
    facts += f"{'. '.join(remarks(search))}."
    head = {"page": page, "title": title, "facts": facts}
    write_page(
        path, sections, overwrite=overwrite, state=search.verdict, verdict=verdict(search), **head
    )


def _sections(search: Search, unit: LengthUnit) -> Iterator[Section]:
    rows: list[Sequence[str]] = []
    if search.best.objectives:
        rows += [(name, value, "") for name, value in objective_rows(search, unit)]
    ends = ", ".join(f"{name} at its {end} end" for name, end in search.at_ends.items())
    note = f"At an end of their range: {ends}. A wider range may allow a better design."
    yield Section(
        title="Best design",
        head=("number", "best", "range"),
        rows=[*rows, *parameter_rows(search, unit)],
        note=note if ends else "",
    )
    if found := search.findings:
        words = {"met": "met", "missed": "MISSED", "undecided": "UNDECIDED"}
        rows = [(each.name, words[each.verdict], each.text) for each in found]
        head = ("requirement", "", "of the best design")
        yield Section(title="Requirements", head=head, rows=rows)
    if len(search.front) > 1:
        head, *rows = front_rows(search, unit)
        note = "Designs that no other one beats in every objective, each judged to full accuracy."
        yield Section(title="Front", head=head, rows=rows, note=note)
    yield Section(title="Pictures", pictures=[*_pictures(search, unit)])
    yield Section(title="Provenance", rows=[*search.provenance.items()])
    try:
        design = search.arm.to_toml()
    except SoftreachError as error:
        design = str(error)
    yield Section(title="The best design", text=design)
    yield Section(title="The requirements", text=search.problem.requirements.to_toml())


def _pictures(search: Search, unit: LengthUnit) -> Iterator[tuple[str, str, str]]:
    from softreach.plot.check import plot_check
    from softreach.plot.search import plot_search

    yield (
        figure_source(plot_search(search, unit=unit)),
        "Designs that were judged, and the best in the ranges of the free parameters",
        "Designs that were judged, in their order or by their objectives, and the free parameters "
        "of the best in their ranges.",
    )
    if search.problem.requirements.targets or search.problem.requirements.keeps:
        with suppress(SoftreachError):  # nothing holds it under its loads
            caption = "The best design at the places that it must reach"
            yield figure_source(plot_check(search.check, unit=unit).figure), caption, f"{caption}."


def write_table(
    search: Search, path: str | PathLike[str], unit: str, *, every: bool, overwrite: bool
) -> None:
    """Write a row for each design of the front, or for `every` one, units in names of columns."""
    import pandas as pd

    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    format_of(path, TABLES)
    shown = as_unit(unit, float(str(search.attributes["length"])))
    every = as_flag("every", every)
    rows = (*search.candidates, *search.finalists) if every else search.front
    records = []
    for number, each in enumerate(rows, 1):
        record: dict[str, object] = {
            "design": number,
            "front": int(any(each is one for one in search.front)),
            "fidelity": each.fidelity,
            "feasible": int(each.is_feasible),
            "excess": each.excess,
        }
        for k, goal in enumerate(search.goals):
            pair = each.objectives[k] if each.objectives else (None, None)
            suffix, size = _written_unit(goal.objective.unit, shown)
            record[f"{goal.name}{suffix}"] = None if pair[0] is None else pair[0] / size
            record[f"{goal.name}_error{suffix}"] = None if pair[1] is None else pair[1] / size
        for parameter in search.problem.parameters.free:
            suffix, size = _written_unit(parameter.unit, shown)
            value = each.values[parameter.name]
            value = value if isinstance(value, str) else value / size
            record[with_suffix(parameter.name, suffix)] = value
        records.append(record | {"missed": "; ".join(each.missed), "fault": each.fault})
    text = pd.DataFrame.from_records(records).to_csv(
        index=False, float_format="%.9g", lineterminator="\n"
    )
    with writing(path, overwrite=overwrite) as file:
        file.write(text.encode())


def _written_unit(unit: str, length: LengthUnit) -> tuple[str, float]:
    """Suffix of a column, and the size of its unit; pressures stay in Pa."""
    if unit == "Pa":
        return "_pa", 1.0
    name, size = readable_unit(unit, 0.0, length)
    if unit == "rad" or unit not in ("m", "m2", "m3"):
        return unit_suffix(unit).replace("/", "_per_"), size
    plain = name.replace("²", "2").replace("³", "3")
    return f"_{plain}", size
