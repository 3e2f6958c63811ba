"""`softreach payload`: how much of its reach a payload costs an arm."""

from __future__ import annotations

from softreach.cli.changes import UNCHANGED, Changes, design_from, read_mass
from softreach.cli.console import console
from softreach.cli.lengths import Lengths, Rows
from softreach.cli.options import AsJson, Design, Out, Overwrite, Unit, check_picture
from softreach.cli.values import Number
from softreach.support.errors import SoftreachError


def payload(
    design: Design,
    /,
    *,
    share: Number = 0.8,
    payloads: str | None = None,
    accuracy: Number = 0.01,
    changes: Changes = UNCHANGED,
    out: Out = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Compute how much of its reach a payload costs an arm.

    The volumes under several payloads, which take the place of the design's own,
    and the largest payload that keeps a share of the volume.

    Example: softreach payload lce_arm --gravity up --share 0.8

    Args:
        share: Share to keep of the volume without a payload.
        payloads: Masses at the tip, instead of the design's own payload: 2g,5g,10g
        accuracy: Relative error allowed in each volume.
        out: Draw the curve: .png .pdf .svg
    """
    from softreach.support import progress
    from softreach.workspace.payload import payload_curve

    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    check_picture(out, overwrite)
    if arm.loads is None:
        raise SoftreachError("this design has no loads; add --gravity down")
    masses = None if payloads is None else [read_mass("payloads", m) for m in payloads.split(",")]
    with progress.bar("computing volumes", None) as step:
        curve = payload_curve(arm, masses, accuracy=accuracy, progress=step)
        largest = curve.largest_payload(share)
    rows: Rows = {
        "payloads": (curve.payloads.tolist(), "kg"),
        "volumes": (curve.volumes.tolist(), "m³"),
        "volume errors": (curve.volume_errors.tolist(), "m³"),
        "shares": ((100.0 * curve.shares).tolist(), "%"),
        "share errors": ((100.0 * curve.share_errors).tolist(), "%"),
        "share to keep": (100.0 * share, "%"),
        "largest payload": (largest.payload, "kg"),
        "largest payload error": (largest.payload_error, "kg"),
    }
    console.rows(f"payload of {design}", rows, json, lengths)
    if arm.loads.payload and not json:
        console.line(f"  they take the place of the design's own payload, {arm.loads.payload:g} kg")
    if out is not None:
        from softreach.plot import plot_payload_curve, save_figure

        save_figure(plot_payload_curve(curve, largest=[largest]), out, overwrite=overwrite)
