"""Report of a calibration: one HTML file with its pictures inside, to be read offline."""

from __future__ import annotations

import io
from os import PathLike
from typing import TYPE_CHECKING, Any

from softreach.calibration.report import error_cells, error_head, number_rows, remarks
from softreach.support.arguments import as_flag, as_path
from softreach.support.files.atomic import writing
from softreach.support.files.formats import FileFormat, Formats, check_installed, format_of
from softreach.support.files.templates import page_template, png_source
from softreach.support.units import as_unit

if TYPE_CHECKING:
    from softreach.calibration.calibration import Calibration

__all__ = ["REPORT", "write_report"]

REPORT: Formats = {".html": FileFormat(("jinja2",), "paper")}
"""Formats of reports."""

_DPI = 160
_WORDS = {"softreach_version": "softreach", "data_sha256": "SHA-256 of the data"}


def write_report(
    result: Calibration, path: str | PathLike[str], unit: str | None, *, overwrite: bool
) -> None:
    """Write the numbers, errors, verdict and pictures of a calibration."""
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    format_of(path, REPORT)
    check_installed(("matplotlib", "plot"))
    template = page_template("softreach.calibration", "report.html.jinja")
    length = result.arm.length
    shown = result.arm.length_unit if unit is None else as_unit(unit, length)
    *notes, verdict = remarks(result, shown)
    page = template.render(
        numbers=list(number_rows(result, shown)),
        head=error_head(shown),
        errors=list(error_cells(result, shown)),
        notes=notes,
        limit=result.verdict.limit,
        verdict=verdict,
        picture=png_source(_picture(result, shown)),
        provenance=[(_WORDS.get(key, key), text) for key, text in result.provenance.items()],
        source=result.data.source,
        inputs=list(zip(result.arm.input_names, result.data.input_names, strict=True)),
        design=result.arm.to_toml(),
    )
    with writing(path, overwrite=overwrite) as file:
        file.write(page.encode())


def _picture(result: Calibration, unit: Any) -> bytes:
    from softreach.plot.calibration import plot_calibration
    from softreach.plot.style import pyplot

    figure, image = plot_calibration(result, unit=unit), io.BytesIO()
    figure.savefig(image, format="png", dpi=_DPI)
    pyplot().close(figure)
    return image.getvalue()
