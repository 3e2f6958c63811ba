"""`softreach gradient`: how the reachable volume changes with parameters of a design."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import AsJson, Design, design_from
from softreach.cli.numbers import NUMBER
from softreach.cli.output import print_rows

if TYPE_CHECKING:
    from softreach.workspace import VolumeGradient

__all__ = ["gradient"]


def gradient(
    design: Design,
    parameters: Annotated[
        list[str],
        Parameter(help="Paths of parameters, as in atlases: taper, left.offset, lower."),
    ],
    *,
    accuracy: Annotated[
        float, NUMBER, Parameter(help="Relative error allowed in what is rasterized.")
    ] = 3e-3,
    changes: Changes = UNCHANGED,
    json: AsJson = False,
) -> None:
    """How the reachable volume and its convex hull change with parameters, in SI units.

    Example: softreach gradient lce_arm taper upper --set lower=-3 --set upper=-1
    """
    from softreach.support import progress
    from softreach.workspace import volume_gradient

    arm = design_from(design, changes)
    with progress.bar("differentiating the volume", len(parameters)) as shown:
        found = volume_gradient(arm, parameters, accuracy=accuracy, progress=shown)
    print_rows(f"derivatives of what {design} reaches", _rows(found), json)


def _rows(found: VolumeGradient) -> dict[str, tuple[Any, str]]:
    rows: dict[str, tuple[Any, str]] = {"route": (found.route, "")}
    for k, (name, unit) in enumerate(zip(found.parameters, found.units, strict=True)):
        for what, kind in _KINDS.items():
            label = f"{what.replace('_', ' ')} by {name}"
            value, error = getattr(found, what)[k], getattr(found, f"{what}_error")[k]
            per = kind if unit == "1" else f"{kind or '1'}/{unit}"
            rows[label] = (float(value), per)
            rows[f"{label} error (estimate)"] = (float(error), per)
    return rows


_KINDS = {"volume": "m³", "convex_volume": "m³", "unreachability": ""}
