"""A tip that pushes: where a rod comes to rest while a force along one direction acts on its tip.

Every force has tables of its own, but only a column of them is new.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach.rod.activation_box import ActivationBox
from softreach.rod.equilibrium import Solver
from softreach.rod.loaded import LoadedRod
from softreach.rod.tip_force_tables import TipForceTables
from softreach.rod.tip_map import TipStatus, position_slopes

__all__ = ["PushingTip", "TipResponse"]

Array = NDArray[np.float64]


class TipResponse(NamedTuple):
    """Where one tip is, and how it moves."""

    tip: Array
    """r [m], shape (3,); NaN where there is no equilibrium."""
    slope: Array
    """∂r/∂γ [m], shape (3, bundles)."""
    retreat: Array
    """How the tip yields to the force with which it pushes, -∂r/∂F [m/N], shape (3,)."""


@dataclass(frozen=True, eq=False)
class PushingTip:
    """The tip of a rod that pushes along a direction, and on which as much pushes back.

    Args:
        rod: The rod with its other loads.
        direction: Unit vector along which the tip pushes.
        steps: Along the arm.
    """

    rod: LoadedRod
    direction: Array
    steps: int

    @property
    def box(self) -> ActivationBox:
        """The activations within bounds."""
        return self.rod.box

    @cached_property
    def _tables(self) -> TipForceTables:
        return TipForceTables(self.rod.arm, self.rod.loads, self.rod.body, -self.direction)

    def _solver(self, force: float, steps: int) -> Solver:
        return Solver(self._tables.under(force), steps, self.rod.tol)

    def respond(self, gamma: Array, force: float) -> TipResponse:
        """The tip and its derivatives at an activation (bundles,), pushing with a force [N]."""
        found = self._solver(force, self.steps).respond(gamma[None], compliance=True)
        slopes = np.empty_like(found.twists[:, :3])
        position_slopes(found.tips, found.twists, slopes)
        return TipResponse(found.tips[0], slopes[0], found.compliance[0] @ self.direction)

    def is_stable(self, gamma: Array, force: float) -> bool:
        """Whether the rod rests stably so."""
        found = self._solver(force, self.steps).find(gamma[None])
        return bool(found.status[0] == TipStatus.STABLE)

    def error(self, gamma: Array, force: float) -> float:
        """How far the tip moves if the steps are halved [m]."""
        tips = [
            self._solver(force, n).find(gamma[None]).tips[0] for n in (self.steps, 2 * self.steps)
        ]
        return float(np.linalg.norm(tips[1] - tips[0]))

    def finer(self) -> PushingTip:
        """The same with steps half as long."""
        return PushingTip(self.rod, self.direction, 2 * self.steps)
