"""`softreach design`: what follows from a design."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from softreach.cli.changes import UNCHANGED, Changes
from softreach.cli.inputs import AsJson, Design, design_from
from softreach.cli.load_rows import load_rows, rest_rows
from softreach.cli.output import print_rows
from softreach.cli.output_files import Overwrite, check_output

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator
    from softreach.arm.summary import DesignSummary

__all__ = ["design"]

Rows = dict[str, tuple[Any, str]]


def design(
    design: Design | None = None,
    *,
    changes: Changes = UNCHANGED,
    save: Annotated[Path | None, Parameter(help="Write the design to this TOML file.")] = None,
    overwrite: Overwrite = False,
    schema: Annotated[
        bool, Parameter(negative="", help="Print the JSON schema of design files for editors.")
    ] = False,
    verbose: Annotated[
        bool, Parameter(negative="", help="Say where the linear laws of the actuators end.")
    ] = False,
    json: AsJson = False,
) -> None:
    """Print what follows from a design: angles, radii, stiffness, weight, ranges, warnings.

    Example: softreach design minimal_trunk --taper-deg 3
    """
    import sys

    from softreach.arm.design_file import DESIGN_FILE
    from softreach.arm.summary import describe
    from softreach.support.errors import InvalidInput

    if schema:
        sys.stdout.write(_schema_text())
        return
    if design is None:
        raise InvalidInput("design", design, "a design file or a built-in design, or use --schema")
    arm = design_from(design, changes)
    check_output("save", save, DESIGN_FILE, overwrite)
    facts = describe(arm)
    if save is not None:
        arm.save(save, overwrite=overwrite)
    if json:
        print_rows("", {**_rows(arm, facts), **_rows_for_machines(arm, facts)}, as_json=True)
        return
    print_rows(f"design {design}", {**_rows(arm, facts), **_bundle_rows(arm, facts)}, as_json=False)
    for note in (*facts.lacking, *(facts.validity if verbose else ())):
        sys.stdout.write(f"  {note}\n")
    for warning in facts.warnings:
        sys.stderr.write(f"warning: {warning}\n")


def _schema_text() -> str:
    import json

    from softreach.arm.design_file.schema import json_schema

    return json.dumps(json_schema(), indent=2) + "\n"


def _rows(arm: Manipulator, facts: DesignSummary) -> Rows:
    rows: Rows = {"bundles": (arm.bundles, ""), "bundle names": (list(arm.bundle_names), "")}
    if arm.fibers:
        rows["helical angle"] = (_degrees(facts.helical_angles), "deg")
        rows["revolution"] = (_degrees(facts.revolutions), "deg")
    rows |= {
        "length": (arm.length, "m"),
        "outer radius at base": (facts.base_radius, "m"),
        "outer radius at tip": (facts.tip_radius, "m"),
        "base to tip ratio": (facts.taper_ratio, ""),
        "inner to outer radius": (facts.radius_ratio, ""),
    }
    if facts.breakpoints:
        rows["breakpoints"] = (list(facts.breakpoints), "m")
    rows |= {
        "extension": (list(facts.extension), ""),
        "curvature times L": (list(facts.curvature), ""),
    }
    return rows | _rows_of_matter(facts) | load_rows(arm.loads) | rest_rows(arm)


def _rows_of_matter(facts: DesignSummary) -> Rows:
    """Stiffnesses at base and tip, mass and load number: what is known of them."""
    rows: Rows = {}
    if facts.stiffness is not None:
        units = {"K0": "N", "K1": "N m²", "K3": "N m²"}
        for (name, unit), values in zip(units.items(), facts.stiffness, strict=True):
            rows[f"{name} at base and tip"] = (values.tolist(), unit)
    if facts.mass is not None:
        rows["mass"] = (facts.mass, "kg")
    if facts.load_number is not None:
        rows["load number"] = (facts.load_number, "")
    return rows


def _bundle_rows(arm: Manipulator, facts: DesignSummary) -> Rows:
    """What each activation does alone, in words."""
    units = ("" if unit == "1" else f" {unit}" for unit in arm.bundle_units)
    ranges = zip(arm.bounds, units, facts.bundle_extension, facts.bundle_bending, strict=True)
    return {
        f"activation {name}": (
            f"{_span(bounds)}{unit}: ζ {_span(extension)}, |κ| R2 {_span(bending)}",
            "",
        )
        for name, (bounds, unit, extension, bending) in zip(arm.bundle_names, ranges, strict=True)
    }


def _span(ends: Any) -> str:
    return f"{ends[0]:.4g} to {ends[1]:.4g}"


def _rows_for_machines(arm: Manipulator, facts: DesignSummary) -> Rows:
    activations = [
        {
            "name": name,
            "unit": unit,
            "bounds": bounds.tolist(),
            "extension": extension.tolist(),
            "bending_times_R2": bending.tolist(),
        }
        for name, unit, bounds, extension, bending in zip(
            arm.bundle_names,
            arm.bundle_units,
            arm.bounds,
            facts.bundle_extension,
            facts.bundle_bending,
            strict=True,
        )
    ]
    return {
        "activations": (activations, ""),
        "lacking": (list(facts.lacking), ""),
        "validity": (list(facts.validity), ""),
        "warnings": (list(facts.warnings), ""),
    }


def _degrees(angles: Any) -> list[float]:
    import numpy as np

    return [round(float(angle), 9) for angle in np.degrees(angles)]
