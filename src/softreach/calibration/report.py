"""Text of a calibration: numbers with their errors, errors of places beside those of rivals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, NamedTuple

from softreach.calibration.errors import Misses
from softreach.calibration.free_numbers import POSE, FreeNumbers
from softreach.support.errors import counted
from softreach.support.quantity import columns, quantity
from softreach.support.units import LengthUnit, readable_unit

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
]

_MOST_ROWS = 10


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
    free = result.fit.free.numbers
    sigma = result.uncertainty.sigma.tolist()
    bound = result.fit.at_bound.tolist()
    for k, (number, value) in enumerate(zip(free, result.fit.values.tolist(), strict=True)):
        name, size = readable_unit(number.unit, value, unit)
        text = quantity(value / size, name, sigma[k] / size, digits=2)
        text += ", at its bound" if bound[k] else ", with its prior" if number.prior else ""
        text += ", which the data does not tell" if sigma[k] == math.inf else ""
        yield number.name, text, f"{_of_design(result, k) / size:.4g}"


def sigma_rows(
    free: FreeNumbers, sigma: Iterable[float], unit: LengthUnit
) -> Iterator[tuple[str, str, str]]:
    """Name, value of the design ± a standard deviation, and their ratio, of each number."""
    for number, width in zip(free.numbers, sigma, strict=True):
        name, size = readable_unit(number.unit, number.start, unit)
        share = f"{100 * width / abs(number.start):.2g} %" if number.start else "-"
        yield number.name, quantity(number.start / size, name, width / size, digits=2), share


def _of_design(result: Calibration, k: int) -> float:
    """Value of a number before the fit; the pose starts from the data and not from there."""
    number = result.fit.free.numbers[k]
    if number.name in POSE:
        return (*result.start.base.position, 0.0, 0.0, 0.0)[POSE.index(number.name)]
    return number.start


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
