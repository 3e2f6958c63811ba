"""`softreach show`: pictures of a cloud and its arm."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import Activation, Sampler, Source, cloud_of, shape_of
from softreach.errors import InvalidInput

__all__ = ["show"]


def show(
    source: Source,
    *,
    out: Annotated[Path, Parameter(help="Picture file: .png .pdf .svg")] = Path("cloud.png"),
    color: Annotated[str, Parameter(help="rgb, or the name of a bundle.")] = "rgb",
    activation: Activation = None,
    n: Annotated[int, Parameter(help="Samples, when the source is a design.")] = 400_000,
    seed: int = 0,
    sampler: Sampler = "uniform",
    changes: Changes = UNCHANGED,
) -> None:
    """Draw a cloud in three orthogonal views and an oblique one, with the arm in it.

    Example: softreach show trunk.zarr --color longitudinal --activation=-1,0,-0.5 --out trunk.pdf
    """
    import sys

    from softreach import plot
    from softreach.cloud import design_of

    _check_suffix(out)
    cloud = cloud_of(source, n, seed, sampler, changes)
    arm = design_of(cloud)
    shape = None if activation is None else shape_of(activation, arm)
    plot.save_figure(plot.plot_views(cloud, arm, shape, color=color), out)
    sys.stdout.write(f"{out}\n")


def _check_suffix(out: Path) -> None:
    """Refuse a picture format that matplotlib cannot write, before anything is computed."""
    from softreach.plot.style import pyplot

    known = pyplot().Figure().canvas.get_supported_filetypes()
    if out.suffix.lower().removeprefix(".") not in known:
        raise InvalidInput("out", out, "a file name ending in .png, .pdf, .svg or the like")
