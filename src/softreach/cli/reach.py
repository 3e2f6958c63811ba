"""`softreach reach`: the exact reachable set of a design."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.design import load_rows
from softreach.cli.lengths import Lengths, Rows
from softreach.cli.options import (
    OUT,
    OUTPUT,
    AsJson,
    Design,
    Overwrite,
    Unit,
    check_output,
    is_page,
    refuse,
    write_page,
)
from softreach.cli.values import Number
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator
    from softreach.workspace import ReachableSet, ReachableSolid


def reach(
    design: Design,
    /,
    *,
    accuracy: Number = 3e-3,
    changes: Changes = UNCHANGED,
    out: Annotated[list[Path] | None, OUT] = None,
    at: Annotated[str | None, Parameter(group=OUTPUT, allow_leading_hyphen=True)] = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Compute the exact reachable set: volume, multiplicity, folds.

    Without samples: the volume with its error, the share of the convex hull that
    is not reached, and the number of activations that reach each place.

    Example: softreach reach minimal_trunk --out reach.stl --out reach.png

    Args:
        accuracy: Relative error allowed in the volume.
        out: Write the boundary (.ply .stl .obj .glb .vtu), draw slices (.png .pdf .svg), or
            the set as a web page that turns (.html). May be repeated.
        at: Point x,y,z that the slices meet at: the middle of the set if left out.
    """
    from softreach.inverse.request import position_in
    from softreach.support import progress
    from softreach.workspace import reachable_set

    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    outs = sorted(out or [], key=_is_picture)  # pictures come last
    _check_outputs(arm, outs, overwrite)
    if not any(map(_is_picture, outs)):
        refuse("without a picture: add --out slices.png", at=at)
    point = None if at is None else position_in("at", at, arm.length)
    with progress.bar("mapping the activation box", None) as step:
        reached = reachable_set(arm, accuracy=accuracy, progress=step)
    rows = load_rows(arm) | _rows(reached)
    if reached.lost_share > 0.0:
        rows["activations without a posture"] = (100.0 * reached.lost_share, "%")
    if reached.hysteresis_share > 0.0:
        rows["activations with two postures (hysteresis)"] = (100 * reached.hysteresis_share, "%")
    console.rows(f"reachable set of {design}", rows, json, lengths)
    for path in outs:
        _write(reached, path, point, lengths, overwrite)


def _check_outputs(arm: Manipulator, outs: list[Path], overwrite: bool) -> None:
    """Refuse files that cannot be written, or that a set of so few dimensions does not have."""
    if not outs:
        check_output(None, {}, overwrite)
        return
    from softreach.export.surfaces import SURFACE_FILES
    from softreach.support.files.formats import PAGES, PICTURES, check_installed

    formats = {**SURFACE_FILES, **PICTURES, **PAGES}
    suffixes = [path.suffix.lower() for path in outs]
    known = [formats[suffix] for suffix in suffixes if suffix in formats]
    needed = [(library, each.extra) for each in known for library in each.libraries]
    has_surface = any(suffix in SURFACE_FILES for suffix in suffixes)
    check_installed(*needed, *[("skimage", "surface")] * has_surface)
    free = int((arm.input_bounds[:, 0] < arm.input_bounds[:, 1]).sum())
    for path in outs:
        check_output(path, formats, overwrite)
        if not is_page(path) and free < (3 if _is_picture(path) else 2):
            raise _no_such_output(path)


def _is_picture(path: Path) -> bool:
    from softreach.support.files.formats import PICTURES

    return path.suffix.lower() in PICTURES


def _no_such_output(path: Path) -> InvalidInput:
    return InvalidInput("out", path, "left out for a design with so few free bundles")


def _write(
    reached: ReachableSet, path: Path, point: list[float] | None, lengths: Lengths, overwrite: bool
) -> None:
    from softreach.workspace import ReachableSolid, ReachableSurface

    if is_page(path):
        write_page([reached, reached.arm], path, lengths, overwrite=overwrite)
    elif _is_picture(path):
        from softreach.plot import plot_slices, save_figure

        if not isinstance(reached, ReachableSolid):
            raise _no_such_output(path)
        figure = plot_slices(reached.grid, at=point, unit=lengths.unit)
        save_figure(figure, path, overwrite=overwrite)
    else:
        from softreach.export import export_mesh

        if not isinstance(reached, ReachableSolid | ReachableSurface):
            raise _no_such_output(path)
        export_mesh(reached.surface(), path, unit=lengths.written, overwrite=overwrite)
        console.written(path, lengths)


def _rows(reached: ReachableSet) -> Rows:
    from softreach.workspace import (
        ReachableCurve,
        ReachablePoint,
        ReachableRegion,
        ReachableSolid,
        ReachableSurface,
    )

    convex = _size("convex volume", reached.convex_volume, reached.convex_volume_error, "m³")
    match reached:
        case ReachableSolid():
            size = _size("volume", reached.volume, reached.volume_error, "m³")
            if (shell := reached.shell) is not None:
                thin = _size("area (middle of the shell)", *shell.area, "m²")
                size = thin | _size("thickness (mean)", *shell.thickness, "m") | size
            return size | convex | _solid_rows(reached)
        case ReachableRegion():
            size = _size("area (in one plane)", reached.area, reached.area_error, "m²")
            size |= _size("convex area", reached.convex_area, reached.convex_area_error, "m²")
            share: Rows = {"unreachability": (reached.unreachability, "")}
            return size | (share if reached.convex_area > 0.0 else {})
        case ReachableSurface():
            return _size("area", reached.area, reached.area_error, "m²") | convex
        case ReachableCurve():
            size = (reached.curve_length, reached.curve_length_error)
            return _size("length", *size, "m") | convex
        case ReachablePoint():
            places = zip("xyz", reached.tip, strict=True)
            return {axis: (float(place), "m") for axis, place in places}
    raise AssertionError(reached)


def _size(name: str, value: float, error: float, unit: str) -> Rows:
    return {name: (value, unit), f"{name} error (estimate)": (error, unit)}


def _solid_rows(reached: ReachableSolid) -> Rows:
    rows: Rows = {"unreachability": (reached.unreachability, ""), "route": (reached.route, "")}
    for times, volume in reached.multiplicity.items():
        if volume > 1e-7 * reached.volume:
            rows[f"reached by {times} activation{'s' * (times > 1)}"] = (volume, "m³")
    if reached.multiplicity:
        rows["behind folds"] = (reached.fold_volume, "m³")
    return rows
