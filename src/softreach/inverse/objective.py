"""What the activations should minimize: the miss of the target, their change, the direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softreach.arm.manipulator import Manipulator
from softreach.rod.tip_map import tip_map

__all__ = ["Objective", "tip_directions"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True)
class Objective:
    """½ s |γ - near|² + λ·c + ½ μ |c|² + ½ w² |d3 - direction|² with the miss c = (tip - target)/L.

    With s = 0 and λ = 0 its minimum is the nearest reachable point; with s = 1 and the right λ it
    is the least change that reaches the target (an augmented Lagrangian).
    """

    arm: Manipulator
    tol: float
    targets: Array
    """Shape (n, 3) [m]."""
    softness: float = 0.0
    """s [-]."""
    near: Array | None = None
    """Shape (n, m) [-]."""
    multiplier: Array | None = None
    """λ, shape (n, 3)."""
    penalty: float = 1.0
    """μ [-]."""
    direction: Array | None = None
    """Unit vectors, shape (n, 3)."""
    weight: float = 0.0
    """w [-]."""

    def __call__(self, which: Index, gamma: Array) -> tuple[Array, Array]:
        """Values and gradients at activations (k, m) of the chosen targets (k,)."""
        tips, slope = tip_map(self.arm, self.tol).tips_and_slopes(gamma)
        miss = (tips - self.targets[which]) / self.arm.length
        slope /= self.arm.length
        force = self.penalty * miss
        value = 0.5 * self.penalty * _squares(miss)
        if self.multiplier is not None:
            force += self.multiplier[which]
            value += np.einsum("ni,ni->n", self.multiplier[which], miss)
        gradient = np.einsum("ni,nij->nj", force, slope)
        if self.near is not None and self.softness:
            change = gamma - self.near[which]
            value += 0.5 * self.softness * _squares(change)
            gradient += self.softness * change
        if self.direction is not None and self.weight:
            wanted = self.direction[which]
            d3 = tip_directions(self.arm, gamma, self.tol)
            value += 0.5 * self.weight**2 * _squares(d3 - wanted)
            # ∂d3 = ω × d3, so that ½|d3 - e|² changes by -(ω × d3)·e = -ω·(d3 × e)
            jacobians = tip_map(self.arm, self.tol).tip_twists(gamma)[1]
            twist = np.einsum("nij,ni->nj", jacobians[:, 3:], np.cross(d3, wanted))
            gradient -= self.weight**2 * twist
        return value, gradient


def tip_directions(arm: Manipulator, gamma: Array, tol: float) -> Array:
    """Tangents d3 of the tips, shape (n, 3)."""
    return tip_map(arm, tol).tip_directions(gamma)


def _squares(rows: Array) -> Array:
    return np.einsum("ni,ni->n", rows, rows)
