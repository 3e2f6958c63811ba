"""`softreach design`: angles, radii, stiffness, weight and loads of a design."""

from typing import Any

import softreach as sr
from softreach.cli import options
from softreach.cli.console import console, for_machines
from softreach.cli.options import UNCHANGED, Changes, design_from
from softreach.support.errors import NotPossible, no_warnings


def design(
    design: options.Design | None = None,
    /,
    *,
    schema: bool = False,
    changes: Changes = UNCHANGED,
    out: options.Out = None,
    output: options.Output = options.DEFAULT,
) -> None:
    """Describe a design: angles, radii, stiffness, weight, warnings.

    --verbose adds where the linear law of each kind of actuator ends. With --out,
    --unit is written into the design file.

    Example: softreach design minimal_trunk --taper-deg 3

    Args:
        schema: Print the JSON schema of design files for editors, nothing else.
        out: Write the design to this TOML file.
    """
    from softreach.arm.design_file import DESIGN_FILE

    if schema:
        given = {"out": out, "overwrite": output.overwrite, "unit": output.unit}
        options.refuse("with --schema", **given, **changes.given)
        from softreach.arm.design_reader import json_schema

        console.json(json_schema(), indent=2)
        return
    if design is None:
        raise NotPossible("give a design file or a built-in design, or use --schema")
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
    bundles: Any = {"name": arm.bundle_names, "unit": arm.bundle_units, "bounds": arm.bounds}
    bundles |= {"strain": facts.bundle_strain, "extension": facts.bundle_extension}
    bundles |= {"bending_times_R2": facts.bundle_bending}
    drives = {"name": arm.input_names, "unit": arm.input_units, "bounds": arm.input_bounds}
    texts = {name: getattr(facts, name) for name in ("lacking", "validity", "warnings")}
    inputs = {"inputs": _records(drives)} if arm.drives else {}
    return {**inputs, "activations": _records(bundles), **texts}


def _records(columns: dict[str, Any]) -> list[dict[str, Any]]:
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
