"""Parameters as files and the command line write them: the unit in the name, angles in degrees."""

from __future__ import annotations

import math
import re

from softreach.arm.manipulator import Manipulator
from softreach.arm.parameters.changes import parameters_by_every_name
from softreach.arm.parameters.parameter import Parameter

__all__ = ["from_written", "with_suffix", "written_name", "written_parameters"]

_SUFFIX = {
    "rad": "_deg",
    "m": "_m",
    "1": "",
    "Pa": "_pa",
    "kg/m³": "_kg_m3",
    "N": "_n",
    "m/s²": "_m_s2",
    "N m": "_n_m",
    "N/m": "_n_per_m",
}
_PLACE = re.compile(r"(\[\d+\])?$")


def written_name(name: str, unit: str) -> str:
    """A name with its unit: `taper_deg`, `rings[0].material.young_modulus_pa`, `radii_m[1]`."""
    return with_suffix(name, _SUFFIX.get(unit, f"_{unit}"))


def with_suffix(name: str, suffix: str) -> str:
    """The name with a suffix, which stands before the place in a series."""
    return _PLACE.sub(lambda place: suffix + place[0], name, count=1)


def written_parameters(arm: Manipulator) -> dict[str, Parameter]:
    """Every parameter by its name with the unit."""
    return {written_name(n, one.unit): one for n, one in parameters_by_every_name(arm).items()}


def from_written(value: float, unit: str) -> float:
    """A value in SI units, from degrees where these are radians."""
    return math.radians(value) if unit == "rad" else value
