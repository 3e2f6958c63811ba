"""`softreach atlas`: sweeps over designs; build, status, verify, figures, best."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import AsJson, Durable, Sampler, Seed, design_from
from softreach.cli.numbers import WHOLE
from softreach.cli.output import print_rows
from softreach.cli.output_files import Overwrite, check_picture
from softreach.support.arguments import as_whole_number
from softreach.support.errors import InvalidInput, MissingExtra
from softreach.support.quantity import numbers_in, shortened

if TYPE_CHECKING:
    import xarray as xr

    from softreach.atlas import AtlasStatus
    from softreach.atlas.executor import ExecutorLike
    from softreach.atlas.space import DesignSpace

__all__ = ["atlas", "best", "build", "figures", "status", "verify"]

atlas = App(name="atlas", help="Clouds and volumes of whole families of designs.")

Store = Annotated[str, Parameter(help="The atlas: a folder (.zarr) or a URL.")]


@atlas.command
def build(
    store: Store,
    *,
    space: Annotated[Path | None, Parameter(help="Design space (.toml); or use --vary.")] = None,
    design: Annotated[str, Parameter(help="Base design for --vary.")] = "minimal_trunk",
    vary: Annotated[
        list[str] | None,
        Parameter(
            help="A parameter of the grid: taper_deg=0:3:16, left.bundles=1,2, or "
            "rings[0].material.young_modulus_pa=1e5,1e6."
        ),
    ] = None,
    changes: Changes = UNCHANGED,
    n: Annotated[int, WHOLE, Parameter(help="Samples of each design.")] = 400_000,
    seed: Seed = 0,
    sampler: Sampler = "uniform",
    alpha: Annotated[
        str, Parameter(help="Radius of the α-shapes over the length of each design, as in 0.05L.")
    ] = "0.05L",
    metrics: Annotated[
        str, Parameter(help="Groups of metrics, comma-separated.")
    ] = "extent,convex,concave,exact,curvature",
    keep_clouds: Annotated[bool, Parameter(help="Store the tips.")] = True,
    workers: Annotated[
        int | None, WHOLE, Parameter(help="Use this many processes instead of threads.")
    ] = None,
    scheduler: Annotated[str | None, Parameter(help="Dask scheduler: tcp://host:port")] = None,
    scheduler_file: Annotated[Path | None, Parameter(help="Dask scheduler file.")] = None,
    shard: Annotated[
        str, Parameter(help="Only part i of k, i from 0, as i/k; all k may share the store.")
    ] = "0/1",
    durable: Durable = False,
    json: AsJson = False,
) -> None:
    """Compute the cloud and the metrics of every design; run again to continue, or to mend damage.

    Examples: softreach atlas build a.zarr --vary revolution_deg=0:108:16 --vary taper_deg=0:3:16
    softreach atlas build atlas.zarr --space space.toml --shard 3/8
    """
    from softreach.atlas import build_atlas

    build_atlas(
        _space_of(space, design, vary, changes),
        store,
        n,
        seed,
        sampler=sampler,
        alpha_over_length=_over_length(alpha),
        metrics=tuple(metrics.split(",")),
        keep_clouds=keep_clouds,
        executor=_executor(workers, scheduler, scheduler_file),
        shard=_shard(shard),
        durable=durable,
    )
    status(store, json=json)


@atlas.command
def status(store: Store, *, json: AsJson = False) -> None:
    """How many designs are done, and what is wrong with the others.

    Example: softreach atlas status atlas.zarr
    """
    from softreach.atlas import atlas_status

    _print_status(store, atlas_status(store), json)


@atlas.command
def verify(store: Store, *, json: AsJson = False) -> None:
    """Read all of an atlas and check it; the command that built it computes again what is damaged.

    Example: softreach atlas verify atlas.zarr
    """
    from softreach.atlas import verify_atlas

    found = verify_atlas(store)
    _print_status(store, found, json)
    if found.damaged:
        allowed = "0; the command that built the atlas computes them again"
        raise InvalidInput(f"damaged designs of {store}", found.damaged, allowed)


def _print_status(store: str, found: AtlasStatus, json: bool) -> None:
    counts = ("designs", "done", "todo", "failed", "gaps", "unstable", "damaged")
    rows: dict[str, tuple[Any, str]] = {name: (getattr(found, name), "") for name in counts}
    rows["tips verified"] = ("yes" if found.tips_verified else "no: softreach atlas verify", "")
    if json:
        rows["tips verified"] = (found.tips_verified, "")
        rows["messages"] = ({str(k): text for k, text in found.messages.items()}, "")
    else:
        rows |= {f"number {k}": (text, "") for k, text in list(found.messages.items())[:10]}
    print_rows(f"atlas {store}", rows, json)


@atlas.command
def best(
    store: Store,
    metric: Annotated[str, Parameter(help="What to compare, e.g. exact_volume.")],
    *,
    smallest: Annotated[bool, Parameter(negative="", help="Prefer small values.")] = False,
    where: Annotated[
        list[str] | None,
        Parameter(help="A constraint: unreachability<=0.4 or taper_deg>=1."),
    ] = None,
    count: Annotated[int, WHOLE, Parameter(help="How many designs.")] = 1,
    json: AsJson = False,
) -> None:
    """The designs with the largest (or smallest) metric that meet the constraints.

    Example: softreach atlas best atlas.zarr exact_volume --where "taper_deg<=1" --count 3
    """
    from softreach.atlas import best_designs, open_atlas

    opened = open_atlas(store)
    written = _written_coordinates(opened)
    limits = dict(_constraint(text, written) for text in where or ())
    found = best_designs(opened, metric, smallest=smallest, where=limits, count=count)
    names = [name for name in found.variables if found[name].dtype.kind in "fi"]
    columns = [_written(found[name]) for name in names]
    rows: dict[str, tuple[Any, str]] = {name: (values, unit) for name, values, unit in columns}
    print_rows(f"best {metric} of {store}", rows, json)


@atlas.command
def figures(
    store: Store,
    *,
    out: Annotated[Path, Parameter(help="Folder for the figures.")] = Path("figures"),
    panels: Annotated[
        int, WHOLE, Parameter(help="Largest number of columns and rows of a sheet.")
    ] = 7,
    overwrite: Overwrite = False,
) -> None:
    """Draw the atlas, each figure as PNG and PDF: sheets, corners, maps, curvature.

    Example: softreach atlas figures atlas.zarr --out figures
    """
    import sys

    from softreach.atlas import open_atlas
    from softreach.paper.atlas_figures import atlas_figures
    from softreach.plot.style import pyplot, save_figure

    for suffix in ("png", "pdf"):  # tried by a name that any of them may have
        check_picture("out", out / f"clouds.{suffix}", overwrite)
    for name, figure in atlas_figures(open_atlas(store), panels):
        for suffix in ("png", "pdf"):
            save_figure(figure, out / f"{name}.{suffix}", overwrite=overwrite)
            sys.stdout.write(f"{out / name}.{suffix}\n")
        pyplot().close(figure.get_figure(root=True))


def _space_of(
    path: Path | None, design: str, vary: list[str] | None, changes: Changes
) -> DesignSpace:
    from softreach.arm.design_file import LONGEST
    from softreach.atlas.space import DesignSpace
    from softreach.atlas.space_file import parse_parameter, parse_space
    from softreach.support.files.text import read_text

    if (path is None) == (vary is None):
        raise InvalidInput("space", path, "given, or --vary, and not both")
    if path is not None:
        changes.refuse("left out with --space, whose file names the design")
        return parse_space(read_text("space", path, LONGEST), design_from)
    base = design_from(design, changes)
    return DesignSpace.grid(
        base, **dict(parse_parameter(base, *_key_and_values(text)) for text in vary or ())
    )


def _key_and_values(text: str) -> tuple[str, str]:
    """`taper_deg=0:3:16` in two; the name of an actuator may hold another =."""
    key, sign, values = text.rpartition("=")
    return (key, values) if sign else (text, "")


def _executor(
    workers: int | None, scheduler: str | None, scheduler_file: Path | None
) -> ExecutorLike:
    if workers is not None:
        from softreach.atlas.processes import WORKERS, worker_processes

        return worker_processes(as_whole_number("workers", workers, *WORKERS))
    if scheduler is None and scheduler_file is None:
        return None
    try:
        from distributed import Client
    except ModuleNotFoundError as error:
        raise MissingExtra("distributed", "cluster") from error
    return Client(scheduler) if scheduler else Client(scheduler_file=str(scheduler_file))


def _over_length(text: str) -> float:
    """0.05 from `0.05L`: a length in m would not suit designs of every length."""
    values = numbers_in(text.removesuffix("L"), 1) if text.endswith("L") else None
    radius = values[0] if values else 0.0
    if not 0 < radius < math.inf:
        raise InvalidInput(
            "alpha",
            shortened(text) or "''",
            "a radius > 0 over the length of each design, like 0.05L",
        )
    return radius


def _shard(text: str) -> tuple[int, int]:
    first, _, count = text.partition("/")
    if not (text.isascii() and first.isdigit() and count.isdigit() and len(text) < 20):
        raise InvalidInput("shard", shortened(text) or "''", "i/k with 0 <= i < k")
    return int(first), int(count)


def _written_coordinates(atlas: xr.Dataset) -> dict[str, xr.DataArray]:
    """The parameters of an atlas by their names with units."""
    from softreach.arm.parameters.shown import written_name

    return {
        written_name(str(name), values.attrs.get("units", "1")): values
        for name, values in atlas.coords.items()
    }


def _constraint(
    text: str, written: Mapping[str, xr.DataArray]
) -> tuple[str, tuple[float | None, float | None]]:
    """`taper_deg<=1` -> taper between anything and 1 degree, in radians."""
    from softreach.arm.parameters.shown import from_written

    for sign in ("<=", ">=", "<", ">"):
        name, found, number = text.partition(sign)
        if found:
            break
    values = numbers_in(number, 1)
    if values is None:
        allowed = "a name, <= or >=, and a finite number"
        raise InvalidInput("where", shortened(text) or "''", allowed)
    value = values[0]
    name = name.strip()
    if name in written:
        name, unit = str(written[name].name), str(written[name].attrs.get("units", "1"))
        value = from_written(value, unit)
    return name, (None, value) if "<" in sign else (value, None)


def _written(column: xr.DataArray) -> tuple[str, list[float], str]:
    """Name, values and unit as people read them."""
    import numpy as np

    unit = str(column.attrs.get("units", "1"))
    if unit == "rad":
        return str(column.name), np.round(np.degrees(column.values), 9).tolist(), "deg"
    return str(column.name), column.values.tolist(), {"m3": "m³", "1": ""}.get(unit, unit)
