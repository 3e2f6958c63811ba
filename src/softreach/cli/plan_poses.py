"""`softreach plan-poses`: the poses to measure before a calibration."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.calibrate import read_noise
from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.free_numbers import Free, free_names
from softreach.cli.lengths import Lengths
from softreach.cli.options import AsJson, Design, Out, Overwrite, Unit, check_output
from softreach.cli.values import Whole, as_read

if TYPE_CHECKING:
    from softreach.calibration.free_numbers import FreeNumber


def plan_poses(
    design: Design,
    /,
    *,
    free: Free,
    n: Annotated[Whole, Parameter(name=("--n", "-n"))] = 20,
    noise: str = "1mm",
    markers: str | None = None,
    candidates: Whole = 2000,
    seed: Whole = 0,
    changes: Changes = UNCHANGED,
    out: Out = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
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
    from softreach import calibration
    from softreach.support.files.formats import TABLES
    from softreach.support.quantity import columns

    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    width = read_noise(noise)
    check_output(out, TABLES, overwrite)
    plan = calibration.plan_poses(
        arm,
        free_names(arm, free),
        n,
        markers=None if markers is None else [name.strip() for name in markers.split(",")],
        candidates=candidates,
        seed=seed,
    )
    sigma = plan.sigma(width)
    if json:
        numbers = [
            {
                "number": number.name,
                "start": as_read(number.start, number.unit)[0],
                "sigma": as_read(sigma[number.name], number.unit)[0],
                "unit": as_read(0.0, number.unit)[1],
            }
            for number in plan.free.numbers
        ]
        poses = plan.activations.tolist()
        names = list(arm.input_names)
        console.json({"noise_m": width, "inputs": names, "poses": poses, "numbers": numbers})
    else:
        seen = ", ".join(plan.markers)
        console.line(f"{n} poses of {design} with {seen}, noise {lengths.text(width)}")
        rows = _rows(plan.free.numbers, sigma.values(), lengths)
        for line in columns([("number", "to be known", "share"), *rows]):
            console.line(f"  {line}")
    if out is not None:
        plan.save(out, overwrite=overwrite)


def _rows(
    numbers: Iterable[FreeNumber], sigma: Iterable[float], lengths: Lengths
) -> Iterator[tuple[str, str, str]]:
    from softreach.support.quantity import quantity
    from softreach.support.units import readable_unit

    for number, width in zip(numbers, sigma, strict=True):
        name, size = readable_unit(number.unit, number.start, lengths.unit)
        share = f"{100 * width / abs(number.start):.2g} %" if number.start else "-"
        yield number.name, quantity(number.start / size, name, width / size, digits=2), share
