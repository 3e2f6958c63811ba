"""`softreach track`: activations that follow a path of tip positions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import Design, activation_of, design_from, points_of
from softreach.cli.output_files import Overwrite, check_output
from softreach.support.files.kinds import FileKind, text_with

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["track"]

_TABLE = {".csv": FileKind("a table of activations along a path", text_with(",tip_error_m\n"))}


def track(
    design: Design,
    path: Annotated[Path, Parameter(help="CSV file with columns x, y, z [m], in order.")],
    *,
    out: Annotated[Path, Parameter(help="CSV file for the activations.")] = Path("activations.csv"),
    start: Annotated[
        str | None,
        Parameter(help="Activations to start from: -1,0,-0.5", allow_leading_hyphen=True),
    ] = None,
    overwrite: Overwrite = False,
    changes: Changes = UNCHANGED,
) -> None:
    """Follow a path of tip positions on one branch of activations, and say where it ends."""
    from softreach.export.clouds import path_csv
    from softreach.inverse.path import track_path
    from softreach.support.files.atomic import writing

    arm = design_from(design, changes)
    check_output("out", out, _TABLE, overwrite)
    first = None if start is None else activation_of(start, arm)
    found = track_path(arm, points_of(None, path), first)
    with writing(out, _TABLE[".csv"], overwrite=overwrite) as file:
        file.write(path_csv(found).encode())
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
