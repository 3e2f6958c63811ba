"""Tendons driven by length: winches and servos that decide how much of a cable is pulled in."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from softreach.arm.actuators.tendon import Tendon
from softreach.arm.number import number
from softreach.support.errors import Fault

__all__ = ["LengthTendon"]

Array = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class LengthTendon(Tendon):
    """A tendon without friction whose activation is how much of it is pulled in, q [m].

    Its tension τ follows, and loads the arm as that of a `Tendon` does: τ = k (q - slack - s) +
    pretension where that is positive, with s the shortening of its path, else it is slack. Without
    a stiffness k it does not stretch: s = q - slack, unless it is slack.

    Raises:
        InvalidDesign: A field is out of its range, both or neither of `distance` and
            `distance_ratio` are given, or a pretension without `tendon_stiffness`.
    """

    unit: ClassVar[str] = "m"
    symbol: ClassVar[str] = "q"
    activation: ClassVar[str] = "displacement"
    least: ClassVar[float] = -math.inf

    slack: float = number("q0", "m", "pulled in by so much before it is taut", default=0.0)
    """q0, pulled in by so much before it is taut [m]; negative where it is pretensioned."""
    tendon_stiffness: float | None = number(
        "k", "N/m", "stiffness of tendon and drive in series", low=0.0, open_low=True, default=None
    )
    """k, stiffness of tendon and drive in series [N/m]; None for one that does not stretch."""
    pretension: float = number("τ0", "N", "tension at q0 of the straight arm", low=0.0, default=0.0)
    """τ0, tension at q = q0 while the arm keeps its shape [N]."""

    @property
    def compliance(self) -> float:
        """1/k [m/N]."""
        return 0.0 if self.tendon_stiffness is None else 1.0 / self.tendon_stiffness

    @property
    def taut_from(self) -> float:
        """Displacement at which it becomes taut while the arm keeps its shape [m]."""
        return self.slack - self.pretension * self.compliance

    def by_tension(self, bounds: Array) -> Tendon:
        """The same tendon driven by its tension within bounds [N], shape (bundles, 2)."""
        same = {field.name: getattr(self, field.name) for field in fields(Tendon)}
        return Tendon(**same | {"activation_bounds": bounds.tolist()})

    def _faults(self) -> list[Fault]:
        faults = super()._faults()
        blamed = {fault.path for fault in faults}
        is_doubtful = blamed & {"pretension", "tendon_stiffness"}
        if not is_doubtful and self.pretension and self.tendon_stiffness is None:
            allowed = "must be 0 without tendon_stiffness: such a tendon takes a slack below 0"
            faults.append(Fault("pretension", self.pretension, allowed))
        return faults
