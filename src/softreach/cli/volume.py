"""`softreach volume`: how much space a cloud fills."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import (
    AsJson,
    Sampler,
    Samples,
    Seed,
    Source,
    cloud_of,
    is_stored,
    radius_of,
)
from softreach.cli.output import print_rows
from softreach.cli.output_files import Overwrite, check_surface

if TYPE_CHECKING:
    from softreach.geometry.hull import Hull

__all__ = ["check_hull_memory", "volume", "volume_rows"]


def volume(
    source: Source,
    *,
    alpha: Annotated[
        str, Parameter(help="α-shape radius: 0.05L, 0.05 (m), or critical.")
    ] = "0.05L",
    n: Samples = 400_000,
    seed: Seed = 0,
    sampler: Sampler = "uniform",
    hull: Annotated[
        Path | None, Parameter(help="Write the α-shape here: .ply .stl .obj .glb .vtu .vtk")
    ] = None,
    overwrite: Overwrite = False,
    changes: Changes = UNCHANGED,
    json: AsJson = False,
) -> None:
    """Volume of a cloud's α-shape and convex hull, its unreachability, and the sampling bias.

    Example: softreach volume trunk.zarr --alpha 0.03L --hull hull.ply
    """
    from softreach.cloud.volume import concave_hull, convex_hull

    check_surface("hull", hull, overwrite)
    if not is_stored(source):
        radius_of(alpha, 1.0)  # what is wrong with it is said before the cloud is computed
        check_hull_memory(n)
    cloud = cloud_of(source, n, seed, sampler, changes)
    length = float(cloud.tip.attrs["length"])
    concave = concave_hull(
        cloud.tip, radius_of(alpha, length), bias=cloud.attrs["sampler"] == "uniform"
    )
    rows = volume_rows(concave, convex_hull(cloud.tip), length)
    if hull is not None:
        from softreach.export import export_mesh

        export_mesh(concave, hull, overwrite=overwrite)
    print_rows(f"volume of {source}", rows, json)


_BYTES = 700  # of memory that a sample and its share of the triangulation take at most


def check_hull_memory(n: int) -> None:
    """Refuse more samples than can be computed and triangulated in the free memory."""
    from softreach.support.memory import check_memory

    check_memory("n", n, _BYTES * n)


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
