"""`softreach show`: pictures of a cloud and its arm."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.console import console
from softreach.cli.options import (
    OUT,
    SAMPLING,
    Activation,
    Overwrite,
    Sampling,
    Source,
    Unit,
    check_picture,
    cloud_of,
    is_page,
    shape_of,
    write_page,
)

if TYPE_CHECKING:
    import xarray as xr


def show(
    source: Source,
    /,
    *,
    color: str | None = None,
    activation: Activation = None,
    sampling: Sampling = SAMPLING,
    changes: Changes = UNCHANGED,
    out: Annotated[Path, OUT] = Path("cloud.png"),
    overwrite: Overwrite = False,
    unit: Unit = None,
) -> None:
    """Draw a cloud and its arm from four sides, or as a web page that turns.

    Three views are orthogonal, one is oblique; --activation bends the arm. A page
    (.html) is one file, which needs no network.

    Example: softreach show trunk.zarr --activation -1,0,-0.5 --out trunk.pdf

    Args:
        color: rgb (mixed lights: if left out, of up to three bundles), strongest (bundle: if left
            out, of more), effort, the name of a bundle, or compliance: how far the tip yields.
        out: Picture file: .png .pdf .svg, or .html to turn
    """
    from softreach import plot
    from softreach.cloud.clouds import design_of

    check_picture(out, overwrite, page=True)
    cloud, lengths = cloud_of(source, sampling, changes, unit)
    arm = design_of(cloud)
    shape = None if activation is None else shape_of(activation, arm)
    colors = _colors(cloud, color)
    if is_page(out):
        shown = [cloud, arm if shape is None else shape]
        write_page(shown, out, lengths, overwrite=overwrite, color=colors)
    else:
        figure = plot.plot_views(cloud, arm, shape, color=colors, unit=lengths.unit)
        plot.save_figure(figure, out, overwrite=overwrite)
    console.line(out)


def _colors(cloud: xr.Dataset, color: str | None) -> str | xr.DataArray | None:
    """The colors of the samples: a name that figures know, or numbers that they do not compute."""
    from softreach.plot.coloring import bundle_names
    from softreach.stiffness import cloud_compliance

    if color != "compliance" or color in bundle_names(cloud):
        return color
    return cloud_compliance(cloud)["largest_compliance"]
