"""`softreach export`: clouds and arms for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import Activation, Source, design_from, is_stored, shape_of
from softreach.cli.output_files import Overwrite, check_output, check_surface
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = ["export"]

Format = Annotated[
    str | None,
    Parameter(help="activefilaments: NAME.csv and NAME_gamma.csv as ActiveFilaments.jl has them."),
]


def export(
    source: Source,
    out: Annotated[Path, Parameter(help="Target; its suffix chooses the format.")],
    *,
    activation: Activation = None,
    format: Format = None,
    overwrite: Overwrite = False,
    changes: Changes = UNCHANGED,
) -> None:
    """Write a cloud (.ply .csv .parquet .npz .mat .vtu .vtk), or a design's arm as a surface mesh.

    A design is written as the deformed arm with its fibers (.ply .stl .obj .glb .vtu .vtk), or as
    the source of a filament of ActiveFilaments.jl (.jl).

    Examples: softreach export trunk.zarr trunk.parquet;
    softreach export minimal_trunk arm.glb --activation=-1,0,-0.5;
    softreach export trunk.zarr trunk.csv --format activefilaments
    """
    import sys

    if format not in (None, "activefilaments"):
        raise InvalidInput("format", format, "activefilaments, or left out")
    if is_stored(source):
        if activation is not None:
            raise InvalidInput("activation", activation, "left out for a cloud, which has many")
        changes.refuse("left out for a stored cloud: give the design instead")
        written = _cloud(source, out, format, overwrite)
    else:
        arm = design_from(source, changes)
        written = _design(arm, out, activation, format, overwrite)
    sys.stdout.writelines(f"{path}\n" for path in written)


def _cloud(source: str, out: Path, format: str | None, overwrite: bool) -> list[Path]:
    from softreach.cloud.clouds import open_cloud

    if format is None:
        from softreach.export.clouds import CLOUD_FILES, export_cloud

        check_output("out", out, CLOUD_FILES, overwrite)
        export_cloud(open_cloud(source), out, overwrite=overwrite)
        return [out]
    from softreach.exchange.activefilaments.cloud import CLOUD_PAIR, gamma_path, write_cloud

    if out.suffix != ".csv":
        raise InvalidInput(
            "out", out, "a file name ending in .csv for clouds of ActiveFilaments.jl"
        )
    written = [out, gamma_path(out)]
    for path in written:
        check_output("out", path, CLOUD_PAIR, overwrite)
    write_cloud(open_cloud(source), out, overwrite=overwrite)
    return written


def _design(
    arm: Manipulator, out: Path, activation: str | None, format: str | None, overwrite: bool
) -> list[Path]:
    if out.suffix == ".jl":
        from softreach.exchange.activefilaments.script import FILAMENT_SCRIPT, write_design

        check_output("out", out, FILAMENT_SCRIPT, overwrite)
        write_design(arm, out, overwrite=overwrite)
        return [out]
    if format is not None:
        raise InvalidInput("out", out, "a file name ending in .jl for a filament's definition")
    from softreach.export import export_arm

    check_surface("out", out, overwrite)
    export_arm(arm, shape_of(activation, arm), out, overwrite=overwrite)
    return [out]
