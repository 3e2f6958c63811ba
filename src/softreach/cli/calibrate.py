"""`softreach calibrate`: the arm on the bench from measured poses."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.free_numbers import Free, free_names, priors
from softreach.cli.lengths import Lengths
from softreach.cli.options import OUTPUT, AsJson, Design, Out, Overwrite, Unit, check_output
from softreach.cli.values import Number, Whole, as_read, pairs_in
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.calibration import Calibration, PlacementErrors

_COLUMNS = Group("Column names", sort_key=1)


def calibrate(
    design: Design,
    data: Path,
    /,
    *,
    free: Free,
    prior: list[str] | None = None,
    hold_out: Number = 0.0,
    noise: str | None = None,
    robust: Annotated[bool, Parameter(negative="--no-robust")] = True,
    rivals: Annotated[bool, Parameter(negative="--no-rivals")] = True,
    seed: Whole = 0,
    inputs: Annotated[list[str] | None, Parameter(name="--input", group=_COLUMNS)] = None,
    markers: Annotated[list[str] | None, Parameter(name="--marker", group=_COLUMNS)] = None,
    run: Annotated[str | None, Parameter(group=_COLUMNS)] = None,
    order: Annotated[str | None, Parameter(group=_COLUMNS)] = None,
    changes: Changes = UNCHANGED,
    out: Out = None,
    report: Annotated[Path | None, Parameter(group=OUTPUT)] = None,
    table: Annotated[Path | None, Parameter(group=OUTPUT)] = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Fit numbers of a design to measured poses, with honest errors.

    Prints the numbers with their standard deviations, the error of predicted
    places beside that of simpler laws, and what limits the fit.

    Example: softreach calibrate arm.toml poses.csv --free pose --free "rings*modulus" -o bench.toml

    Args:
        data: Measured poses (.csv .parquet): a column for each input and x, y, z of each marker,
            with units in their names, such as tension1_N and tip_x_mm.
        prior: What is known of a number beforehand, its width about the value of the design or
            MEAN:WIDTH: taper=1deg, rings[0].material.young_modulus=300kPa:50kPa. May be repeated.
        hold_out: Fraction of samples held out at random.
        noise: Standard deviation of a measured coordinate, against which priors are weighed: 0.2mm.
            That of the residuals if left out.
        robust: Down-weight outliers.
        rivals: Fit constant curvature and a quadratic law beside it.
        seed: Seed of the held-out samples.
        inputs: Column of an input: "tendon 1=tension1_N". May be repeated.
        markers: Start of the columns of a marker: tip=disk3. May be repeated.
        run: Column that groups samples into runs, if not run.
        order: Column to sort by, if not time_s.
        out: Write the calibrated design to this TOML file.
        report: Write a report with pictures to this .html file.
        table: Write what was predicted and missed to this .csv file.
    """
    from softreach import calibration
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.support import progress
    from softreach.support.files.formats import TABLES
    from softreach.support.files.text import write_table
    from softreach.support.report import REPORT

    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    outputs = [pair for pair in ((out, DESIGN_FILE), (report, REPORT), (table, TABLES)) if pair[0]]
    for path, formats in outputs or [(None, {})]:
        check_output(path, formats, overwrite)
    with progress.bar("fitting", None) as step:
        result = calibration.calibrate(
            arm,
            data,
            free=free_names(arm, free),
            prior=priors(arm, prior or ()),
            hold_out=hold_out,
            noise=None if noise is None else read_noise(noise),
            robust=robust,
            rivals=rivals,
            inputs=pairs_in("input", inputs, 'NAME=COLUMN, such as "tendon 1=tension1_N"'),
            markers=pairs_in("marker", markers, "NAME=START, such as tip=disk3"),
            run=run,
            order=order,
            seed=seed,
            progress=step,
        )
    if json:
        console.json(_record(result))
    else:
        console.line(f"calibration of {design}: {result.report(lengths.unit.name)}")
    if out is not None:
        result.save(out, overwrite=overwrite)
    if table is not None:
        write_table(table, result.table(lengths.written.name), overwrite=overwrite)
        console.written(table, lengths)
    if report is not None:
        result.report(lengths.unit.name).save(report, overwrite=overwrite)


def read_noise(text: str) -> float:
    """A standard deviation [m] with its unit, or in m."""
    from softreach.support.units import TYPED, read_length

    try:
        noise = read_length(text)
    except ValueError:
        noise = 0.0
    if not noise > 0:
        raise InvalidInput("noise", text, f"a length > 0 such as 0.2mm ({TYPED})")
    return noise


def _record(result: Calibration) -> dict[str, Any]:
    """All of it for machines: lengths in m, angles in degrees."""
    repeated = result.repeatability
    return {
        "samples": len(result.data),
        "held_out": int(result.held.sum()),
        "markers": {name: _errors(errors) for name, errors in result.by_marker.items()},
        "numbers": _numbers(result),
        "errors": [
            {"law": row.law, "samples": row.samples, **_errors(row.errors)} for row in result.errors
        ],
        "correlated": [list(pair) for pair in result.correlated],
        "outlier_rows": result.outliers.tolist(),
        "repeatability_rms_m": repeated.rms,
        "repeated_samples": repeated.pairs,
        "limit": result.verdict.limit,
        "verdict": result.verdict.sentence,
        "converged": result.fit.converged,
        "seconds": result.seconds,
        "data": result.data.source,
        "data_sha256": result.data.digest,
    }


def _numbers(result: Calibration) -> list[Mapping[str, Any]]:
    sigma, bound = result.sigma, result.fit.at_bound.tolist()
    return [
        {
            "number": number.name,
            "value": as_read(value, number.unit)[0],
            "sigma": as_read(sigma[number.name], number.unit)[0],
            "start": as_read(number.start, number.unit)[0],
            "unit": as_read(value, number.unit)[1],
            "at_bound": at_bound,
        }
        for number, value, at_bound in zip(
            result.fit.free.numbers, result.values.values(), bound, strict=True
        )
    ]


def _errors(errors: PlacementErrors) -> dict[str, float]:
    keys = ("median_m", "mean_m", "rms_m", "below_95_percent_m", "places")
    return dict(zip(keys, errors, strict=True))
