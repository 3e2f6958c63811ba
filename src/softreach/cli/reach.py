"""`softreach reach`: the exact reachable set of a design."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import AsJson, Design, design_from
from softreach.cli.load_rows import load_rows
from softreach.cli.numbers import NUMBER
from softreach.cli.output import print_rows
from softreach.cli.output_files import Overwrite, check_picture, check_surface
from softreach.support.errors import InvalidInput

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator
    from softreach.workspace import ReachableSet, ReachableSolid

__all__ = ["reach"]

_LEFT_OUT = "left out for a design with so few free bundles"


def reach(
    design: Design,
    *,
    accuracy: Annotated[
        float, NUMBER, Parameter(help="Relative error allowed in the volume.")
    ] = 3e-3,
    changes: Changes = UNCHANGED,
    surface: Annotated[
        Path | None, Parameter(help="Write the boundary: .ply .stl .obj .glb .vtu .vtk")
    ] = None,
    figure: Annotated[
        Path | None, Parameter(help="Draw slices through the base: .png .pdf .svg")
    ] = None,
    overwrite: Overwrite = False,
    json: AsJson = False,
) -> None:
    """The exact reachable set: volume with its error, blind share, multiplicity, folds."""
    from softreach.support import progress
    from softreach.workspace import reachable_set

    arm = design_from(design, changes)
    _check_outputs(arm, surface, figure, overwrite)
    with progress.bar("mapping the activation box", None) as shown:
        found = reachable_set(arm, accuracy=accuracy, progress=shown)
    rows = load_rows(arm.loads) | _rows(found) | _lost(found)
    _write(found, surface, figure, overwrite)
    print_rows(f"reachable set of {design}", rows, json)


def _check_outputs(
    arm: Manipulator, surface: Path | None, figure: Path | None, overwrite: bool
) -> None:
    """Refuse files that cannot be written, or that a set of so few dimensions has not."""
    free = int((arm.bounds[:, 0] < arm.bounds[:, 1]).sum())
    for name, path, needed in (("surface", surface, 2), ("figure", figure, 3)):
        if path is not None and free < needed:
            raise InvalidInput(name, path, _LEFT_OUT)
    check_surface("surface", surface, overwrite)
    check_picture("figure", figure, overwrite)


def _write(found: ReachableSet, surface: Path | None, figure: Path | None, overwrite: bool) -> None:
    from softreach.workspace import ReachableSolid, ReachableSurface

    if surface is not None:
        from softreach.export import export_mesh

        if not isinstance(found, ReachableSolid | ReachableSurface):
            raise InvalidInput("surface", surface, _LEFT_OUT)
        export_mesh(found.surface(), surface, overwrite=overwrite)
    if figure is not None:
        from softreach.plot import plot_slices, save_figure

        if not isinstance(found, ReachableSolid):
            raise InvalidInput("figure", figure, _LEFT_OUT)
        save_figure(plot_slices(found.grid), figure, overwrite=overwrite)


def _rows(found: ReachableSet) -> dict[str, tuple[Any, str]]:
    from softreach.workspace import ReachableCurve, ReachablePoint, ReachableSolid, ReachableSurface

    length = found.arm.length
    convex = {"convex volume": (found.convex_volume / length**3, "L³")}
    match found:
        case ReachableSolid():
            size = _size("volume", found.volume, found.volume_error, length, 3)
            return size | convex | _solid_rows(found)
        case ReachableSurface():
            return _size("area", found.area, found.area_error, length, 2) | convex
        case ReachableCurve():
            return _size("length", found.curve_length, found.curve_length_error, length, 1) | convex
        case ReachablePoint():
            places = zip("xyz", found.tip, strict=True)
            return {axis: (float(place) / length, "L") for axis, place in places}
    raise AssertionError(found)


def _lost(found: ReachableSet) -> dict[str, tuple[Any, str]]:
    """What is left out, if anything is: no stable equilibrium, or torn."""
    if not found.lost_share > 0.0:
        return {}
    return {"activation box left out": (100.0 * found.lost_share, "%")}


def _size(
    name: str, value: float, error: float, length: float, dimension: int
) -> dict[str, tuple[Any, str]]:
    scale, unit = length**dimension, ("", "L", "L²", "L³")[dimension]
    return {name: (value / scale, unit), f"{name} error (estimate)": (error / scale, unit)}


def _solid_rows(found: ReachableSolid) -> dict[str, tuple[Any, str]]:
    cube = found.arm.length**3
    rows: dict[str, tuple[Any, str]] = {
        "unreachability": (found.unreachability, ""),
        "route": (found.route, ""),
    }
    for times, volume in found.multiplicity.items():
        if volume > 1e-7 * found.volume:
            rows[f"reached by {times} activation{'s' * (times > 1)}"] = (volume / cube, "L³")
    if found.multiplicity:
        rows["behind folds"] = (found.fold_volume / cube, "L³")
    return rows
