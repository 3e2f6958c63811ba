"""`softreach atlas`: sweeps over designs; build, status, best."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated, Any

from cyclopts import App, Parameter

import softreach as sr
from softreach.cli import options
from softreach.cli.console import console, rows_of
from softreach.cli.options import UNCHANGED, Changes, Whole, design_from, pairs_in, read_as
from softreach.support.arguments import POSITIVE
from softreach.support.errors import InvalidInput, NotPossible, counted
from softreach.support.quantity import read_number

atlas = App(
    name="atlas",
    help="""Compute and compare whole families of designs, kept in one store.

Example: softreach atlas build a.zarr --vary taper_deg=0:3:4
""",
)

Store = Annotated[str, Parameter(help="The atlas: a folder (.zarr) or a URL.")]
_SHARD = "Compute one of k parts of the designs: 0/k to k-1/k; all may share the store."
Shard = Annotated[str, Parameter(help=_SHARD)]


@atlas.command
def build(
    store: Store,
    /,
    *,
    vary: list[str],
    design: str = "minimal_trunk",
    sampling: options.Sampling = options.SAMPLING,
    alpha: str | None = None,
    metrics: str | None = None,
    keep_clouds: Annotated[bool, Parameter(negative="--no-keep-clouds")] = True,
    shard: Shard = "0/1",
    changes: Changes = UNCHANGED,
    device: options.Device = "cpu",
    json: options.AsJson = False,
) -> None:
    """Compute the clouds and the metrics of all designs.

    The same command continues after an interruption, and computes damaged
    designs again.

    Example: softreach atlas build a.zarr --vary taper_deg=0:3:9 --vary length_m=1,2

    Args:
        vary: A parameter of the grid: taper_deg=0:3:16, left.bundles=1,2, or
            rings[0].material.young_modulus_pa=1e5,1e6. May be repeated.
        design: Design that --vary changes: minimal_trunk if left out.
        alpha: Radius of the α-shapes over the length of each design: 0.05L if left out.
        metrics: Groups of metrics, comma-separated, if not all: extent, convex, concave, exact,
            curvature, stability; or names of metrics of your own.
        keep_clouds: Store the tips.
        device: What computes the tips: cpu, or cuda (a GPU), which takes arms without loads.
    """
    first, _, count = shard.partition("/")
    if not (shard.isascii() and first.isdigit() and count.isdigit() and len(shard) < 20):
        raise InvalidInput("shard", shard or "''", "i/k with 0 <= i < k")
    groups = tuple(sr.atlas.METRIC_GROUPS if metrics is None else metrics.split(","))
    if "concave" not in groups:
        options.refuse("without the metrics concave", alpha=alpha)
    how: Any = {
        "metrics": groups,
        "keep_clouds": keep_clouds,
        "shard": (int(first), int(count)),
        "device": device,
    }
    alpha = "0.05L" if alpha is None else alpha  # in m it would not suit designs of every length
    bare = alpha[:-1] if alpha.endswith("L") else ""
    allowed = "a radius > 0 over the length of each design, like 0.05L"
    radius = read_as("alpha", alpha, lambda _: read_number(bare), allowed, POSITIVE)
    base, how = design_from(design, changes), how | sampling.arguments
    sr.build_atlas(grid_of(base, vary), store, alpha_over_length=radius, **how)
    status(store, json=json)


@atlas.command
def status(store: Store, /, *, verify: bool = False, json: options.AsJson = False) -> None:
    """Count the designs that are done, and explain the others.

    Example: softreach atlas status atlas.zarr

    Args:
        verify: Read all of the atlas and check it.
    """
    state = sr.atlas.verify_atlas(store) if verify else sr.atlas.atlas_status(store)
    if json:
        console.json(asdict(state))
    else:
        console.line("\n  ".join([f"atlas {store}", *str(state).splitlines()]))
    if verify and state.damaged:
        many = f"{counted(state.damaged, 'design')} of {store} damaged"
        raise NotPossible(f"{many}: run the command that built the atlas again")


@atlas.command
def best(
    store: Store,
    metric: str,
    /,
    *,
    smallest: bool = False,
    where: list[str] | None = None,
    count: Whole = 1,
    out: options.Out = None,
    overwrite: options.Overwrite = False,
    json: options.AsJson = False,
) -> None:
    """Find the designs with the largest metric, under constraints.

    Example: softreach atlas best a.zarr exact_volume --where "taper_deg<=1"

    Args:
        metric: A metric, as softreach list metrics names it.
        smallest: Prefer small values.
        where: A constraint, unreachability<=0.4 or taper_deg>=1. May be repeated.
        count: Number of designs.
        out: Design file (.toml) for the best of them.
    """
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.atlas.reading import command_of

    options.check_output(out, DESIGN_FILE, overwrite)
    atlas = sr.open_atlas(store)
    where = where or []
    designs = sr.atlas.best_designs(atlas, metric, smallest=smallest, where=where, count=count)
    if out is not None:
        if not designs.sizes["rank"]:
            raise NotPossible(f"no design of {store} meets {' and '.join(where)}")
        first = {name: float(designs[name][0]) for name in command_of(atlas).space.names}
        sr.atlas.atlas_design(atlas, **first).save(out, overwrite=overwrite)
    console.rows(f"best {metric} of {store}", rows_of(designs), json)


def grid_of(base: sr.Manipulator, vary: list[str]) -> sr.DesignSpace:
    """The grid that `--vary` asks for."""
    from softreach.atlas.space import parse_parameter

    pairs = pairs_in("vary", vary, "NAME=VALUES, such as taper_deg=0:3:8")
    return sr.DesignSpace.grid(base, **dict(parse_parameter(base, *pair) for pair in pairs.items()))
