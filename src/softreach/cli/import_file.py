"""`softreach import`: designs and clouds of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from softreach.cli.inputs import AsJson, design_from
from softreach.cli.numbers import NUMBER
from softreach.cli.output import print_rows
from softreach.cli.output_files import Overwrite, check_output
from softreach.support.errors import InvalidInput

__all__ = ["import_file"]


def import_file(
    source: Annotated[Path, Parameter(help="Filament (.jl), or cloud: NAME.csv of two files.")],
    out: Annotated[Path, Parameter(help="Design (.toml) or cloud (.zarr) to write.")],
    *,
    design: Annotated[
        str | None, Parameter(help="Design that a cloud belongs to: .toml, .jl or built-in.")
    ] = None,
    tol: Annotated[
        float, NUMBER, Parameter(help="Largest error of the tips compared with, in L.")
    ] = 1e-6,
    overwrite: Overwrite = False,
    json: AsJson = False,
) -> None:
    """Read the definition of a filament of ActiveFilaments.jl as a design, or a cloud of it.

    A cloud is NAME.csv with NAME_gamma.csv beside it; its tips are compared with softreach's own.
    Definitions are read, not run.

    Examples: softreach import filament.jl filament.toml;
    softreach import cloud.csv cloud.zarr --design filament.toml
    """
    if source.suffix == ".jl":
        _design(source, out, overwrite, json)
    elif source.suffix == ".csv":
        _cloud(source, out, design, tol, overwrite, json)
    else:
        raise InvalidInput("source", source, "a file name ending in .jl or .csv")


def _design(source: Path, out: Path, overwrite: bool, json: bool) -> None:
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.exchange.activefilaments import read_design

    _check_suffix(out, ".toml", "a design")
    check_output("out", out, DESIGN_FILE, overwrite)
    arm = read_design(source)
    arm.save(out, overwrite=overwrite)
    rows = {
        "length": (arm.length, "m"),
        "rings": (len(arm.section.rings), ""),
        "bundle names": (list(arm.bundle_names), ""),
        "design": (str(out), ""),
    }
    print_rows(f"filament of {source}", rows, json)


def _cloud(
    source: Path, out: Path, design: str | None, tol: float, overwrite: bool, json: bool
) -> None:
    from softreach.cloud.clouds import CLOUD_STORE, save_cloud
    from softreach.exchange.activefilaments import read_cloud, read_design

    _check_suffix(out, ".zarr", "a cloud")
    check_output("out", out, CLOUD_STORE, overwrite)
    if design is None:
        allowed = "the design that the cloud was computed for"
        raise InvalidInput("design", None, allowed, "pass --design filament.toml")
    arm = read_design(design) if design.endswith(".jl") else design_from(design)
    cloud = read_cloud(arm, source, tol=tol)
    save_cloud(cloud, out, overwrite=overwrite)
    difference = cloud.attrs["largest_tip_difference"]
    rows = {
        "samples": (cloud.sizes["sample"], ""),
        "largest difference of tips": (difference / arm.length, "L"),
        "cloud": (str(out), ""),
    }
    print_rows(f"cloud of {source}", rows, json)


def _check_suffix(out: Path, suffix: str, what: str) -> None:
    if out.suffix != suffix:
        raise InvalidInput("out", out, f"a file name ending in {suffix} for {what}")
