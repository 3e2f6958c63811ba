"""What the rods of one arm have in common, free or loaded."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softreach.arm.manipulator import Manipulator
from softreach.arm.tables import check_extension
from softreach.rod.activation_box import ActivationBox
from softreach.rod.steps import check_tol
from softreach.rod.tip_map import TipMap, tip_map

__all__ = ["ArmRod"]


@dataclass(frozen=True, repr=False)
class ArmRod(TipMap):
    """The rod that one arm is, in the activations of all its bundles.

    Raises:
        InvalidInput: `tol` out of range.
        InvalidDesign: Some activation within the bounds would shorten the arm to nothing.
    """

    arm: Manipulator
    tol: float = 1e-6

    def __post_init__(self) -> None:
        object.__setattr__(self, "tol", check_tol(self.tol))
        check_extension(self.arm)

    @property
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self._box

    @cached_property
    def _box(self) -> ActivationBox:
        return ActivationBox.between(self.arm.bounds, self.arm.bundle_names)

    def refined(self, tol: float) -> TipMap:
        """The map of the same arm to a smaller tolerance; itself if its own is no larger."""
        return self if self.tol <= check_tol(tol) else tip_map(self.arm, tol)

    def radius(self, stations: ArrayLike) -> NDArray[np.float64]:
        """Outer radius R2 before activation at stations Z [m]."""
        return self.arm.profile.radius(stations)
