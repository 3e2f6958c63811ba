"""Parameters as files and the command line write them: the unit in the name, angles in degrees."""

from __future__ import annotations

import math
import re

from softreach.arm.manipulator import Manipulator
from softreach.arm.number import unit_suffix
from softreach.arm.parameters.changes import parameters_by_every_name
from softreach.arm.parameters.parameter import Parameter

__all__ = ["from_written", "with_suffix", "written_name", "written_parameters"]

_PLACE = re.compile(r"(\[\d+\])?$")


def written_name(name: str, unit: str) -> str:
    """A name with its unit: `taper_deg`, `rings[0].material.young_modulus_pa`, `radii_m[1]`."""
    return with_suffix(name, unit_suffix(unit))


def with_suffix(name: str, suffix: str) -> str:
    """The name with a suffix, which stands before the place in a series."""
    return _PLACE.sub(lambda place: suffix + place[0], name, count=1)


def written_parameters(arm: Manipulator) -> dict[str, Parameter]:
    """Every parameter by its name with the unit."""
    known = parameters_by_every_name(arm).items()
    return {written_name(name, parameter.unit): parameter for name, parameter in known}


def from_written(value: float, unit: str) -> float:
    """A value in SI units, from degrees where these are radians."""
    return math.radians(value) if unit == "rad" else value
