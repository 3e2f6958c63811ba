"""What a design says of a parameter of `atlas.parameter`: the inverse of `changed`."""

from __future__ import annotations

from softreach.arm.manipulator import Manipulator
from softreach.atlas.parameter import _tube, parameter_units
from softreach.errors import InvalidInput

__all__ = ["fiber_keys", "parameter_value"]

_FIELDS = ("revolution", "helical_angle", "offset", "extent", "bundles", "lower", "upper")


def fiber_keys(arm: Manipulator) -> list[str]:
    """The names by which the parameters of each fiber end."""
    return [n.removeprefix("bundles_") for n in parameter_units(arm) if n.startswith("bundles_")]


def parameter_value(arm: Manipulator, name: str) -> float:
    """The value in SI units; of the first fiber that has one where a parameter is of many.

    Raises:
        InvalidInput: An unknown parameter.
    """
    if name not in parameter_units(arm):
        raise InvalidInput("parameter", name, f"one of {', '.join(parameter_units(arm))}")
    if name == "revolution":
        turns = [abs(turn) for turn in _revolutions(arm) if turn]
        return turns[0] if turns else 0.0
    if name in ("extent", "lower", "upper"):
        return _of_fiber(arm, 0, name)
    for number, key in enumerate(fiber_keys(arm)):
        if (field := name.removesuffix(f"_{key}")) in _FIELDS:
            return _of_fiber(arm, number, field)
    return _tube(arm)[name]


def _revolutions(arm: Manipulator) -> list[float]:
    return [fiber.revolution_on(arm.profile, arm.section) for fiber in arm.fibers]


def _of_fiber(arm: Manipulator, number: int, field: str) -> float:
    if field in ("lower", "upper"):
        return float(arm.fibers[number].bounds[0, int(field == "upper")])
    if field == "revolution":
        return _revolutions(arm)[number]
    return float(getattr(arm.fibers[number], field))
