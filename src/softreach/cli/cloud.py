"""`softreach cloud`: compute a reachability cloud and store it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.design import load_rows
from softreach.cli.lengths import Lengths, Rows
from softreach.cli.options import (
    SAMPLING,
    AsJson,
    Design,
    Out,
    Overwrite,
    Sampling,
    Unit,
    check_output,
)
from softreach.cli.values import Number

if TYPE_CHECKING:
    import xarray as xr


def cloud(
    design: Design,
    /,
    *,
    sampling: Sampling = SAMPLING,
    tol: Number = 1e-6,
    changes: Changes = UNCHANGED,
    out: Out = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Sample the reachability cloud of a design and store it as Zarr.

    Example: softreach cloud minimal_trunk --n 400000 --out trunk.zarr

    Args:
        tol: Largest tip error, in L.
        out: Where the cloud goes (.zarr): DESIGN.zarr, in this folder, if left out.
    """
    from time import perf_counter

    from softreach.cloud.clouds import CLOUD_STORE, compute_cloud, save_cloud
    from softreach.rod.rods import as_tip_map

    arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    out = out or Path(f"{Path(design).stem}.zarr")
    check_output(out, CLOUD_STORE, overwrite)
    arguments = sampling.arguments
    start = perf_counter()
    dataset = compute_cloud(arm, **arguments, tol=tol)
    seconds = perf_counter() - start
    save_cloud(dataset, out, overwrite=overwrite)
    rows: Rows = {
        "samples": (sampling.count, ""),
        "sampler": (arguments["sampler"], ""),
        "seed": (arguments["seed"], ""),
        "steps per arm": (as_tip_map(arm, tol).steps, ""),
        "time to compute": (round(seconds, 3), "s"),
        **load_rows(arm),
        **_status_rows(dataset),
        "highest tip": (float(dataset.tip[:, 2].max()), "m"),
        "lowest tip": (float(dataset.tip[:, 2].min()), "m"),
        "cloud": (str(out), ""),
    }
    console.rows(f"cloud of {design}", rows, json, lengths)


def _status_rows(cloud: xr.Dataset) -> Rows:
    if "status" not in cloud:
        return {}
    from softreach.rod.tip_map import TipStatus

    return {
        status.name.lower().replace("_", " "): (int((cloud.status == status).sum()), "")
        for status in TipStatus
    }
