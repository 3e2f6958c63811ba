"""A calibration as text, report and table: numbers, errors of places beside those of rivals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from os import PathLike
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from softreach.arm.number import unit_suffix
from softreach.calibration.errors import Misses
from softreach.calibration.free_numbers import POSE, FreeNumbers
from softreach.support.arguments import as_flag, as_path
from softreach.support.errors import counted
from softreach.support.files.atomic import writing
from softreach.support.files.formats import TABLES, format_of
from softreach.support.quantity import columns, quantity
from softreach.support.report import REPORT, Section, check_libraries, figure_source, write_page
from softreach.support.units import LengthUnit, as_unit, readable_unit

if TYPE_CHECKING:
    from softreach.calibration.calibration import Calibration

__all__ = [
    "ErrorRow",
    "error_cells",
    "error_head",
    "error_rows",
    "number_rows",
    "remarks",
    "sigma_rows",
    "summary_text",
    "write_report",
    "write_table",
]

_MOST_ROWS = 10
_PICTURE = (
    "Measured and predicted places in space; errors by marker, in order of time and against each "
    "input",
    "Measured places and the lines to the predicted ones; errors by marker, in the order in which "
    "samples were taken, and against each input.",
)
_WORDS = {"softreach_version": "softreach", "data_sha256": "SHA-256 of the data"}


class ErrorRow(NamedTuple):
    """Errors of one law on some samples."""

    law: str
    samples: str
    """Those of which the errors are."""
    errors: Misses


def summary_text(result: Calibration, unit: LengthUnit | None = None) -> str:
    """All that a calibration found, in lines.

    Args:
        result: The calibration.
        unit: Of lengths; None for that of the design, or one that is handy.
    """
    unit = unit or result.arm.length_unit
    fitted = len(result.data) - int(result.held.sum())
    markers = ", ".join(result.data.marker_names)
    lines = [
        f"{counted(len(result.names), 'number')} from {counted(fitted, 'sample')} of {markers}, "
        f"{result.seconds:.1f} s",
        *columns([("number", "calibrated", "design"), *number_rows(result, unit)]),
        *columns([error_head(unit), *error_cells(result, unit)]),
        *remarks(result, unit),
    ]
    return "\n  ".join(lines)


def number_rows(result: Calibration, unit: LengthUnit) -> Iterator[tuple[str, str, str]]:
    """Name, value ± standard deviation and value of the design of each free number."""
    fit, widths = result.fit, result.uncertainty.sigma.tolist()
    pairs = zip(fit.free.numbers, fit.values.tolist(), widths, fit.at_bound, strict=True)
    place = (*result.start.base.position, 0.0, 0.0, 0.0)
    pose: dict[str, float] = {name: at for name, at in zip(POSE, place, strict=True)}
    for number, value, sigma, at_bound in pairs:
        name, size = readable_unit(number.unit, value, unit)
        text = quantity(value / size, name, sigma / size, digits=2)
        text += ", at its bound" if at_bound else ", with its prior" if number.prior else ""
        text += ", which the data does not tell" if sigma == math.inf else ""
        # The pose starts from the data and not from the design.
        yield number.name, text, f"{pose.get(number.name, number.start) / size:.4g}"


def sigma_rows(
    free: FreeNumbers, sigma: Iterable[float], unit: LengthUnit
) -> Iterator[tuple[str, str, str]]:
    """Name, value of the design ± a standard deviation, and their ratio, of each number."""
    for number, width in zip(free.numbers, sigma, strict=True):
        name, size = readable_unit(number.unit, number.start, unit)
        share = f"{100 * width / abs(number.start):.2g} %" if number.start else "-"
        yield number.name, quantity(number.start / size, name, width / size, digits=2), share


def error_rows(result: Calibration) -> Iterator[ErrorRow]:
    """Errors of the calibrated arm, of the design, and of rivals on the same samples."""
    held = int(result.held.sum())
    fitted = f"{len(result.data) - held} fitted"
    yield ErrorRow("calibrated", fitted, result.train)
    on = f"{held} held out" if held else fitted
    if held:
        yield ErrorRow("calibrated", on, result.held_out)
    yield ErrorRow("design, base fitted", on, result.before)
    for rival in result.rivals:
        law = f"{rival.name}, {counted(rival.numbers, 'number')}"
        yield ErrorRow(law, on, rival.held_out if held else rival.train)


def error_head(unit: LengthUnit) -> tuple[str, ...]:
    """Heading of `error_cells`."""
    return (unit.label("error of places"), "samples", "rms", "median", "95 % below", "rms / L")


def error_cells(result: Calibration, unit: LengthUnit) -> Iterator[tuple[str, ...]]:
    """The same in words: law, samples, and errors in a unit and in L."""
    for law, samples, errors in error_rows(result):
        values = (errors.rms, errors.median, errors.most)
        texts = (f"{value / unit.size:.3g}" if math.isfinite(value) else "-" for value in values)
        share = f"{100.0 * errors.rms / result.arm.length:.2g} %"
        yield law, samples, *texts, share if math.isfinite(errors.rms) else "-"


def remarks(result: Calibration, unit: LengthUnit) -> Iterator[str]:
    """Remarks on a calibration: oddities and limitations."""
    if len(result.data.marker_names) > 1:
        each = ((name, errors.rms / unit.size) for name, errors in result.by_marker.items())
        listed = ", ".join(f"{name} {rms:.3g}" for name, rms in each)
        yield f"{unit.label('rms')} of each marker: {listed}"
    for one, other, share in result.correlated[:3]:
        yield f"hardly told apart: {one} and {other} (correlation {share:+.3f})"
    if len(far := result.outliers):
        rows = ", ".join(map(str, far[:_MOST_ROWS])) + (", ..." if len(far) > _MOST_ROWS else "")
        yield f"{counted(len(far), 'sample')} far off, rows below the header from 0: {rows}"
    yield result.verdict.sentence


def write_report(
    result: Calibration, path: str | PathLike[str], unit: str | None, *, overwrite: bool
) -> None:
    """Write the numbers, errors, verdict and pictures of a calibration as one HTML file."""
    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    format_of(path, REPORT)
    check_libraries()
    from softreach.plot.calibration import plot_calibration

    arm, data = result.arm, result.data
    shown = arm.length_unit if unit is None else as_unit(unit, arm.length)
    *notes, verdict = remarks(result, shown)
    picture = figure_source(plot_calibration(result, unit=shown))
    origin = [(_WORDS.get(key, key), text) for key, text in result.provenance.items()]
    for name, column in zip(arm.input_names, data.input_names, strict=True):
        origin.append((f"input {name}", f"column {column}" if column else "stays at 0"))
    head = ("number", "calibrated ± standard deviation", "design")
    sections = [
        Section(title="Numbers", head=head, rows=[*number_rows(result, shown)]),
        Section(
            title="Errors",
            head=error_head(shown),
            rows=[*error_cells(result, shown)],
            note="Distances between measured and predicted places of the markers. Samples that are "
            "held out were not seen by any fit.",
            points=notes,
        ),
        Section(title="Pictures", pictures=[(picture, *_PICTURE)]),
        Section(title="Provenance", rows=origin),
        Section(title="The calibrated design", text=arm.to_toml()),
    ]
    title, state = f"Calibration from {data.source}", result.verdict.limit
    page = f"softreach calibration: {data.source}"
    write_page(
        path,
        sections,
        overwrite=overwrite,
        page=page,
        title=title,
        facts="",
        state=state,
        verdict=verdict,
    )


def write_table(
    result: Calibration, path: str | PathLike[str], unit: str, *, overwrite: bool
) -> None:
    """Write a row for each sample, in the order of the data, with units in names of columns."""
    import pandas as pd

    path, overwrite = as_path("path", path), as_flag("overwrite", overwrite)
    format_of(path, TABLES)
    data, arm = result.data, result.arm
    shown = as_unit(unit, arm.length)
    table: dict[str, object] = {
        "row": data.rows,
        "run": np.array(data.run_names)[data.runs],
        "held_out": result.held.astype(int),
    }
    for k, (name, own) in enumerate(zip(arm.input_names, arm.input_units, strict=True)):
        table[f"{name}{unit_suffix(own)}"] = data.inputs[:, k]
    predicted = data.places + result.residuals
    distance = np.linalg.norm(result.residuals, axis=2)
    for m, marker in enumerate(data.marker_names):
        for words, places in (("", data.places), ("predicted_", predicted)):
            for axis in range(3):
                values = shown.of(places[:, m, axis])
                table[f"{marker}_{words}{'xyz'[axis]}_{shown.name}"] = values
        table[f"{marker}_error_{shown.name}"] = shown.of(distance[:, m])
    text = pd.DataFrame(table).to_csv(index=False, float_format="%.9g", lineterminator="\n")
    with writing(path, overwrite=overwrite) as file:
        file.write(text.encode())
