"""`softreach track`: activations that follow a path of tip positions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import Design, activation_of, design_from, points_of

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["track"]


def track(
    design: Design,
    path: Annotated[Path, Parameter(help="CSV file with columns x, y, z [m], in order.")],
    *,
    out: Annotated[Path, Parameter(help="CSV file for the activations.")] = Path("path.csv"),
    start: Annotated[
        str | None,
        Parameter(help="Activations to start from: -1,0,-0.5", allow_leading_hyphen=True),
    ] = None,
    changes: Changes = UNCHANGED,
) -> None:
    """Follow a path of tip positions on one branch of activations, and say where it ends."""
    from softreach.atomic import replacing
    from softreach.export.path_table import path_csv
    from softreach.path import track_path

    arm = design_from(design, changes)
    first = None if start is None else activation_of(start, arm)
    found = track_path(arm, points_of(None, path), first)
    with replacing(out) as partial:
        partial.write_text(path_csv(found), encoding="utf-8")
    followed = int((found.status == 0).sum())
    of_all = f"{followed} of {found.sizes['point']} points followed"
    sys.stdout.write(f"{of_all}, up to {_end(found)}: {out}\n")


def _end(found: xr.Dataset) -> str:
    """Where the branch ends, and why."""
    end = found.attrs["end"]
    at = f"{float(found.end_length):.7g} m of path"
    if end == "unstable":
        error = float(found.end_length_error)
        return f"{at} (± {error:.1g} m), where the arm loses its stability"
    named = {
        "": "the end of the path",
        "fold": f"{at}, where the branch turns back (a fold)",
        "no_start": "nowhere: the first point is not reached",
    }
    bound = f"{at}, where {found.attrs['end_bundle']} is at its {found.attrs['end_bound']} bound"
    return named.get(end, bound)
