"""`softreach show`: pictures of a cloud and its arm."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import Activation, Sampler, Samples, Seed, Source, cloud_of, shape_of
from softreach.cli.output_files import Overwrite, check_picture

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["show"]


def show(
    source: Source,
    *,
    out: Annotated[Path, Parameter(help="Picture file: .png .pdf .svg")] = Path("cloud.png"),
    color: Annotated[
        str, Parameter(help="rgb, the name of a bundle, or compliance: how far the tip yields.")
    ] = "rgb",
    activation: Activation = None,
    n: Samples = 400_000,
    seed: Seed = 0,
    sampler: Sampler = "uniform",
    overwrite: Overwrite = False,
    changes: Changes = UNCHANGED,
) -> None:
    """Draw a cloud in three orthogonal views and an oblique one, with the arm in it.

    Example: softreach show trunk.zarr --color longitudinal --activation=-1,0,-0.5 --out trunk.pdf
    """
    import sys

    from softreach import plot
    from softreach.cloud.clouds import design_of

    check_picture("out", out, overwrite)
    cloud = cloud_of(source, n, seed, sampler, changes)
    arm = design_of(cloud)
    shape = None if activation is None else shape_of(activation, arm)
    figure = plot.plot_views(cloud, arm, shape, color=_colors(cloud, color))
    plot.save_figure(figure, out, overwrite=overwrite)
    sys.stdout.write(f"{out}\n")


def _colors(cloud: xr.Dataset, color: str) -> str | xr.DataArray:
    """What colors the samples: a name that figures know, or numbers that they do not compute."""
    from softreach.plot.coloring import bundle_names
    from softreach.stiffness import cloud_compliance

    if color != "compliance" or color in bundle_names(cloud):
        return color
    return cloud_compliance(cloud)["largest_compliance"]
