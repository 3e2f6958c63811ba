"""What acts on an arm, and how it rests under it, as rows of a table."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from softreach.arm.loads import Loads
    from softreach.arm.manipulator import Manipulator
    from softreach.rest import Rest

__all__ = ["load_rows", "rest_rows"]

Rows = dict[str, tuple[Any, str]]

_STATUS = {
    "STABLE": "stable",
    "UNSTABLE": "not stable",
    "NO_EQUILIBRIUM": "no equilibrium follows from the unloaded arm",
}


def load_rows(loads: Loads | None) -> Rows:
    """Gravity with the way in which it makes the arm point, and all other loads that are not 0."""
    from softreach.arm.number import fields_of

    if loads is None:
        return {}
    rows: Rows = {}
    if any(loads.gravity):
        rows["gravity"] = (list(loads.gravity), "m/s²")
        rows["base"] = (_base(loads.gravity), "")
    for field, number in fields_of(type(loads)).items():
        value = getattr(loads, field)
        acts = any(value) if isinstance(value, tuple) else value
        if acts and field != "gravity":
            shown = list(value) if isinstance(value, tuple) else value
            rows[field.replace("_", " ")] = (shown, number.unit)
    if loads.point_loads:
        rows["point loads"] = (len(loads.point_loads), "")
    return rows


def _base(gravity: tuple[float, float, float]) -> str:
    """How the base stands: an arm at rest points along +z, gravity pulls downward."""
    angle = math.degrees(math.acos(-gravity[2] / math.hypot(*gravity)))
    for exactly, name in ((0, "upright"), (90, "sideways"), (180, "hanging")):
        if abs(angle - exactly) < 1e-6:
            return name
    return f"tilted from upright by {angle:.4g}°"


def rest_rows(arm: Manipulator) -> Rows:
    """Sag and stability of the arm at rest.

    Without loads: how far its own weight moves a tip that is held sideways, and whether the arm
    would stand upright; nothing where moduli or densities are not known.
    """
    from softreach.arm.loads import GRAVITY, Loads
    from softreach.arm.summary import load_number_faults

    if load_number_faults(arm):
        return {}
    if arm.loads is not None:
        found = _rest(arm)
        return _sag("", found) | {"at rest": (_status(found), "")}
    sideways, upright = (
        _rest(arm.replace(loads=Loads(gravity=gravity)))
        for gravity in ((GRAVITY, 0.0, 0.0), (0.0, 0.0, -GRAVITY))
    )
    return _sag(" sideways", sideways) | {"at rest upright": (_status(upright), "")}


def _rest(arm: Manipulator) -> Rest | None:
    """The arm at rest; None under loads that cannot be followed along it."""
    from softreach.rest import rest
    from softreach.support.errors import InvalidInput

    try:
        return rest(arm)
    except InvalidInput as error:
        if error.name != "loads":
            raise
        return None


def _status(found: Rest | None) -> str:
    return "too heavy to be told" if found is None else _STATUS[found.status.name]


def _sag(how: str, found: Rest | None) -> Rows:
    """How far the tip is moved, as a share of the length and as a length."""
    sag = (None, None)
    if found is not None and math.isfinite(found.sag):
        sag = found.sag_over_length, 1e3 * found.sag
    return {f"sag at rest{how}": (sag[0], "L"), f"sag of the tip at rest{how}": (sag[1], "mm")}
