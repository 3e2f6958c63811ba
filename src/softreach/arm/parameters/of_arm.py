"""All parameters of an arm by name, and the arm that has other values."""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator, Mapping

from softreach.arm.actuators import Actuator
from softreach.arm.checks import FIBER_RANGES, MATERIAL_RANGES
from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters.draft import Draft
from softreach.arm.parameters.parameter import (
    ActuatorParameter,
    BoundParameter,
    Parameter,
    ProfileParameter,
    RadiusRatio,
    Revolution,
    RingMaterialParameter,
    SharedParameter,
    Taper,
)
from softreach.arm.variable import Variable
from softreach.errors import InvalidInput, Range

__all__ = ["changed", "find_parameter", "parameters", "unknown_parameter"]

_RATIO = Variable(
    "radius_ratio",
    "R1/R2",
    "inner over outer radius",
    Range(0.0, 1.0, open_high=True),
)
_POISSON = Variable("poisson_ratio", "ν", "Poisson's ratio", MATERIAL_RANGES["poisson_ratio"])
_REVOLUTION = Variable(
    "revolution",
    "Ω",
    "revolution of all helical fibers, each in its own sense",
    FIBER_RANGES["revolution"],
)
_BOUNDS = {
    "lower": "lowest activation",
    "upper": "highest activation",
}


def parameters(arm: Manipulator) -> dict[str, Parameter]:
    """Every parameter of an arm by its name.

    Those of the whole arm come first. `revolution` turns all helical fibers, each in its own sense;
    `extent`, `lower` and `upper` (the bounds of activations) belong to all actuators that have
    them. One actuator's own parameters begin with its name and a dot: `left.offset`.
    """
    own = [one for actuator in arm.actuators for one in _of_actuator(actuator)]
    return {one.name: one for one in (*_of_arm(arm, own), *own)}


def find_parameter(arm: Manipulator, name: str) -> Parameter:
    """The parameter of this name.

    Raises:
        InvalidInput: The arm has no such parameter.
    """
    known = parameters(arm)
    if name not in known:
        raise unknown_parameter(name, known)
    return known[name]


def changed(arm: Manipulator, values: Mapping[str, float]) -> Manipulator:
    """The design with these parameters, everything else unchanged.

    They are applied together, as one may be valid only with another; an actuator's own
    parameter wins over one of the whole arm. When the taper changes, revolutions stay and helical
    angles follow; a new outer radius keeps the ratio of the radii.

    Args:
        arm: The design to start from.
        values: Name of a parameter -> value in its unit.

    Raises:
        InvalidInput: An unknown parameter.
        InvalidDesign: No such arm can exist; the error names every fault.
    """
    known = parameters(arm)
    for name in values:
        if name not in known:
            raise unknown_parameter(name, known)
    draft = Draft(arm)
    for name, parameter in known.items():
        if name in values:
            parameter.change(draft, values[name])
    return draft.made() if values else arm


def unknown_parameter(name: str, known: Iterable[str]) -> InvalidInput:
    """What to raise for a name that no parameter has; it suggests the closest one."""
    names = list(known)
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.5)
    hint = f'did you mean "{close[0]}"?' if close else ""
    allowed = f"one of {', '.join(name for name in names if '.' not in name)}"
    if own := [name for name in names if "." in name]:
        allowed += f", or of one actuator, such as {own[0]}"
    return InvalidInput("parameter", name, allowed, hint)


def _of_arm(arm: Manipulator, own: list[Parameter]) -> Iterator[Parameter]:
    of_profile = {variable.field: variable for variable in arm.profile.variables}
    if any(one.field == "revolution" for one in own):
        yield Revolution("revolution", _REVOLUTION)
    if "taper" in of_profile:
        yield Taper("taper", of_profile.pop("taper"))
    yield RadiusRatio("radius_ratio", _RATIO)
    yield from (ProfileParameter(field, variable) for field, variable in of_profile.items())
    yield RingMaterialParameter("poisson_ratio", _POISSON)
    for field in ("extent", "lower", "upper"):
        yield from _shared(field, tuple(one for one in own if one.field == field))


def _shared(field: str, parts: tuple[Parameter, ...]) -> Iterator[Parameter]:
    """One parameter for all actuators that have such a field, if it has the same unit in all."""
    if len({part.unit for part in parts}) == 1:
        yield SharedParameter(field, parts[0].variable, parts)


def _of_actuator(actuator: Actuator) -> Iterator[Parameter]:
    for variable in actuator.variables:
        yield ActuatorParameter(f"{actuator.name}.{variable.field}", variable)
    unit = "" if actuator.unit == "1" else actuator.unit
    for side, (field, meaning) in enumerate(_BOUNDS.items()):
        variable = Variable(field, "γ", meaning, Range(unit=unit))
        yield BoundParameter(f"{actuator.name}.{field}", variable, side)
