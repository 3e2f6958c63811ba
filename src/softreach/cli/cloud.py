"""`softreach cloud`: compute a reachability cloud and store it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import AsJson, Design, Durable, Sampler, Seed, design_from
from softreach.cli.load_rows import load_rows
from softreach.cli.numbers import NUMBER, WHOLE
from softreach.cli.output import print_rows
from softreach.cli.output_files import Overwrite, check_output

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["cloud"]


def cloud(
    design: Design,
    *,
    out: Annotated[Path, Parameter(help="Where the cloud goes (.zarr).")] = Path("cloud.zarr"),
    n: Annotated[int, WHOLE, Parameter(help="Number of samples.")] = 400_000,
    seed: Seed = 0,
    sampler: Sampler = "uniform",
    tol: Annotated[float, NUMBER, Parameter(help="Largest tip error, in L.")] = 1e-6,
    durable: Durable = False,
    overwrite: Overwrite = False,
    changes: Changes = UNCHANGED,
    json: AsJson = False,
) -> None:
    """Compute the reachability cloud of a design and store it as Zarr.

    Example: softreach cloud minimal_trunk --n 400000 --out trunk.zarr
    """
    from time import perf_counter

    from softreach.cloud.clouds import CLOUD_STORE, compute_cloud, sample_bytes, save_cloud
    from softreach.rod.tip_map import tip_map
    from softreach.support.memory import check_disk

    arm = design_from(design, changes)
    check_output("out", out, CLOUD_STORE, overwrite)
    check_disk("n", n, sample_bytes(arm.bundles) * n, out)
    start = perf_counter()
    dataset = compute_cloud(arm, n, seed=seed, sampler=sampler, tol=tol)
    seconds = perf_counter() - start
    save_cloud(dataset, out, durable=durable, overwrite=overwrite)
    rows = {
        "samples": (n, ""),
        "sampler": (sampler, ""),
        "seed": (seed, ""),
        "steps per arm": (tip_map(arm, tol).steps, ""),
        "time to compute": (round(seconds, 3), "s"),
        **load_rows(arm.loads),
        **_status_rows(dataset),
        "highest tip": (float(dataset.tip[:, 2].max()) / arm.length, "L"),
        "lowest tip": (float(dataset.tip[:, 2].min()) / arm.length, "L"),
        "cloud": (str(out), ""),
    }
    print_rows(f"cloud of {design}", rows, json)


def _status_rows(cloud: xr.Dataset) -> dict[str, tuple[Any, str]]:
    """How many samples of a loaded arm are stable, unstable, and without equilibrium."""
    if "status" not in cloud:
        return {}
    from softreach.rod.tip_map import TipStatus

    return {
        status.name.lower().replace("_", " "): (int((cloud.status == status).sum()), "")
        for status in TipStatus
    }
