"""`softreach reach`: the exact reachable set of a design."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from softreach.cli.inputs import AsJson, Design, RevolutionDeg, TaperDeg, design_from
from softreach.cli.output import print_rows

if TYPE_CHECKING:
    from softreach.workspace import ReachableSet

__all__ = ["reach"]


def reach(
    design: Design,
    *,
    accuracy: Annotated[float, Parameter(help="Relative error allowed in the volume.")] = 3e-3,
    revolution_deg: RevolutionDeg = None,
    taper_deg: TaperDeg = None,
    surface: Annotated[
        Path | None, Parameter(help="Write the boundary: .ply .stl .obj .glb .vtu .vtk")
    ] = None,
    figure: Annotated[
        Path | None, Parameter(help="Draw slices through the base: .png .pdf .svg")
    ] = None,
    json: AsJson = False,
) -> None:
    """The exact reachable set: volume with its error, blind share, multiplicity, folds."""
    from softreach import progress
    from softreach.workspace import reachable_set

    arm = design_from(design, revolution_deg, taper_deg)
    with progress.bar("mapping the activation box", None) as shown:
        found = reachable_set(arm, accuracy=accuracy, report=shown)
    print_rows(f"reachable set of {design}", _rows(found), json)
    if surface is not None:
        from softreach.export import export_mesh

        export_mesh(found.surface(), surface)
    if figure is not None:
        _draw(found, figure)


def _rows(found: ReachableSet) -> dict[str, tuple[Any, str]]:
    length = found.arm.length
    size, unit = length**found.dimension, ("", "L", "L²", "L³")[found.dimension]
    rows: dict[str, tuple[Any, str]] = {
        found.measure_name: (found.measure / size, unit),
        f"{found.measure_name} error (estimate)": (found.measure_error / size, unit),
        "convex volume": (found.convex_volume / length**3, "L³"),
    }
    if found.dimension < 3:
        return rows
    rows["unreachability"] = (found.unreachability, "")
    for times, volume in found.multiplicity.items():
        if volume > 1e-7 * found.volume:
            rows[f"reached by {times} activation{'s' * (times > 1)}"] = (volume / size, unit)
    if found.multiplicity:
        rows["behind folds"] = (found.fold_volume / size, unit)
    return rows


def _draw(found: ReachableSet, path: Path) -> None:
    from softreach.plot import plot_slices, save_figure

    save_figure(plot_slices(found.grid), path)
