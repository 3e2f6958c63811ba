"""`softreach import`: designs and clouds of other programs."""

from __future__ import annotations

from pathlib import Path

from softreach.cli.changes import design_from
from softreach.cli.console import console
from softreach.cli.lengths import Lengths, Rows
from softreach.cli.options import AsJson, Overwrite, Unit, check_output, refuse
from softreach.cli.values import Number
from softreach.support.errors import InvalidInput


def import_file(
    source: Path,
    out: Path,
    /,
    *,
    design: str | None = None,
    tol: Number | None = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Convert a filament or a cloud of ActiveFilaments.jl.

    The docs show how Julia writes a filament as JSON. A cloud is NAME.csv with
    NAME_gamma.csv beside it; its tips are compared with softreach's own.

    Example: softreach import filament.json filament.toml

    Args:
        source: Filament (.json), or cloud: NAME.csv of two files.
        out: Design (.toml) or cloud (.zarr) to write.
        design: Design that a cloud belongs to: .toml, .json or built-in.
        tol: Largest error of the tips that a cloud is compared with, in L (1e-6).
    """
    if source.suffix == ".json":
        refuse("on a filament, only on a cloud", design=design, tol=tol)
        _design(source, out, overwrite, unit, json)
    elif source.suffix == ".csv":
        _cloud(source, out, design, 1e-6 if tol is None else tol, overwrite, unit, json)
    else:
        raise InvalidInput("source", source, "a file name ending in .json or .csv")


def _design(source: Path, out: Path, overwrite: bool, unit: str | None, json: bool) -> None:
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.exchange.activefilaments import read_design

    check_output(out, DESIGN_FILE, overwrite)
    arm = read_design(source)
    lengths = Lengths.of(arm, unit)
    arm.save(out, overwrite=overwrite)
    rows: Rows = {
        "length": (arm.length, "m"),
        "rings": (len(arm.section.rings), ""),
        "bundle names": (list(arm.bundle_names), ""),
        "design": (str(out), ""),
    }
    console.rows(f"filament of {source}", rows, json, lengths)


def _cloud(
    source: Path,
    out: Path,
    design: str | None,
    tol: float,
    overwrite: bool,
    unit: str | None,
    json: bool,
) -> None:
    from softreach.cloud.clouds import CLOUD_STORE, save_cloud
    from softreach.exchange.activefilaments import read_cloud, read_design

    if design is None:
        allowed = "the design that the cloud was computed for"
        raise InvalidInput("design", None, allowed, "pass --design filament.toml")
    arm = read_design(design) if design.endswith(".json") else design_from(design)
    check_output(out, CLOUD_STORE, overwrite)
    lengths = Lengths.of(arm, unit)
    cloud = read_cloud(arm, source, tol=tol)
    save_cloud(cloud, out, overwrite=overwrite)
    difference = float(cloud.attrs["largest_tip_difference"])
    rows: Rows = {
        "samples": (cloud.sizes["sample"], ""),
        "largest difference of tips": (difference, "m"),
        "cloud": (str(out), ""),
    }
    console.rows(f"cloud of {source}", rows, json, lengths)
