"""Files of a search: design files, tables of the front and of all candidates, a report."""

from __future__ import annotations

from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from softreach.arm.number import unit_suffix
from softreach.arm.parameters.shown import with_suffix
from softreach.optimization.html_report import check_libraries
from softreach.optimization.problem import Candidate
from softreach.optimization.report import shown_unit, value_text
from softreach.support.arguments import as_flag, as_path
from softreach.support.errors import SoftreachError
from softreach.support.files.atomic import check_place, writing
from softreach.support.files.formats import FileFormat, Formats, format_of
from softreach.support.units import LengthUnit, as_unit, readable_unit

if TYPE_CHECKING:
    import pandas as pd

    from softreach.optimization.result import Search

__all__ = ["TABLE", "check_folder", "design_table", "save", "write_table"]

_FOUND = "# Found by a search of softreach"

TABLE: Formats = {".csv": FileFormat()}
"""Formats of such tables."""

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
    names = _design_names(search)
    for name, each in zip(names, search.front, strict=True):
        if (text := _design_text(search, each)) is not None:
            with writing(place / name, overwrite=overwrite) as file:
                file.write(text.encode())
    if overwrite:
        _remove_older(place, names)
    search.save_table(place / "front.csv", unit=unit or "m", overwrite=overwrite)
    search.save_table(place / "candidates.csv", every=True, unit=unit or "m", overwrite=overwrite)
    search.save_report(place / "report.html", unit=unit, overwrite=overwrite)


def _design_names(search: Search) -> list[str]:
    if len(search.goals) < 2:
        return ["best.toml"]
    count = len(search.front)
    return [f"front_{number:0{max(2, len(str(count)))}}.toml" for number in range(1, count + 1)]


def _remove_older(folder: Path, names: list[str]) -> None:
    """Remove designs of an older search, which would be taken for designs of this one."""
    for path in (*folder.glob("front_*.toml"), folder / "best.toml"):
        with suppress(OSError):
            if path.name not in names and path.read_text("utf-8").startswith(_FOUND):
                path.unlink()


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


def write_table(
    search: Search, path: str | PathLike[str], unit: str, *, every: bool, overwrite: bool
) -> None:
    """Write `design_table` as CSV."""
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    length = float(str(search.attributes["length"]))
    table = design_table(search, as_unit(unit, length), every=as_flag("every", every))
    format_of(path, TABLE)
    with writing(path, overwrite=overwrite) as file:
        file.write(table.to_csv(index=False, float_format="%.9g", lineterminator="\n").encode())


def design_table(search: Search, unit: LengthUnit, *, every: bool) -> pd.DataFrame:
    """A row for each design of the front, or for every one, with units in the names of columns.

    Args:
        search: The search.
        unit: Of lengths.
        every: All candidates and finalists.
    """
    import pandas as pd

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
            suffix, size = _written_unit(goal.objective.unit, unit)
            record[f"{goal.name}{suffix}"] = None if pair[0] is None else pair[0] / size
            record[f"{goal.name}_error{suffix}"] = None if pair[1] is None else pair[1] / size
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
    if unit == "rad" or unit not in ("m", "m2", "m3"):
        return unit_suffix(unit).replace("/", "_per_"), size
    plain = name.replace("²", "2").replace("³", "3")
    return f"_{plain}", size
