"""`softreach export`: clouds and arms for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.lengths import Lengths, check_unit
from softreach.cli.options import (
    Activation,
    Overwrite,
    Source,
    Unit,
    check_output,
    check_surface,
    is_stored,
    refuse,
    shape_of,
)
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator


Format = Annotated[
    str | None,
    Parameter(help="activefilaments: NAME.csv and NAME_gamma.csv as ActiveFilaments.jl has them."),
]


_OTHER = "for ActiveFilaments.jl, whose lengths are in m"


def export(
    source: Source,
    out: Path,
    /,
    *,
    activation: Activation = None,
    format: Format = None,
    changes: Changes = UNCHANGED,
    overwrite: Overwrite = False,
    unit: Unit = None,
) -> None:
    """Convert a cloud or an arm for other programs.

    A cloud becomes a table or points (.ply .csv .parquet .npz .mat .vtu).
    A design becomes the surface of the bent arm with its fibers (.ply .stl .obj
    .glb .vtu), or the source of a filament of ActiveFilaments.jl (.jl).

    Example: softreach export minimal_trunk arm.glb --activation -1,0,-0.5

    Args:
        out: The file to write; its suffix chooses the format.
    """
    check_unit(unit)
    if format not in (None, "activefilaments"):
        raise InvalidInput("format", format, "activefilaments, or left out")
    if is_stored(source):
        refuse("on a cloud, which has many", activation=activation)
        refuse("on a stored cloud: give the design instead", **changes.given)
        written = _cloud(source, out, format, overwrite, unit)
    else:
        arm = design_from(source, changes)
        written = _design(arm, out, activation, format, overwrite, unit)
    for path in written:
        console.line(path)


def _cloud(
    source: str, out: Path, format: str | None, overwrite: bool, unit: str | None
) -> list[Path]:
    from softreach.cloud.clouds import design_of, open_cloud

    if format is None:
        from softreach.export.clouds import CLOUD_FILES, export_cloud

        check_output(out, CLOUD_FILES, overwrite)
        cloud = open_cloud(source)
        lengths = Lengths.of(design_of(cloud), unit)
        export_cloud(cloud, out, unit=lengths.written, overwrite=overwrite)
        console.written(out, lengths)
        return [out]
    refuse(_OTHER, unit=unit)
    from softreach.exchange.activefilaments.cloud import CLOUD_PAIR, gamma_path, write_cloud

    if out.suffix != ".csv":
        raise InvalidInput(
            "out", out, "a file name ending in .csv for clouds of ActiveFilaments.jl"
        )
    written = [out, gamma_path(out)]
    for path in written:
        check_output(path, CLOUD_PAIR, overwrite)
    write_cloud(open_cloud(source), out, overwrite=overwrite)
    return written


def _design(
    arm: Manipulator,
    out: Path,
    activation: str | None,
    format: str | None,
    overwrite: bool,
    unit: str | None,
) -> list[Path]:
    if out.suffix == ".jl":
        from softreach.exchange.activefilaments.filament import FILAMENT_SCRIPT, write_design

        refuse("on a filament's definition, which has none", activation=activation)
        refuse(_OTHER, unit=unit)
        check_output(out, FILAMENT_SCRIPT, overwrite)
        write_design(arm, out, overwrite=overwrite)
        return [out]
    if format is not None:
        raise InvalidInput("out", out, "a file name ending in .jl for a filament's definition")
    from softreach.export import export_arm

    check_surface(out, overwrite)
    lengths, shape = Lengths.of(arm, unit), shape_of(activation, arm)
    export_arm(arm, shape, out, unit=lengths.written, overwrite=overwrite)
    console.written(out, lengths)
    return [out]
