"""One family of fibers: how it winds, where its bundles sit, how wide they are."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self

from softreach.errors import Fault, InvalidDesign, Range

__all__ = ["FiberArchitecture"]

_RANGES = {
    "helical_angle": Range(-math.pi / 2, math.pi / 2, "rad", open_low=True, open_high=True),
    "revolution": Range(unit="rad"),
    "offset": Range(unit="rad"),
    "extent": Range(0.0, 2 * math.pi, "rad", open_low=True),
    "bundles": Range(low=1, whole=True),
}


@dataclass(frozen=True, kw_only=True)
class FiberArchitecture:
    """A helical or longitudinal fiber architecture with equidistant bundles (section 2).

    Give either the helical angle or the revolution; 0 is longitudinal, positive is right-handed.

    Raises:
        InvalidDesign: A field is out of its range, or both or neither of `helical_angle` and
            `revolution` are given.
    """

    helical_angle: float | None = None
    """α, from the axis, at the outer radius [rad]; |α| < π/2."""
    revolution: float | None = None
    """Ω = Θ(L), total rotation of a fiber about the axis from base to tip [rad]."""
    offset: float = 0.0
    """θ0, polar angle of the center of the first bundle at Z = 0 [rad]."""
    extent: float
    """σ, angular extent of every bundle [rad]; 0 < σ ≤ 2π."""
    bundles: int = 1
    """n, independent bundles, spaced evenly by 2π/n [-]."""
    name: str = ""
    """What reports and pictures call it."""

    def __post_init__(self) -> None:
        if faults := fiber_faults(vars(self)):
            raise InvalidDesign(faults)
        for field in _RANGES:
            object.__setattr__(self, field, plain_number(getattr(self, field)))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed; a new angle takes the place of a revolution."""
        if changes.get("helical_angle") is not None:
            changes.setdefault("revolution", None)
        if changes.get("revolution") is not None:
            changes.setdefault("helical_angle", None)
        return replace(self, **changes)


def plain_number(value: Any) -> Any:
    """A Python number for a NumPy scalar; anything else as it is."""
    return value.item() if hasattr(value, "item") and getattr(value, "ndim", 0) == 0 else value


def range_faults(values: Mapping[str, Any], ranges: Mapping[str, Range]) -> list[Fault]:
    """A fault for each value outside its range; None is skipped."""
    faults = []
    for name, allowed in ranges.items():
        value = plain_number(values.get(name))
        if value is not None and not allowed.admits(value):
            faults.append(Fault(name, value, allowed))
    return faults


def fiber_faults(values: Mapping[str, Any]) -> list[Fault]:
    """Everything wrong with the fields of one architecture; absent fields are not judged."""
    faults = range_faults(values, _RANGES)
    if {"helical_angle", "revolution"} <= values.keys():
        faults += _winding_faults(values["helical_angle"], values["revolution"])
    return faults


def _winding_faults(angle: float | None, revolution: float | None) -> list[Fault]:
    if (angle is None) != (revolution is None):
        return []
    allowed = "give exactly one of helical_angle and revolution (0 for a longitudinal fiber)"
    return [Fault("helical_angle, revolution", (angle, revolution), allowed)]
