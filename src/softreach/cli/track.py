"""`softreach track`: activations that follow a path of tip positions."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import Design, activation_of, design_from, points_of

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
    from softreach.export.table import column_names
    from softreach.path import track_path

    arm = design_from(design, changes)
    first = None if start is None else activation_of(start, arm)
    found = track_path(arm, points_of(None, path), first)
    rows = zip(found.activation.values.tolist(), found.tip_error.values.tolist(), strict=True)
    header = ",".join([*column_names(arm.bundle_names), "tip_error_m"])
    _write(out, [header, *(",".join(f"{x:.12g}" for x in (*g, error)) for g, error in rows)])
    followed = int((found.status == 0).sum())
    end = found.attrs["end"] or "the end of the path"
    sys.stdout.write(f"{followed} of {found.sizes['point']} points followed, up to {end}: {out}\n")


def _write(path: Path, lines: list[str]) -> None:
    from softreach.atomic import replacing

    with replacing(path) as partial:
        partial.write_text("\n".join([*lines, ""]), encoding="utf-8")
