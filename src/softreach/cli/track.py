"""`softreach track`: activations that follow a path of tip positions."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from softreach.cli.changes import UNCHANGED, Changes, Signed, design_from
from softreach.cli.console import console
from softreach.cli.lengths import Lengths
from softreach.cli.options import (
    OUT,
    Design,
    Overwrite,
    Unit,
    activation_of,
    check_output,
    points_in,
)

if TYPE_CHECKING:
    import xarray as xr


def track(
    design: Design,
    path: Path,
    /,
    *,
    start: Signed = None,
    changes: Changes = UNCHANGED,
    out: Annotated[Path, OUT] = Path("activations.csv"),
    overwrite: Overwrite = False,
    unit: Unit = None,
) -> None:
    """Follow a path of tip positions, and say where it ends.

    The activations change continuously along the path and go into a CSV file.

    Example: softreach track minimal_trunk path.csv --out activations.csv

    Args:
        path: CSV file with columns x, y, z, in order; m or as it says.
        start: Activations to start from: -1,0,-0.5
        out: CSV file for the activations.
    """
    from softreach.export.clouds import path_csv
    from softreach.inverse.path import track_path
    from softreach.support.files.formats import FileFormat
    from softreach.support.files.text import write_text

    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    check_output(out, {".csv": FileFormat()}, overwrite)
    first = None if start is None else activation_of(start, arm)
    tracked = track_path(arm, points_in("path", path, arm), first)
    write_text(out, path_csv(tracked), overwrite=overwrite)
    followed = int((tracked.status == 0).sum())
    share = f"{followed} of {tracked.sizes['point']} points followed"
    console.line(f"{share}, up to {_end(tracked, lengths)}: {out}")


def _end(tracked: xr.Dataset, lengths: Lengths) -> str:
    end = tracked.attrs["end"]
    at = f"{lengths.text(float(tracked.end_length), '.7g')} of path"
    if end == "snaps":
        error = lengths.text(float(tracked.end_length_error), ".1g")
        return f"{at} (± {error}), where the arm snaps"
    ends = {
        "": "the end of the path",
        "fold": f"{at}, where the branch turns back (a fold)",
        "no_start": "nowhere: the first point is not reached",
    }
    bundle, bound = tracked.attrs["end_bundle"], tracked.attrs["end_bound"]
    return ends.get(end, f"{at}, where {bundle} is at its {bound} bound")
