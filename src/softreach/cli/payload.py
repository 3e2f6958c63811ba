"""`softreach payload`: how much of its reach a payload costs an arm."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.inputs import AsJson, Design, RevolutionDeg, TaperDeg, design_from
from softreach.cli.output import print_rows
from softreach.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator

__all__ = ["payload"]


def payload(
    design: Design,
    *,
    share: Annotated[
        float, Parameter(help="Of the volume without payload, which is to be kept.")
    ] = 0.8,
    payloads_kg: Annotated[
        str | None, Parameter(help="Masses to compute volumes for: 0.002,0.005")
    ] = None,
    gravity_m_s2: Annotated[
        str | None,
        Parameter(
            help="Gravity x,y,z in the base frame, instead of the design's.",
            allow_leading_hyphen=True,
        ),
    ] = None,
    accuracy: Annotated[float, Parameter(help="Relative error allowed in each volume.")] = 0.01,
    revolution_deg: RevolutionDeg = None,
    taper_deg: TaperDeg = None,
    figure: Annotated[Path | None, Parameter(help="Draw the curve: .png .pdf .svg")] = None,
    json: AsJson = False,
) -> None:
    """The reachable volume under payloads, and the largest one that keeps a share of it."""
    from softreach import progress
    from softreach.payload import payload_curve

    arm = _under(design_from(design, revolution_deg, taper_deg), gravity_m_s2)
    masses = None if payloads_kg is None else _numbers("payloads-kg", payloads_kg)
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
    print_rows(f"payload of {design}", rows, json)
    if figure is not None:
        from softreach.plot import plot_payload_curve, save_figure

        save_figure(plot_payload_curve(curve, largest=[largest]), figure)


def _under(arm: Manipulator, gravity: str | None) -> Manipulator:
    """The arm under its own loads or in other gravity."""
    from softreach.arm.loads import Loads

    if gravity is None:
        if arm.loads is None:
            allowed = (
                "given for a design without loads, as 0,0,-9.81 for an arm that stands upright"
            )
            raise InvalidInput("gravity-m-s2", None, allowed)
        return arm
    x, y, z = _numbers("gravity-m-s2", gravity, 3)
    return arm.replace(loads=(arm.loads or Loads()).replace(gravity=(x, y, z)))


def _numbers(name: str, text: str, count: int | None = None) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = []
    if not values or len(values) != (count or len(values)):
        raise InvalidInput(name, text, f"{count or 'some'} comma-separated numbers")
    return values
