"""`softreach calibrate` and `plan-poses`: the arm on the bench from measured poses."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Group, Parameter

import softreach as sr
from softreach.cli import options
from softreach.cli.console import as_read, console
from softreach.cli.options import UNCHANGED, Changes, Number, Whole, design_from, pairs_in, read_as
from softreach.support import progress
from softreach.support.arguments import POSITIVE
from softreach.support.errors import InvalidInput
from softreach.support.files.formats import TABLES
from softreach.support.files.text import write_table
from softreach.support.lazy import Dataset
from softreach.support.quantity import columns
from softreach.support.units import TYPED, read_length, readable

if TYPE_CHECKING:
    from softreach.arm.parameters import Written

_COLUMNS = Group("Column names", sort_key=1)
_FREE = """Numbers that may change, comma-separated: names of softreach list parameters DESIGN, \
with * for any text; a=b=c to share one value; pose, pose.position or pose.rotation for the base; \
scale for places without a unit of length. May be repeated."""
Free = Annotated[list[str], Parameter(help=_FREE)]


def calibrate(
    design: options.Design,
    data: Path,
    /,
    *,
    free: Free,
    prior: list[str] | None = None,
    hold_out: Number = 0.0,
    hold_out_runs: Annotated[bool | None, Parameter(negative="--no-hold-out-runs")] = None,
    noise: str | None = None,
    robust: Annotated[bool, Parameter(negative="--no-robust")] = True,
    rivals: Annotated[bool, Parameter(negative="--no-rivals")] = True,
    seed: Whole = 0,
    inputs: Annotated[list[str] | None, Parameter(name="--input", group=_COLUMNS)] = None,
    markers: Annotated[list[str] | None, Parameter(name="--marker", group=_COLUMNS)] = None,
    run: Annotated[str | None, Parameter(group=_COLUMNS)] = None,
    order: Annotated[str | None, Parameter(group=_COLUMNS)] = None,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    report: Annotated[Path | None, Parameter(group=options.OUTPUT)] = None,
    table: Annotated[Path | None, Parameter(group=options.OUTPUT)] = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Fit numbers of a design to measured poses, with honest errors.

    Prints the numbers with their standard deviations, the error of predicted
    places beside that of simpler laws, and what limits the fit.

    Example: softreach calibrate arm.toml poses.csv --free pose --free "rings*modulus" -o bench.toml

    Args:
        data: Measured poses (.csv .parquet): a column for each input and x, y, z of each marker,
            with units in their names, such as tension1_N and tip_x_mm.
        prior: What is known of a free number beforehand: NAME=WIDTH about its value in the design,
            as in taper=1deg, or NAME=MEAN:WIDTH, as in
            rings[0].material.young_modulus=300kPa:50kPa. May be repeated.
        hold_out: Fraction of samples held out at random.
        hold_out_runs: Hold out whole runs; the default for data with eight or more.
        noise: Standard deviation of a measured coordinate, which decides how much priors count:
            0.2mm. Estimated from the residuals if left out.
        robust: Down-weight outliers.
        rivals: Fit two simpler laws too: constant curvature, and a quadratic law of the inputs.
        seed: Seed of the held-out samples.
        inputs: Column of an input: "tendon 1=tension1_N". May be repeated.
        markers: Start of the columns of a marker: tip=disk3. May be repeated.
        run: Column that names the run of each sample: run if left out.
        order: Column to sort by: time_s if left out.
        out: Write the calibrated design to this TOML file.
        report: Write a report with pictures to this .html file.
        table: Write predicted places and their errors to this .csv file.
    """
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.support.report import REPORT

    arm = design_from(design, changes, output.unit)
    outputs = [pair for pair in ((out, DESIGN_FILE), (report, REPORT), (table, TABLES)) if pair[0]]
    for path, formats in outputs or [(None, {})]:
        options.check_output(path, formats, output.overwrite)
    known: Any = {
        "hold_out": hold_out,
        "hold_out_runs": hold_out_runs,
        "robust": robust,
        "rivals": rivals,
        "run": run,
        "order": order,
        "seed": seed,
    }
    with progress.bar("fitting", None) as step:
        known |= {"free": free_names(arm, free), "prior": priors(arm, prior or ())}
        known |= {"noise": None if noise is None else _noise(noise)}
        columns_of = pairs_in("input", inputs, 'NAME=COLUMN, such as "tendon 1=tension1_N"')
        starts_of = pairs_in("marker", markers, "NAME=START, such as tip=disk3")
        known |= {"inputs": columns_of or None, "markers": starts_of or None}
        result = sr.calibrate(arm, data, **known, progress=step)
    if output.json:
        console.json(_record(result))
    else:
        console.line(f"calibration of {design}: {result.report(arm.length_unit.name)}")
    if out is not None:
        result.save(out, overwrite=output.overwrite)
    if table is not None:
        written = options.written_unit(arm)
        write_table(table, result.table(written.name), overwrite=output.overwrite)
        console.written(table, written)
    if report is not None:
        result.report(arm.length_unit.name).save(report, overwrite=output.overwrite)


def _noise(text: str) -> float:
    return read_as("noise", text, read_length, f"a length > 0 such as 0.2mm ({TYPED})", POSITIVE)


def _record(result: sr.calibration.Calibration) -> dict[str, Any]:
    """All of it for machines: lengths in m, angles in degrees."""
    held, data, again = result.held, result.data, result.repeatability
    errors = [{"law": law, "samples": on, **_errors(each)} for law, on, each in result.errors]
    record = {
        "samples": len(data),
        "held_out": int(held.sum()),
        "errors": errors,
        "markers": {name: _errors(each) for name, each in result.by_marker.items()},
        "numbers": _numbers(result.to_dataset()),
        "correlated": result.correlated,
        "doubts": result.doubts,
        "outlier_rows": result.outliers,
        "repeatability_rms_m": again.rms,
        "repeated_samples": again.pairs,
        "limit": result.verdict.limit,
        "verdict": result.verdict.sentence,
        "converged": result.fit.converged,
        "seconds": result.seconds,
    }
    return record | {"data": data.source, "data_sha256": data.digest}


def _numbers(found: Dataset) -> list[dict[str, Any]]:
    records = []
    for number in (found.isel(number=k) for k in range(found.sizes["number"])):
        names, unit = ("value", "sigma", "start"), str(number["unit"].item())
        read = {x: as_read(number[x if x in found else "value"].item(), unit) for x in names}
        record = {"number": str(number["number"].item())} | {x: y for x, (y, _) in read.items()}
        bound = {"at_bound": bool(number["at_bound"])} if "at_bound" in found else {}
        records.append({**record, "unit": read["value"][1], **bound})
    return records


def _errors(errors: sr.calibration.PlacementErrors) -> dict[str, float]:
    keys = ("median_m", "mean_m", "rms_m", "below_95_percent_m", "places")
    return dict(zip(keys, errors, strict=True))


def plan_poses(
    design: options.Design,
    /,
    *,
    free: Free,
    n: Annotated[Whole, Parameter(name=("--n", "-n"))] = 20,
    noise: str = "1mm",
    markers: str | None = None,
    candidates: Whole = 2000,
    seed: Whole = 0,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Choose the poses to measure for a calibration.

    Prints how well the free numbers will be known. The CSV file has a row for
    each pose, in the order in which to take them, with empty columns for the
    places of the markers; softreach calibrate reads it once it is filled in.

    Example: softreach plan-poses arm.toml --free pose --free "rings*modulus" -o poses.csv

    Args:
        n: Number of poses.
        noise: Standard deviation of a measured coordinate, with model error.
        markers: Markers that will be measured, comma-separated: all if left out.
        candidates: Number of poses to choose from.
        seed: Seed of candidates and of their order.
        out: Write the poses as a CSV file to fill in.
    """
    arm = design_from(design, changes, output.unit)
    width = _noise(noise)
    options.check_output(out, TABLES, output.overwrite)
    names = free_names(arm, free)
    seen = None if markers is None else [name.strip() for name in markers.split(",")]
    options_of = {"markers": seen, "candidates": candidates, "seed": seed}
    plan = sr.calibration.plan_poses(arm, names, n, **options_of)
    found = plan.to_dataset(width)
    if output.json:
        poses = {"inputs": found["input"].values, "poses": found["activation"].values}
        console.json({"noise_m": width, **poses, "numbers": _numbers(found)})
    else:
        seen, noise = ", ".join(plan.markers), arm.length_unit.rounded(width, digits=".5g")
        rows, keys = [("number", "expected", "share")], ("number", "unit", "value", "sigma")
        for name, own, value, sigma in zip(*(found[k].values.tolist() for k in keys), strict=True):
            share = f"{100 * sigma / abs(value):.2g} %" if value else "-"
            rows.append((name, readable(value, own, arm.length_unit, sigma, digits=2), share))
        title = f"{n} poses of {design} with {seen}, noise {noise}"
        console.line("\n  ".join([title, *columns(rows)]))
    if out is not None:
        plan.save(out, overwrite=output.overwrite)


def free_names(arm: sr.Manipulator, texts: Sequence[str]) -> list[str]:
    """Names of free numbers as Python takes them, from names that may have their units."""
    from softreach.arm.parameters import Written

    names = Written.of(arm)
    given = [name.strip() for text in texts for name in text.split(",")]
    return [_tied(names, name) for name in given if name]


def priors(arm: sr.Manipulator, texts: Sequence[str]) -> dict[str, tuple[float, ...]]:
    """Width, or mean and width, of numbers in their units by name, from NAME=MEAN:WIDTH.

    Raises:
        InvalidInput: Text that is anything else, or no such number.
    """
    from softreach.arm.parameters import Written
    from softreach.calibration.free_numbers import POSE, SCALE

    names, result = Written.of(arm), {}
    of_pose: dict[str, str] = dict(zip((*POSE, SCALE), [*"mmm", *["rad"] * 3, "1"], strict=True))
    allowed = "NAME=WIDTH or NAME=MEAN:WIDTH, such as taper=1deg"
    for name, text in pairs_in("prior", texts, allowed).items():
        first = name.split("=")[0].strip()
        unit = of_pose.get(first)
        if unit is None and first not in names.by_key:
            raise InvalidInput("prior", name, "NAME=WIDTH with the full name of a free number")
        try:
            values = tuple(names.number(first, part, unit) for part in text.split(":"))
        except ValueError:
            allowed = names.allowed(first, unit)
            raise InvalidInput(f"prior of {name}", text, allowed) from None
        result[_tied(names, name)] = values
    return result


def _tied(names: Written, name: str) -> str:
    parts = (part.strip() for part in name.split("="))
    return " = ".join(names.by_key[x].name if x in names.by_key else x for x in parts)
