"""The damped step toward a target that no activation takes beyond its bounds."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softreach.kernels.box.box_projection import project
from softreach.rod.activation_box import ActivationBox

__all__ = ["damped_steps"]

Array = NDArray[np.float64]


def damped_steps(
    box: ActivationBox, gamma: Array, miss: Array, slopes: Array, damping: Array
) -> tuple[Array, Array]:
    """Minimize |miss + J d|² + μ |d|² inside the bounds, with d measured in ranges (Levenberg).

    Args:
        box: The bounds.
        gamma: Where the steps begin, inside the bounds [-], shape (n, m).
        miss: Tips minus targets, in any unit, shape (n, 3).
        slopes: ∂r/∂γ in that unit, shape (n, 3, m).
        damping: μ > 0, the square of that unit, shape (n,).

    Returns:
        Ends of the steps, never outside the bounds, and the |miss + J d| that is left, shape (n,).
    """
    step, multiplier = np.empty_like(gamma), np.empty((len(gamma), 3))
    low, high = (box.low - gamma) / box.scales, (box.high - gamma) / box.scales
    project(np.zeros_like(gamma), slopes * box.scales, -miss, damping, low, high, step, multiplier)
    # Where the step is the least, miss + J d is μ times the multiplier.
    return box.clip(gamma + step * box.scales), damping * np.linalg.norm(multiplier, axis=1)
