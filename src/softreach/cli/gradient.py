"""`softreach gradient`: how the reachable volume changes with parameters of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.lengths import Rows
from softreach.cli.options import AsJson, Design
from softreach.cli.values import Number

if TYPE_CHECKING:
    from softreach.workspace import VolumeGradient


_UNITS = {"volume": "m³", "convex_volume": "m³", "unreachability": ""}


def gradient(
    design: Design,
    parameters: list[str],
    /,
    *,
    accuracy: Number = 3e-3,
    changes: Changes = UNCHANGED,
    json: AsJson = False,
) -> None:
    """Differentiate the reachable volume by design parameters.

    Also its convex hull and its unreachability; everything in SI units.

    Example: softreach gradient lce_arm taper upper --set lower=-3 --set upper=-1

    Args:
        parameters: Parameters, as softreach list parameters DESIGN names them.
        accuracy: Relative error allowed in what is rasterized.
    """
    from softreach.support import progress
    from softreach.workspace import volume_gradient

    arm = design_from(design, changes)
    with progress.bar("differentiating the volume", len(parameters)) as step:
        derivatives = volume_gradient(arm, parameters, accuracy=accuracy, progress=step)
    console.rows(f"derivatives of what {design} reaches", _rows(derivatives), json)


def _rows(derivatives: VolumeGradient) -> Rows:
    rows: Rows = {"route": (derivatives.route, "")}
    for k, (name, unit) in enumerate(zip(derivatives.parameters, derivatives.units, strict=True)):
        for quantity, kind in _UNITS.items():
            label = f"{quantity.replace('_', ' ')} by {name}"
            value = getattr(derivatives, quantity)[k]
            error = getattr(derivatives, f"{quantity}_error")[k]
            per = kind if unit == "1" else f"{kind or '1'}/{unit}"
            rows[label] = (float(value), per)
            rows[f"{label} error (estimate)"] = (float(error), per)
    return rows
