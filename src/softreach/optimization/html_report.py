"""Report of a search: one HTML file with its pictures inside, to be read offline."""

from __future__ import annotations

import io
from os import PathLike
from typing import TYPE_CHECKING, Any

from softreach.optimization.report import (
    front_rows,
    missed_text,
    objective_rows,
    parameter_rows,
    remarks,
    shown_unit,
    verdict,
)
from softreach.support.arguments import as_flag, as_path
from softreach.support.errors import SoftreachError, counted
from softreach.support.files.atomic import writing
from softreach.support.files.formats import FileFormat, Formats, check_installed, format_of
from softreach.support.files.templates import page_template, png_source
from softreach.support.units import as_unit

if TYPE_CHECKING:
    from softreach.optimization.result import Search

__all__ = ["REPORT", "check_libraries", "write_report"]

REPORT: Formats = {".html": FileFormat(("jinja2",), "paper")}
"""Formats of reports."""

_DPI = 160


def check_libraries() -> None:
    """Say which libraries of a report are missing.

    Raises:
        MissingExtra: matplotlib or Jinja2 is not installed.
    """
    check_installed(("matplotlib", "plot"), ("jinja2", "paper"))


def write_report(
    search: Search, path: str | PathLike[str], unit: str | None, *, overwrite: bool
) -> None:
    """Write the numbers, requirements, front and pictures of a search."""
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    format_of(path, REPORT)
    check_libraries()
    template = page_template("softreach.optimization", "report.html.jinja")
    length = float(str(search.attributes["length"]))
    shown = shown_unit(search, None if unit is None else as_unit(unit, length))
    several = len(search.front) > 1
    ends = [f"{name} at its {end} end" for name, end in search.at_ends.items()]
    page = template.render(
        verdict=verdict(search),
        state=search.verdict,
        facts=f"{counted(search.designs, 'design')}, {search.seconds:.1f} s",
        missed=list(missed_text(search)),
        objectives=list(objective_rows(search, shown)) if search.best.objectives else [],
        parameters=list(parameter_rows(search, shown)),
        ends=ends,
        findings=[(each.name, each.verdict, each.text) for each in search.findings],
        front=list(front_rows(search, shown)) if several else [],
        notes=list(remarks(search)),
        picture=png_source(_picture(search, shown)),
        check=_check_picture(search, shown),
        provenance=list(search.provenance.items()),
        requirements=search.problem.requirements.to_toml(),
        design=_design(search),
    )
    with writing(path, overwrite=overwrite) as file:
        file.write(page.encode())


def _design(search: Search) -> str:
    try:
        return search.arm.to_toml()
    except SoftreachError as error:
        return str(error)


def _picture(search: Search, unit: Any) -> bytes:
    from softreach.plot.search import plot_search

    return _png(plot_search(search, unit=unit))


def _check_picture(search: Search, unit: Any) -> str:
    """The best design at its targets, where there are some that it can be drawn at."""
    from softreach.plot.check import plot_check

    needs = search.problem.requirements
    if not (needs.targets or needs.keeps):
        return ""
    try:
        return png_source(_png(plot_check(search.check, unit=unit).figure))
    except SoftreachError:  # nothing holds it under its loads
        return ""


def _png(figure: Any) -> bytes:
    from softreach.plot.style import pyplot

    image = io.BytesIO()
    figure.savefig(image, format="png", dpi=_DPI)
    pyplot().close(figure)
    return image.getvalue()
