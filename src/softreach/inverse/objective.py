"""What a search for activations minimizes: miss of the target, change, error of direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softreach.rod.tip_map import TipMap

__all__ = ["Objective"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Objective:
    """½ |γ - near|² + λ·c + ½ μ |c|² + ½ w² |d3 - direction|² with the miss c = (tip - target)/L.

    Theory (40). Without near and λ its minimum is the nearest reachable point; with near and the
    right λ it is the least change that reaches the target (an augmented Lagrangian).
    """

    rod: TipMap
    targets: Array
    """One for each search [m], shape (n, 3)."""
    penalty: float = 1.0
    """μ [-]."""
    multiplier: Array | None = None
    """λ, shape (n, 3)."""
    near: Array | None = None
    """Shape (n, m) [-]; None for no term of change."""
    direction: Array | None = None
    """Unit vectors, shape (n, 3); None for no term of direction."""
    direction_weight: float = 0.0
    """w [-]."""

    def __call__(self, which: Index, gamma: Array) -> tuple[Array, Array]:
        """Values (k,) and gradients (k, m) at activations (k, m) of searches `which` (k,)."""
        if self.direction is None or not self.direction_weight:
            return self._of_position(which, gamma, *self.rod.tips_and_slopes(gamma))
        motions = self.rod.tip_motions(gamma)
        value, gradient = self._of_position(which, gamma, motions.tips, motions.slopes)
        wanted, squared_weight = self.direction[which], self.direction_weight**2
        value += 0.5 * squared_weight * _squares(motions.directions - wanted)
        # ∂d3 = ω × d3, so that ½|d3 - e|² changes by -(ω × d3)·e = -ω·(d3 × e)
        turn = np.cross(motions.directions, wanted)
        gradient -= squared_weight * np.einsum("nij,ni->nj", motions.rotations, turn)
        return value, gradient

    def _of_position(
        self, which: Index, gamma: Array, tips: Array, slopes: Array
    ) -> tuple[Array, Array]:
        """Value and gradient of all terms but that of the direction."""
        miss = (tips - self.targets[which]) / self.rod.length
        force = self.penalty * miss
        value = 0.5 * self.penalty * _squares(miss)
        if self.multiplier is not None:
            force += self.multiplier[which]
            value += np.einsum("ni,ni->n", self.multiplier[which], miss)
        gradient = np.einsum("ni,nij->nj", force, slopes / self.rod.length)
        if self.near is not None:
            change = gamma - self.near[which]
            value += 0.5 * _squares(change)
            gradient += change
        return value, gradient


def _squares(rows: Array) -> Array:
    return np.einsum("ni,ni->n", rows, rows)
