"""`softreach payload`: how much of its reach a payload costs an arm."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes, read_mass
from softreach.cli.inputs import AsJson, Design, design_from
from softreach.cli.numbers import NUMBER
from softreach.cli.output import print_rows
from softreach.cli.output_files import Overwrite, check_picture
from softreach.support.errors import InvalidInput

__all__ = ["payload"]


def payload(
    design: Design,
    *,
    share: Annotated[
        float, NUMBER, Parameter(help="Of the volume without payload, which is to be kept.")
    ] = 0.8,
    payloads: Annotated[
        str | None, Parameter(help="Masses to compute volumes for: 2g,5g,10g")
    ] = None,
    accuracy: Annotated[
        float, NUMBER, Parameter(help="Relative error allowed in each volume.")
    ] = 0.01,
    changes: Changes = UNCHANGED,
    figure: Annotated[Path | None, Parameter(help="Draw the curve: .png .pdf .svg")] = None,
    overwrite: Overwrite = False,
    json: AsJson = False,
) -> None:
    """The reachable volume under payloads, and the largest one that keeps a share of it."""
    from softreach.support import progress
    from softreach.workspace.payload import payload_curve

    arm = design_from(design, changes)
    check_picture("figure", figure, overwrite)
    if arm.loads is None:
        raise InvalidInput("gravity", None, "given for a design without loads: down, up, sideways")
    masses = None if payloads is None else [read_mass("payloads", m) for m in payloads.split(",")]
    with progress.bar("computing volumes", None) as shown:
        curve = payload_curve(arm, masses, accuracy=accuracy, progress=shown)
        largest = curve.largest_payload(share)
    cube = arm.length**3
    rows = {
        "payloads": (curve.payloads.tolist(), "kg"),
        "volumes": ((curve.volumes / cube).tolist(), "L³"),
        "volume errors": ((curve.volume_errors / cube).tolist(), "L³"),
        "shares": (curve.shares.tolist(), ""),
        "share to keep": (share, ""),
        "largest payload": (largest.payload, "kg"),
        "largest payload error": (largest.payload_error, "kg"),
    }
    if figure is not None:
        from softreach.plot import plot_payload_curve, save_figure

        drawn = plot_payload_curve(curve, largest=[largest])
        save_figure(drawn, figure, overwrite=overwrite)
    print_rows(f"payload of {design}", rows, json)
