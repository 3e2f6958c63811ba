"""A calibration as report and table: numbers, errors of places beside those of rivals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softreach.arm.number import unit_suffix
from softreach.calibration.errors import Misses
from softreach.calibration.free_numbers import POSE
from softreach.support.errors import counted
from softreach.support.quantity import quantity
from softreach.support.report import Report, Section
from softreach.support.units import LengthUnit, readable_unit

if TYPE_CHECKING:
    import pandas as pd

    from softreach.calibration.calibration import Calibration

__all__ = ["ErrorRow", "error_rows", "report_of", "table_of"]

_MOST_ROWS = 10
_PICTURE = (
    "Measured places and the lines to the predicted ones; errors by marker, in the order in which "
    "samples were taken, and against each input."
)
_WORDS = {"softreach_version": "softreach", "data_sha256": "SHA-256 of the data"}


class ErrorRow(NamedTuple):
    """Errors of one law on some samples."""

    law: str
    samples: str
    """Those of which the errors are."""
    errors: Misses


def report_of(result: Calibration, unit: LengthUnit) -> Report:
    """All that a calibration found, with lengths in a unit."""
    from softreach.plot.results import plot_calibration

    arm, data = result.arm, result.data
    fitted, markers = len(data) - int(result.held.sum()), ", ".join(data.marker_names)
    origin = [(_WORDS.get(key, key), text) for key, text in result.provenance.items()]
    for name, column in zip(arm.input_names, data.input_names, strict=True):
        origin.append((f"input {name}", f"column {column}" if column else "stays at 0"))
    return Report(
        title=f"Calibration from {data.source}",
        verdict=result.verdict.sentence,
        state=result.verdict.limit,
        facts=[
            f"{counted(len(result.names), 'number')} from {counted(fitted, 'sample')} of "
            f"{markers}, {result.seconds:.1f} s"
        ],
        sections=[
            Section(
                title="Numbers",
                head=("number", "calibrated", "design"),
                rows=list(_number_rows(result, unit)),
                note="Each ± its standard deviation.",
            ),
            Section(
                title="Errors",
                head=(
                    *(unit.label("error of places"), "samples"),
                    *("rms", "median", "95 % below", "rms / L"),
                ),
                rows=[_error_cells(row, unit, arm.length) for row in error_rows(result)],
                note="Distances between measured and predicted places of the markers. Samples that "
                "are held out were not seen by any fit.",
                points=list(_remarks(result, unit)),
            ),
            Section(
                title="Pictures", figures=lambda: [(plot_calibration(result, unit=unit), _PICTURE)]
            ),
            Section(title="Provenance", rows=origin, is_printed=False),
            Section(title="The calibrated design", text=arm.to_toml()),
        ],
    )


def _number_rows(result: Calibration, unit: LengthUnit) -> Iterator[tuple[str, str, str]]:
    fit, widths = result.fit, result.uncertainty.sigma.tolist()
    pairs = zip(fit.free.numbers, fit.values.tolist(), widths, fit.at_bound, strict=True)
    # The pose starts from the data and not from the design.
    pose: dict[str, float] = dict(
        zip(POSE, (*result.start.base.position, 0.0, 0.0, 0.0), strict=True)
    )
    for number, value, sigma, at_bound in pairs:
        name, size = readable_unit(number.unit, value, unit)
        text = quantity(value / size, name, sigma / size, digits=2)
        text += ", at its bound" if at_bound else ", with its prior" if number.prior else ""
        text += ", which the data does not tell" if sigma == math.inf else ""
        yield number.name, text, f"{pose.get(number.name, number.start) / size:.4g}"


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


def _error_cells(row: ErrorRow, unit: LengthUnit, length: float) -> tuple[str, ...]:
    law, samples, errors = row
    values = (errors.rms, errors.median, errors.most)
    texts = [f"{value / unit.size:.3g}" for value in values] + [
        f"{100 * errors.rms / length:.2g} %"
    ]
    return law, samples, *(texts if errors.number else "----")


def _remarks(result: Calibration, unit: LengthUnit) -> Iterator[str]:
    if len(result.data.marker_names) > 1:
        each = ((name, errors.rms / unit.size) for name, errors in result.by_marker.items())
        listed = ", ".join(f"{name} {rms:.3g}" for name, rms in each)
        yield f"{unit.label('rms')} of each marker: {listed}"
    for one, other, share in result.correlated[:3]:
        yield f"hardly told apart: {one} and {other} (correlation {share:+.3f})"
    if len(far := result.outliers):
        rows = ", ".join(map(str, far[:_MOST_ROWS])) + ", ..." * (len(far) > _MOST_ROWS)
        yield f"{counted(len(far), 'sample')} far off, rows below the header from 0: {rows}"


def table_of(result: Calibration, shown: LengthUnit) -> pd.DataFrame:
    """A row for each sample, in the order of the data, with units in names of columns."""
    import pandas as pd

    data, arm = result.data, result.arm
    table: dict[str, Any] = {
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
    return pd.DataFrame(table)
