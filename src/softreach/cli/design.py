"""`softreach design`: angles, radii, stiffness, weight and loads of a design."""

from __future__ import annotations

import math
from itertools import groupby
from operator import itemgetter
from typing import Any

import softreach as sr
from softreach.cli import options
from softreach.cli.console import Rows, console, to_degrees
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

    --verbose adds the limits of the linear laws of the actuators. With --out,
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
    details = _for_machines(arm, facts) if output.json else _bundle_rows(arm, facts)
    console.rows(f"design {design}", _rows(arm, facts) | details, output.json, arm)
    if not output.json:
        for note in (*facts.lacking, *(facts.validity if console.verbose else ())):
            console.line(f"  {note}")
        for warning in facts.warnings:
            console.note(f"warning: {warning}")


def _rows(arm: sr.Manipulator, facts: sr.rod.DesignSummary) -> Rows:
    from softreach.arm.number import fields_of

    rows: Rows = {"bundles": (arm.bundles, ""), "bundle names": (list(arm.bundle_names), "")}
    if arm.fibers:
        rows["helical angle"] = (to_degrees(facts.helical_angles), "deg")
        rows["revolution"] = (to_degrees(facts.revolutions), "deg")
    rows |= {
        "length": (arm.length, "m"),
        "outer radius at base": (facts.base_radius, "m"),
        "outer radius at tip": (facts.tip_radius, "m"),
        "base to tip ratio": (facts.taper_ratio, ""),
        "inner to outer radius": (facts.radius_ratio, ""),
        "breakpoints": (list(facts.breakpoints), "m"),
        **{f"station {name}": (z, "m") for name, z in arm.stations.items()},
    }
    for k, piece in enumerate(arm.rigid_pieces):
        rows[f"rigid piece {k}"] = (list(piece.span(arm.length)), "m")
    rows |= {
        "markers": ([marker.name for marker in arm.markers], ""),
        "extension": (list(facts.extension), ""),
        "curvature times L": (list(facts.curvature), ""),
    }
    if (measured := arm.section.measured) is not None:
        numbers = fields_of(type(measured)).values()
        known = [each.meaning for each in numbers if getattr(measured, each.field) is not None]
        rows["measured"] = (known, "")
    if facts.stiffness is not None:
        for name, values in zip(("K0", "K1", "K3"), facts.stiffness, strict=True):
            unit = "N" if name == "K0" else "N m²"
            rows[f"{name} at base and tip"] = (values.tolist(), unit)
    rows |= {"mass": (facts.mass, "kg"), "load number": (facts.load_number, "")}
    known = {name: row for name, row in rows.items() if row[0] not in (None, [])}
    return known | load_rows(arm) | _rest_rows(arm)


def _bundle_rows(arm: sr.Manipulator, facts: sr.rod.DesignSummary) -> Rows:
    """Bounds and effects of each activation; neighbors that are equal share a line."""
    texts = [
        f"{_span(arm.bounds[k], unit)}: length {_span(100.0 * facts.bundle_strain[k])} %, "
        f"ζ {_span(facts.bundle_extension[k])}, |κ| R2 {_span(facts.bundle_bending[k])}"
        for k, unit in enumerate(arm.bundle_units)
    ]
    rows: Rows = {}
    for text, group in groupby(zip(texts, arm.bundle_names, strict=True), itemgetter(0)):
        first, *others = [name for _, name in group]
        label = f"{first} to {others[-1]}" if len(others) > 1 else ", ".join([first, *others])
        rows[f"activation {label}"] = (text, "")
    for drive in arm.drives:
        gains = ", ".join(f"{gain:+g} {name}" for name, gain in drive.gains.items())
        rows[f"drive {drive.name}"] = (f"{_span(drive.bounds, drive.unit)}: {gains}", "")
    return rows


def _span(ends: Any, unit: str = "1") -> str:
    return f"{ends[0]:.4g} to {ends[1]:.4g}{'' if unit == '1' else f' {unit}'}"


def _for_machines(arm: sr.Manipulator, facts: sr.rod.DesignSummary) -> Rows:
    bundles = {
        "name": arm.bundle_names,
        "unit": arm.bundle_units,
        "bounds": arm.bounds,
        "strain": facts.bundle_strain,
        "extension": facts.bundle_extension,
        "bending_times_R2": facts.bundle_bending,
    }
    drives = {"name": arm.input_names, "unit": arm.input_units, "bounds": arm.input_bounds}
    texts = {name: (getattr(facts, name), "") for name in ("lacking", "validity", "warnings")}
    inputs = {"inputs": (_records(drives), "")} if arm.drives else {}
    return {**inputs, "activations": (_records(bundles), ""), **texts}


def _records(columns: dict[str, Any]) -> list[dict[str, Any]]:
    return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]


def load_rows(arm: sr.Manipulator) -> Rows:
    """Posture of the base, gravity, and all other loads that are not 0; all of it in the world."""
    from softreach.arm.number import fields_of

    loads, posed = arm.loads, not arm.base.is_identity
    rows: Rows = {"base": (str(arm.base), "")} if posed else {}
    if loads is None:
        return rows
    if any(loads.gravity):
        gravity = loads.seen_from(arm.base).gravity  # a straight arm points along +z there
        angle = to_degrees(math.acos(-gravity[2] / math.hypot(*gravity)))
        words = {0: "upright", 90: "sideways", 180: "hanging"}
        posture = words.get(round(angle, 6), f"tilted from upright by {angle:.4g}°")
        posture += f": {arm.base}" if posed else ""
        rows = {"gravity": (list(loads.gravity), "m/s²"), "base": (posture, "")}
    for field, number in fields_of(type(loads)).items():
        value = getattr(loads, field)
        if field != "gravity" and (any(value) if isinstance(value, tuple) else value):
            rows[field.replace("_", " ")] = (value, number.unit)
    return rows | ({"point loads": (len(loads.point_loads), "")} if loads.point_loads else {})


def _rest_rows(arm: sr.Manipulator) -> Rows:
    """Sag and stability of the arm without activation.

    Without loads: the sag under its own weight of an arm held sideways, and whether it would stand
    upright; nothing where moduli or densities are not known.
    """
    from softreach.arm.body import load_number_faults
    from softreach.arm.loads import GRAVITIES

    if load_number_faults(arm):
        return {}
    sideways, upright = " sideways", " upright"
    if arm.loads is not None:
        held = stood = _rest(arm)
        sideways = upright = ""
    else:
        ways = (sr.Loads(gravity=GRAVITIES[way]) for way in ("sideways", "down"))
        held, stood = (_rest(arm.replace(loads=loads, base=sr.Base())) for loads in ways)
    status = stood.status.name.lower() if stood else "unknown: the loads are too large"
    return {
        f"sag at rest{sideways}": (held.sag if held else None, "m"),
        f"at rest{upright}": (status.replace("_", " "), ""),
    }


def _rest(arm: sr.Manipulator) -> sr.rest.Rest | None:
    """The arm at rest; None under loads too large to compute it."""
    from softreach.rod.tip_map import InvalidLoads

    try:
        return sr.rest.rest(arm)
    except InvalidLoads:
        return None
