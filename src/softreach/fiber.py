"""One family of fibers: how it winds, where its bundles sit, how wide they are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Self

from softreach.checks import FIBER_RANGES, fiber_faults, plain_number
from softreach.errors import InvalidDesign

__all__ = ["FiberArchitecture"]


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
        for field in FIBER_RANGES:
            object.__setattr__(self, field, plain_number(getattr(self, field)))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed; a new angle takes the place of a revolution."""
        if changes.get("helical_angle") is not None:
            changes.setdefault("revolution", None)
        if changes.get("revolution") is not None:
            changes.setdefault("helical_angle", None)
        return replace(self, **changes)
