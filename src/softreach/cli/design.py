"""`softreach design`: angles, radii, stiffness, weight and loads of a design."""

from __future__ import annotations

import math
from itertools import groupby
from operator import itemgetter
from typing import TYPE_CHECKING, Any

from softreach.cli.changes import UNCHANGED, Changes, design_from
from softreach.cli.console import console
from softreach.cli.lengths import Lengths, Rows
from softreach.cli.options import AsJson, Design, Out, Overwrite, Unit, check_output, refuse
from softreach.cli.values import to_degrees
from softreach.support.errors import InvalidInput, NotPossible, no_warnings

if TYPE_CHECKING:
    from softreach.arm.manipulator import Manipulator
    from softreach.rest import Rest
    from softreach.rod.summary import DesignSummary


def design(
    design: Design | None = None,
    /,
    *,
    schema: bool = False,
    changes: Changes = UNCHANGED,
    out: Out = None,
    overwrite: Overwrite = False,
    unit: Unit = None,
    json: AsJson = False,
) -> None:
    """Describe a design: angles, radii, stiffness, weight, warnings.

    With --verbose it also says where the linear laws of the actuators end; --unit
    with --out goes into the design file.

    Example: softreach design minimal_trunk --taper-deg 3

    Args:
        schema: Print the JSON schema of design files for editors, nothing else.
        out: Write the design to this TOML file.
    """
    from softreach.arm.design_file import DESIGN_FILE
    from softreach.rod.summary import describe

    if schema:
        given = {"out": out, "overwrite": overwrite, "unit": unit}
        refuse("with --schema", **given, **changes.given)
        from softreach.arm.design_file.schema import json_schema

        console.json(json_schema(), indent=2)
        return
    if design is None:
        raise NotPossible("give a design file or a built-in design, or use --schema")
    with no_warnings():  # the report has them all
        arm = design_from(design, changes)
    lengths = Lengths.of(arm, unit)
    check_output(out, DESIGN_FILE, overwrite)
    facts = describe(arm)
    if out is not None:
        shown = arm if unit is None else arm.replace(display_unit=unit)
        shown.save(out, overwrite=overwrite)
    details = _rows_for_machines(arm, facts) if json else _bundle_rows(arm, facts)
    console.rows(f"design {design}", _rows(arm, facts) | details, json, lengths)
    if not json:
        for note in (*facts.lacking, *(facts.validity if console.verbose else ())):
            console.line(f"  {note}")
        for warning in facts.warnings:
            console.note(f"warning: {warning}")


def _rows(arm: Manipulator, facts: DesignSummary) -> Rows:
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
    }
    if facts.breakpoints:
        rows["breakpoints"] = (list(facts.breakpoints), "m")
    rows |= {f"station {name}": (z, "m") for name, z in arm.stations.items()}
    pieces = enumerate(arm.rigid_pieces)
    rows |= {f"rigid piece {k}": (list(piece.span(arm.length)), "m") for k, piece in pieces}
    if arm.markers:
        rows["markers"] = ([marker.name for marker in arm.markers], "")
    rows["extension"] = (list(facts.extension), "")
    rows["curvature times L"] = (list(facts.curvature), "")
    return rows | _measured_rows(arm) | _rows_of_matter(facts) | load_rows(arm) | _rest_rows(arm)


def _measured_rows(arm: Manipulator) -> Rows:
    from softreach.arm.number import fields_of

    if (measured := arm.section.measured) is None:
        return {}
    numbers = fields_of(type(measured)).values()
    known = [number.meaning for number in numbers if getattr(measured, number.field) is not None]
    return {"measured": (known, "")}


def _rows_of_matter(facts: DesignSummary) -> Rows:
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
    """Bounds and effects of each activation; neighbors that are equal share a line."""
    texts = [
        f"{_span(arm.bounds[k])}{_suffix(unit)}: length {_span(100.0 * facts.bundle_strain[k])} %, "
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
        rows[f"drive {drive.name}"] = (f"{_span(drive.bounds)}{_suffix(drive.unit)}: {gains}", "")
    return rows


def _suffix(unit: str) -> str:
    return "" if unit == "1" else f" {unit}"


def _span(ends: Any) -> str:
    return f"{ends[0]:.4g} to {ends[1]:.4g}"


def _rows_for_machines(arm: Manipulator, facts: DesignSummary) -> Rows:
    names = ("name", "unit", "bounds", "strain", "extension", "bending_times_R2")
    columns = (
        arm.bundle_names,
        arm.bundle_units,
        arm.bounds.tolist(),
        facts.bundle_strain.tolist(),
        facts.bundle_extension.tolist(),
        facts.bundle_bending.tolist(),
    )
    inputs = arm.input_names, arm.input_units, arm.input_bounds.tolist()
    drives = [dict(zip(names, row, strict=False)) for row in zip(*inputs, strict=True)]
    return {
        **({"inputs": (drives, "")} if arm.drives else {}),
        "activations": (
            [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)],
            "",
        ),
        "lacking": (list(facts.lacking), ""),
        "validity": (list(facts.validity), ""),
        "warnings": (list(facts.warnings), ""),
    }


def load_rows(arm: Manipulator) -> Rows:
    """Posture of the base, gravity, and all other loads that are not 0; all of it in the world."""
    from softreach.arm.number import fields_of

    loads, posed = arm.loads, not arm.base.is_identity
    rows: Rows = {"base": (str(arm.base), "")} if posed else {}
    if loads is None:
        return rows
    if any(loads.gravity):
        posture = _posture(loads.seen_from(arm.base).gravity)
        rows = {
            "gravity": (list(loads.gravity), "m/s²"),
            "base": (f"{posture}: {arm.base}" if posed else posture, ""),
        }
    for field, number in fields_of(type(loads)).items():
        value = getattr(loads, field)
        if field != "gravity" and (any(value) if isinstance(value, tuple) else value):
            rows[field.replace("_", " ")] = (value, number.unit)
    if loads.point_loads:
        rows["point loads"] = (len(loads.point_loads), "")
    return rows


def _posture(gravity: tuple[float, float, float]) -> str:
    """The way the base stands by gravity in its own frame: a straight arm points along +z there."""
    angle = to_degrees(math.acos(-gravity[2] / math.hypot(*gravity)))
    names = {0: "upright", 90: "sideways", 180: "hanging"}
    return names.get(round(angle, 6), f"tilted from upright by {angle:.4g}°")


def _rest_rows(arm: Manipulator) -> Rows:
    """Sag and stability of the arm without activation.

    Without loads: the sag under its own weight of an arm held sideways, and whether it would stand
    upright; nothing where moduli or densities are not known.
    """
    from softreach.arm.base import Base
    from softreach.arm.body import load_number_faults
    from softreach.arm.loads import GRAVITY, Loads

    if load_number_faults(arm):
        return {}
    if arm.loads is not None:
        rest = _rest(arm)
        return _sag("", rest) | {"at rest": (_stability(rest), "")}
    sideways, upright = (
        _rest(arm.replace(loads=Loads(gravity=gravity), base=Base()))
        for gravity in ((GRAVITY, 0.0, 0.0), (0.0, 0.0, -GRAVITY))
    )
    return _sag(" sideways", sideways) | {"at rest upright": (_stability(upright), "")}


def _rest(arm: Manipulator) -> Rest | None:
    """The arm at rest; None under loads too large to compute it."""
    from softreach.rest import rest

    try:
        return rest(arm)
    except InvalidInput as error:
        if error.name != "loads":
            raise
        return None


_STABILITY = {
    "STABLE": "stable",
    "UNSTABLE": "not stable",
    "NO_EQUILIBRIUM": "the loads shorten the arm to nothing",
    "UNDECIDED": "undecided: the search for an equilibrium gave up",
    "SNAPS": "the arm snaps before",
}


def _stability(rest: Rest | None) -> str:
    return "unknown: the loads are too large" if rest is None else _STABILITY[rest.status.name]


def _sag(how: str, rest: Rest | None) -> Rows:
    return {f"sag at rest{how}": (None if rest is None else rest.sag, "m")}
