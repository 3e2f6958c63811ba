"""`softreach volume`: how much space a cloud fills."""

from __future__ import annotations

from typing import TYPE_CHECKING

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.console import console
from softreach.cli.lengths import Rows
from softreach.cli.options import (
    SAMPLING,
    AsJson,
    Out,
    Overwrite,
    Sampling,
    Source,
    Unit,
    check_surface,
    cloud_of,
    radius_of,
)

if TYPE_CHECKING:
    from softreach.geometry.hull import Hull


def volume(
    source: Source,
    /,
    *,
    alpha: str = "0.05L",
    sampling: Sampling = SAMPLING,
    changes: Changes = UNCHANGED,
    out: Out = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Estimate volumes and unreachability from a cloud.

    The volume is that of an α-shape of the samples, which limit its accuracy.
    softreach reach computes the exact volume, without samples and with its error.

    Example: softreach volume trunk.zarr --alpha 0.03L --out hull.ply

    Args:
        alpha: α-shape radius: 0.05L, 5cm, 0.05 (m), or critical.
        out: Write the α-shape here: .ply .stl .obj .glb .vtu
    """
    from softreach.cloud.volume import concave_hull, convex_hull, flat_areas
    from softreach.schema import is_stable

    check_surface(out, overwrite)
    radius_of(alpha, 1.0)  # what is wrong with it is said before the cloud is computed
    cloud, lengths = cloud_of(source, sampling, changes, unit, check_hull_memory)
    bias = cloud.attrs["sampler"] == "uniform"
    concave = concave_hull(cloud.tip, radius_of(alpha, lengths.length), bias=bias)
    rows = volume_rows(concave, convex_hull(cloud.tip))
    areas = flat_areas(cloud.tip.values[is_stable(cloud.tip)], concave.alpha)
    if areas is not None:
        share = 1 - areas[0] / areas[1] if areas[1] else None
        rows = {name: rows[name] for name in ("points", "alpha")}
        rows |= {"area (in one plane)": (areas[0], "m²"), "convex area": (areas[1], "m²")}
        rows["unreachability"] = (share, "")
    console.rows(f"volume of {source}", rows, json, lengths)
    if out is not None:
        from softreach.export import export_mesh

        export_mesh(concave, out, unit=lengths.written, overwrite=overwrite)
        console.written(out, lengths)


_BYTES = 700  # of memory that a sample and its share of the triangulation take at most


def check_hull_memory(n: int) -> None:
    """Refuse more samples than can be computed and triangulated in the free memory."""
    from softreach.support.memory import check_memory

    check_memory("n", n, _BYTES * n)


def volume_rows(concave: Hull, convex: Hull) -> Rows:
    """The size of a cloud and the trust that it deserves."""
    share = 1 - concave.volume / convex.volume if convex.volume else None
    return {
        "points": (concave.n, ""),
        "alpha": (concave.alpha, "m"),
        "mean spacing": (concave.spacing, "m"),
        "regions": (concave.regions, ""),
        "volume": (concave.volume, "m³"),
        "volume without sampling bias (estimate)": (concave.volume_corrected, "m³"),
        "convex volume": (convex.volume, "m³"),
        "unreachability": (share, ""),
    }
