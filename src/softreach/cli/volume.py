"""`softreach volume`: how much space a cloud fills."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import AsJson, Sampler, Source, cloud_of, radius_of
from softreach.cli.output import print_rows

if TYPE_CHECKING:
    from softreach.geometry.hull import Hull

__all__ = ["volume", "volume_rows"]


def volume(
    source: Source,
    *,
    alpha: Annotated[
        str, Parameter(help="α-shape radius: 0.05L, 0.05 (m), or critical.")
    ] = "0.05L",
    n: Annotated[int, Parameter(help="Samples, when the source is a design.")] = 400_000,
    seed: int = 0,
    sampler: Sampler = "uniform",
    hull: Annotated[
        Path | None, Parameter(help="Write the α-shape here: .ply .stl .obj .glb .vtu .vtk")
    ] = None,
    changes: Changes = UNCHANGED,
    json: AsJson = False,
) -> None:
    """Volume of a cloud's α-shape and convex hull, its unreachability, and the sampling bias.

    Example: softreach volume trunk.zarr --alpha 0.03L --hull hull.ply
    """
    from softreach.volume import concave_hull, convex_hull

    cloud = cloud_of(source, n, seed, sampler, changes)
    length = float(cloud.tip.attrs["length"])
    concave = concave_hull(
        cloud.tip, radius_of(alpha, length), bias=cloud.attrs["sampler"] == "uniform"
    )
    print_rows(f"volume of {source}", volume_rows(concave, convex_hull(cloud.tip), length), json)
    if hull is not None:
        from softreach.export import export_mesh

        export_mesh(concave, hull)


def volume_rows(concave: Hull, convex: Hull, length: float) -> dict[str, tuple[Any, str]]:
    """The rows that say how large a cloud is and how far to trust it."""
    cube = length**3
    corrected = concave.volume_corrected
    share = 1 - concave.volume / convex.volume if convex.volume else None
    return {
        "points": (concave.n, ""),
        "alpha": (concave.alpha / length, "L"),
        "mean spacing": (concave.spacing / length, "L"),
        "regions": (concave.regions, ""),
        "volume": (concave.volume / cube, "L³"),
        "volume without sampling bias (estimate)": (
            None if corrected is None else corrected / cube,
            "L³",
        ),
        "convex volume": (convex.volume / cube, "L³"),
        "unreachability": (share, ""),
    }
