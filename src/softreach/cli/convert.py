"""`softreach design`, `export`, `import`: a design described, and files of other programs."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

import softreach as sr
from softreach.cli import options
from softreach.cli.console import console, fields_of, for_machines
from softreach.cli.options import UNCHANGED, Changes, Number, design_from, shown_in
from softreach.support.errors import InvalidInput, NotPossible, no_warnings
from softreach.support.files.formats import FileFormat

_PAIR = "activefilaments: NAME.csv and NAME_gamma.csv as ActiveFilaments.jl has them."
Format = Annotated[str | None, Parameter(help=_PAIR)]
_OTHER = "for ActiveFilaments.jl, whose lengths are in m"


def design(
    design: options.Design,
    /,
    *,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Describe a design: angles, radii, stiffness, weight, warnings.

    --verbose adds where the linear law of each kind of actuator ends. With --out,
    --unit is written into the design file.

    Example: softreach design minimal_trunk --set taper=3deg

    Args:
        out: Write the design to this TOML file.
    """
    from softreach.arm.design_file import DESIGN_FILE

    with no_warnings():  # the report has them all
        arm = design_from(design, changes, output.unit)
    options.check_output(out, DESIGN_FILE, output.overwrite)
    facts = sr.describe(arm)
    if out is not None:
        arm.save(out, overwrite=output.overwrite)
    if output.json:
        console.json(for_machines(facts.rows, arm.length) | _for_machines(facts))
        return
    laws = facts.validity if console.verbose else ()
    console.line("\n  ".join([f"design {design}", *facts.table.splitlines(), *laws]))
    for warning in facts.warnings:
        console.note(f"warning: {warning}")


def _for_machines(facts: sr.rod.DesignSummary) -> dict[str, Any]:
    arm = facts.arm
    bundles: Any = {
        "name": arm.bundle_names,
        "unit": arm.bundle_units,
        "bounds": arm.bounds,
        "strain": facts.bundle_strain,
        "extension": facts.bundle_extension,
        "bending_times_R2": facts.bundle_bending,
    }
    drives = {"name": arm.input_names, "unit": arm.input_units, "bounds": arm.input_bounds}
    texts = {name: getattr(facts, name) for name in ("lacking", "validity", "warnings")}
    inputs = {"inputs": _records(drives)} if arm.drives else {}
    return {**inputs, "activations": _records(bundles), **texts}


def _records(columns: dict[str, Any]) -> list[dict[str, Any]]:
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def export(
    source: options.Source,
    out: Path,
    /,
    *,
    activation: options.Activation = None,
    format: Format = None,
    channel_mm: Number | None = None,
    changes: Changes = UNCHANGED,
    overwrite: options.Overwrite = False,
    unit: options.Unit = None,
) -> None:
    """Convert a cloud or an arm for other programs.

    A cloud becomes a table or points (.ply .csv .parquet .npz .vtu).
    A design becomes the surface of the bent arm with its fibers (.ply .stl .obj
    .glb .vtu), the source of a filament of ActiveFilaments.jl (.jl), a
    model for MuJoCo (.xml), kinematics in C (.h .c), the pattern of its rings
    (.svg .dxf), or, in a folder, its parts at rest as solids to print (STL).

    Example: softreach export minimal_trunk arm.glb --activation -1,0,-0.5

    Args:
        out: The file to write; its suffix chooses the format. A folder for parts.
        channel_mm: Diameter of the channels of tendons in parts.
    """
    from softreach.export.surfaces import SURFACE_FILES
    from softreach.support.files.text import write_text

    if format not in (None, "activefilaments"):
        raise InvalidInput("format", format, "activefilaments, or left out")
    if options.is_stored(source) or out.suffix:
        options.refuse("but on parts, in a folder", channel_mm=channel_mm)
    if options.is_stored(source):
        options.refuse("on a cloud, which has many", activation=activation)
        options.refuse(options.STORED, **changes.given)
        write = _export_pair if format else _export_cloud
        write(source, out, overwrite, unit)
    elif format is not None and out.suffix != ".jl":
        raise InvalidInput("out", out, "a file name ending in .jl for a filament's definition")
    elif out.suffix in (texts := _texts()):
        options.refuse("on a model or a pattern, which have none", activation=activation)
        arm = design_from(source, changes)
        options.refuse("on a model in m or a pattern in mm", unit=unit)
        options.check_output(out, dict.fromkeys(texts, FileFormat()), overwrite)
        write_text(out, texts[out.suffix](arm), overwrite=overwrite)
        console.line(out)
    elif not out.suffix:
        options.refuse("on parts, which are at rest", activation=activation)
        _export_parts(design_from(source, changes, unit or "mm"), out, channel_mm, overwrite)
    else:
        arm = design_from(source, changes, unit)
        options.check_output(out, SURFACE_FILES, overwrite)
        shape, written = options.shape_of(activation, arm), options.written_unit(arm)
        sr.export.export_arm(arm, shape, out, unit=written, overwrite=overwrite)
        console.written(out, written)
        console.line(out)


def _texts() -> dict[str, Callable[[sr.Manipulator], str]]:
    """What writes a design as the text of a file, by suffix."""
    from softreach.exchange.activefilaments import design_script

    models, dxf = sr.models, partial(sr.models.pattern, format="dxf")
    texts = {".jl": design_script, ".xml": models.mujoco, ".h": models.c, ".c": models.c}
    return {**texts, ".svg": models.pattern, ".dxf": dxf}


def _export_parts(arm: sr.Manipulator, out: Path, mm: float | None, overwrite: bool) -> None:
    from softreach.export.surfaces import SURFACE_FILES

    parts = sr.models.solids(arm, channel_diameter=None if mm is None else 1e-3 * mm)
    paths = [out / f"{name.replace('/', '_')}.stl" for name in parts]
    options.check_output(paths, SURFACE_FILES, overwrite)
    for path, part in zip(paths, parts.values(), strict=True):
        sr.export.export_mesh(part, path, unit=arm.length_unit, overwrite=overwrite)
        console.line(path)


def _export_cloud(source: str, out: Path, overwrite: bool, unit: str | None) -> None:
    from softreach.export.clouds import CLOUD_FILES

    options.check_output(out, CLOUD_FILES, overwrite)
    cloud = sr.open_cloud(source)
    written = options.written_unit(shown_in(unit, sr.cloud.design_of(cloud)))
    sr.export.export_cloud(cloud, out, unit=written, overwrite=overwrite)
    console.written(out, written)
    console.line(out)


def _export_pair(source: str, out: Path, overwrite: bool, unit: str | None) -> None:
    from softreach.exchange.activefilaments.cloud import CLOUD_PAIR, gamma_path, write_cloud

    options.refuse(_OTHER, unit=unit)
    options.check_output(written := [out, gamma_path(out)], CLOUD_PAIR, overwrite)
    write_cloud(sr.open_cloud(source), out, overwrite=overwrite)
    console.line("\n".join(map(str, written)))


def import_file(
    source: Path,
    out: Path,
    /,
    *,
    design: str | None = None,
    tol: Number | None = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Convert a filament or a cloud of ActiveFilaments.jl.

    The docs show how Julia writes a filament as JSON. A cloud is NAME.csv with
    NAME_gamma.csv beside it; its tips are compared with softreach's own.

    Example: softreach import filament.json filament.toml

    Args:
        source: Filament (.json), or cloud: NAME.csv, with NAME_gamma.csv beside it.
        out: Design (.toml) or cloud (.zarr) to write.
        design: Design that a cloud belongs to: .toml, .json or built-in.
        tol: Largest error of softreach's tips in that comparison, in L: 1e-6 if left out.
    """
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.cloud.clouds import CLOUD_STORE
    from softreach.exchange.activefilaments import read_cloud, read_design

    kind = "filament" if source.suffix == ".json" else "cloud"
    if source.suffix == ".json":
        options.refuse("on a filament, only on a cloud", design=design, tol=tol)
        options.check_output(out, DESIGN_FILE, output.overwrite)
        arm = shown_in(output.unit, read_design(source))
        arm.save(out, overwrite=output.overwrite)
        rows = fields_of({"length": arm.length, "rings": len(arm.section.rings)}, "length")
        rows |= fields_of({"bundle names": list(arm.bundle_names), "design": str(out)})
    elif source.suffix != ".csv":
        raise InvalidInput("source", source, "a file name ending in .json or .csv")
    elif design is None:
        raise NotPossible("a cloud needs the design that it was computed for: --design NAME.toml")
    else:
        given = read_design(design) if design.endswith(".json") else design_from(design)
        arm = shown_in(output.unit, given)
        options.check_output(out, CLOUD_STORE, output.overwrite)
        cloud = read_cloud(arm, source, tol=1e-6 if tol is None else tol)
        sr.save_cloud(cloud, out, overwrite=output.overwrite)
        rows = fields_of({"samples": cloud.sizes["sample"]})
        off = float(cloud.attrs["largest_tip_difference"])
        rows |= {"largest difference of tips": (off, "m"), "cloud": (str(out), "")}
    console.rows(f"{kind} of {source}", rows, output.json, arm)
