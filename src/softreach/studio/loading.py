"""Gravity, payload and tip force of a design, in the units that a person types."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from softreach.arm.design_file import in_file_terms
from softreach.arm.loads import GRAVITY, Loads, PointLoad
from softreach.arm.manipulator import Manipulator
from softreach.studio.state import Vector, vector
from softreach.support.errors import Fault, InvalidDesign, InvalidInput

__all__ = ["GRAVITIES", "TypedLoads", "gravity_name", "other_loads", "typed_loads", "with_loads"]

GRAVITIES: Mapping[str, Vector] = {
    "none": (0.0, 0.0, 0.0),
    "base upright": (0.0, 0.0, -GRAVITY),
    "hanging": (0.0, 0.0, GRAVITY),
    "sideways": (GRAVITY, 0.0, 0.0),
}
"""Gravity [m/s²] as the base sees it, whose tangent is +z."""

_GRAM, _MILLIMETER = 1e-3, 1e-3
_NONE = Loads(gravity=GRAVITIES["none"])
_MOST = 1e6  # of any unit that is typed: far above what an arm bears, far below an overflow
_SYMBOLS = {"young_modulus": "Young's modulus E", "density": "the density ρ"}


class TypedLoads(NamedTuple):
    """What the fields hold."""

    gravity: Vector = GRAVITIES["none"]
    """[m/s²]."""
    payload: float = 0.0
    """[g]."""
    payload_arm: Vector = (0.0, 0.0, 0.0)
    """[mm]."""
    tip_force: Vector = (0.0, 0.0, 0.0)
    """[N]."""


_FIELDS = {
    "gravity": ("gravity", "m/s²", 1.0),
    "payload": ("payload", "g", _GRAM),
    "payload_arm": ("lever arm", "mm", _MILLIMETER),
    "tip_force": ("tip force", "N", 1.0),
}


def typed_loads(arm: Manipulator) -> TypedLoads:
    """What a design has of the loads that can be typed."""
    loads = arm.loads or _NONE
    return TypedLoads(
        loads.gravity,
        _rounded(loads.payload / _GRAM),
        vector(_rounded(value / _MILLIMETER) for value in loads.payload_arm),
        loads.tip_force,
    )


def with_loads(arm: Manipulator, typed: TypedLoads) -> Manipulator:
    """The design under typed loads; other loads stay. Without any it is an arm without loads.

    Raises:
        InvalidInput: A number that no load can have.
        InvalidDesign: Matter that lacks what loads need, and where to give it.
    """
    _check(typed)
    known = typed_loads(arm)  # what a field only shows rounded is left as it is
    changes = {
        name: _in_si(name, getattr(typed, name))
        for name in TypedLoads._fields
        if getattr(typed, name) != getattr(known, name)
    }
    loads = (arm.loads or _NONE).replace(**changes)
    try:
        return arm.replace(loads=None if loads == _NONE else loads)
    except InvalidDesign as error:
        raise _in_words(error) from None


def gravity_name(gravity: Vector) -> str:
    """What the list of directions calls a gravity; "" for any other."""
    return next((name for name, one in GRAVITIES.items() if one == gravity), "")


def other_loads(arm: Manipulator) -> list[str]:
    """Loads of a design that have no field, in words."""
    loads = arm.loads or _NONE
    names = ("tip_moment", "follower_force", "follower_moment", "force_per_length")
    found = [name.replace("_", " ") for name in names if any(getattr(loads, name))]
    points: tuple[PointLoad, ...] = loads.point_loads
    return found + ([f"point loads ({len(points)})"] if points else [])


def _check(typed: TypedLoads) -> None:
    for name, value in typed._asdict().items():
        label, unit, _ = _FIELDS[name]
        low = 0.0 if name == "payload" else -_MOST
        numbers = np.atleast_1d(np.asarray(value, float))
        good = np.isfinite(numbers) & (numbers >= low) & (numbers <= _MOST)
        if not good.all():
            wrong = f"{numbers[np.flatnonzero(~good)[0]]:g} {unit}"
            raise InvalidInput(label, wrong, f"{low:,.0f} to {_MOST:,.0f} {unit}")


def _in_si(name: str, value: Vector | float) -> Vector | float:
    scale = _FIELDS[name][2]
    return value * scale if isinstance(value, float | int) else vector(scale * v for v in value)


def _rounded(value: float) -> float:
    return float(f"{value:.10g}")


def _in_words(error: InvalidDesign) -> InvalidDesign:
    """What an arm lacks that loads need, in one line."""
    lacking: dict[str, list[str]] = {}
    for fault in error.faults:
        owner, _, field = fault.path.rpartition(".")
        if field not in _SYMBOLS:
            return in_file_terms(error, "")
        lacking.setdefault(_owner(owner), []).append(_SYMBOLS[field])
    needed = "; ".join(f"{' and '.join(what)} of {owner}" for owner, what in lacking.items())
    line = f"need {needed}: choose a material or type the numbers on the tab Parts"
    return InvalidDesign([Fault("loads", None, line)])


def _owner(path: str) -> str:
    """A part by the name that the list of parts has for it."""
    return path.removesuffix(".material").replace("rings[", "ring ").replace("]", "")
