"""`softreach export`: clouds and arms for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.inputs import Activation, Source, activation_of, design_from

__all__ = ["export"]


def export(
    source: Source,
    out: Annotated[Path, Parameter(help="Target; its suffix chooses the format.")],
    *,
    activation: Activation = None,
) -> None:
    """Write a cloud (.ply .csv .parquet .npz .mat .vtu .vtk), or a design's arm as a surface mesh.

    A design is written as the deformed arm with its fibers (.ply .stl .obj .glb .vtu .vtk).

    Examples: softreach export trunk.zarr trunk.parquet;
    softreach export minimal_trunk arm.glb --activation=-1,0,-0.5
    """
    import sys

    from softreach import export as files

    if source.rstrip("/").endswith(".zarr"):
        from softreach.cloud import open_cloud

        files.export_cloud(open_cloud(source), out)
    else:
        from softreach.rod.kinematics import configuration

        arm = design_from(source)
        files.export_arm(arm, configuration(arm, activation_of(activation, arm)), out)
    sys.stdout.write(f"{out}\n")
