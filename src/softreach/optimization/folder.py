"""Folder of a search: design files, tables of the front and of all candidates, a report."""

from __future__ import annotations

from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from softreach.optimization.problem import Candidate
from softreach.optimization.report import value_text
from softreach.support.arguments import as_flag, as_path
from softreach.support.errors import SoftreachError
from softreach.support.files.atomic import check_place
from softreach.support.files.text import write_table, write_text
from softreach.support.report import check_libraries

if TYPE_CHECKING:
    from softreach.optimization.result import Search

__all__ = ["check_folder", "save"]

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
        with suppress(SoftreachError):  # no such arm can exist
            write_text(place / name, _design_text(search, each), overwrite=overwrite)
    # Designs of an older search would be taken for designs of this one.
    for path in (*place.glob("front_*.toml"), place / "best.toml") if overwrite else ():
        with suppress(OSError):
            if path.name not in names and path.read_text("utf-8").startswith(_FOUND):
                path.unlink()
    for name, every in (("front", False), ("candidates", True)):
        table = search.table(every=every, unit=unit or "m")
        write_table(place / f"{name}.csv", table, overwrite=overwrite)
    search.report(unit).save(place / "report.html", overwrite=overwrite)


def _design_text(search: Search, each: Candidate) -> str:
    """A design file whose first lines say where it comes from.

    Raises:
        InvalidDesign: No such arm can exist.
    """
    arm = search.problem.parameters.arm(each.values)
    pairs = zip(search.goals, each.objectives, strict=bool(each.objectives))
    lines = [
        f"{_FOUND}{'' if each.is_feasible else '; it does not meet all requirements'}.",
        *(f"# {goal.name}: {value_text(goal, value, search.unit)}" for goal, value in pairs),
        *(f"# {key}: {text}" for key, text in search.provenance.items()),
    ]
    return "\n".join(lines) + f"\n\n{arm.file_text}"
