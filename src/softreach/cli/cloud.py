"""`softreach cloud`, `volume` and `show`: samples of what an arm reaches."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated

import softreach as sr
from softreach.cli import options
from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.design import load_rows
from softreach.cli.values import Number, Rows
from softreach.support.memory import check_memory

if TYPE_CHECKING:
    import xarray as xr

    from softreach.geometry.hull import Hull


def cloud(
    design: options.Design,
    /,
    *,
    sampling: options.Sampling = options.SAMPLING,
    tol: Number = 1e-6,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Sample the reachability cloud of a design and store it as Zarr.

    Example: softreach cloud minimal_trunk --n 400000 --out trunk.zarr

    Args:
        tol: Largest tip error, in L.
        out: Where the cloud goes (.zarr): DESIGN.zarr, in this folder, if left out.
    """
    from softreach.cloud.clouds import CLOUD_STORE

    arm = design_from(design, changes, output.unit)
    out = out or Path(f"{Path(design).stem}.zarr")
    options.check_output(out, CLOUD_STORE, output.overwrite)
    arguments = sampling.arguments
    start = perf_counter()
    dataset = sr.compute_cloud(arm, **arguments, tol=tol)
    seconds = perf_counter() - start
    sr.save_cloud(dataset, out, overwrite=output.overwrite)
    rows: Rows = {
        "samples": (sampling.count, ""),
        "sampler": (arguments["sampler"], ""),
        "seed": (arguments["seed"], ""),
        "steps per arm": (sr.rod.as_tip_map(arm, tol).steps, ""),
        "time to compute": (round(seconds, 3), "s"),
        **load_rows(arm),
        **{
            status.name.lower().replace("_", " "): (int((dataset.status == status).sum()), "")
            for status in (sr.rod.TipStatus if "status" in dataset else ())
        },
        "highest tip": (float(dataset.tip[:, 2].max()), "m"),
        "lowest tip": (float(dataset.tip[:, 2].min()), "m"),
        "cloud": (str(out), ""),
    }
    console.rows(f"cloud of {design}", rows, output.json, arm)


def volume(
    source: options.Source,
    /,
    *,
    alpha: str = "0.05L",
    sampling: options.Sampling = options.SAMPLING,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Estimate volumes and unreachability from a cloud.

    The volume is that of an α-shape; the number of samples limits its accuracy.
    softreach reach computes the exact volume, without samples and with its error.

    Example: softreach volume trunk.zarr --alpha 0.03L --out hull.ply

    Args:
        alpha: α-shape radius: 0.05L, 5cm, 0.05 (m), or critical.
        out: Write the α-shape here: .ply .stl .obj .glb .3mf .vtu
    """
    from softreach.export.surfaces import SURFACE_FILES
    from softreach.schema import is_stable

    options.check_output(out, SURFACE_FILES, output.overwrite)
    options.radius_of(alpha, 1.0)  # what is wrong with it is said before the cloud is computed
    if not options.is_stored(source):
        check_hull_memory(sampling.count)
    cloud, arm = options.cloud_of(source, sampling, changes, output.unit)
    bias = cloud.attrs["sampler"] == "uniform"
    concave = sr.concave_hull(cloud.tip, options.radius_of(alpha, arm.length), bias=bias)
    rows = volume_rows(concave, sr.convex_hull(cloud.tip))
    areas = sr.volume.flat_areas(cloud.tip.values[is_stable(cloud.tip)], concave.alpha)
    if areas is not None:
        share = 1 - areas[0] / areas[1] if areas[1] else None
        rows = {name: rows[name] for name in ("points", "alpha")}
        rows |= {"area (in one plane)": (areas[0], "m²"), "convex area": (areas[1], "m²")}
        rows["unreachability"] = (share, "")
    console.rows(f"volume of {source}", rows, output.json, arm)
    if out is not None:
        written = options.written_unit(arm)
        sr.export.export_mesh(concave, out, unit=written, overwrite=output.overwrite)
        console.written(out, written)


_BYTES = 700  # of memory that a sample and its share of the triangulation take at most


def check_hull_memory(n: int) -> None:
    """Refuse more samples than can be computed and triangulated in the free memory."""
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


def show(
    source: options.Source,
    /,
    *,
    color: str | None = None,
    activation: options.Activation = None,
    sampling: options.Sampling = options.SAMPLING,
    changes: Changes = UNCHANGED,
    out: Annotated[Path, options.OUT] = Path("cloud.png"),
    overwrite: options.Overwrite = False,
    unit: options.Unit = None,
) -> None:
    """Draw a cloud and its arm from four sides, or as a web page that turns.

    Three views are orthogonal, one is oblique; --activation bends the arm. A page
    (.html) is one file, which needs no network.

    Example: softreach show trunk.zarr --activation -1,0,-0.5 --out trunk.pdf

    Args:
        color: rgb (up to three bundles), strongest (the bundle that acts most; more than three),
            effort, the name of a bundle, or compliance (how far the tip yields).
        out: Picture file: .png .pdf .svg, or .html to turn
    """
    options.check_picture(out, overwrite, page=True)
    cloud, arm = options.cloud_of(source, sampling, changes, unit)
    shape = None if activation is None else options.shape_of(activation, arm)
    look = {"color": _colors(cloud, color), "unit": arm.length_unit}
    if options.is_page(out):
        figure = sr.plot.plot_3d([cloud, arm if shape is None else shape], **look)
    else:
        figure = sr.plot.plot_views(cloud, arm, shape, **look)
    options.save_picture(figure, out, overwrite)
    console.line(out)


def _colors(cloud: xr.Dataset, color: str | None) -> str | xr.DataArray | None:
    """The colors of the samples: a name that figures know, or numbers that they do not compute."""
    from softreach.plot.coloring import bundle_names

    if color != "compliance" or color in bundle_names(cloud):
        return color
    return sr.stiffness.cloud_compliance(cloud)["largest_compliance"]
