"""Tips and slopes of stable equilibria only: what counts as reached."""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.errors import InvalidInput
from softreach.rod.tip_map import BLOCK, TipMap, TipStatus

__all__ = ["fill_stable_slopes", "none_stable", "stable_slopes", "stable_tips"]

Array = NDArray[np.float64]


def stable_tips(rod: TipMap, gamma: Array) -> Array:
    """Tips [m] of activations (n, bundles), NaN where there is no stable equilibrium, (n, 3)."""
    if not rod.supports_unstable:
        return rod.tips(gamma)
    tips, status = rod.tips_and_status(gamma)
    tips[status != TipStatus.STABLE] = np.nan
    return tips


def fill_stable_slopes(rod: TipMap, gamma: Array, tips: Array, slopes: Array) -> None:
    """Put tips (n, 3) and ∂r/∂γ (n, 3, bundles) [m] into place, on the calling thread.

    Where there is no stable equilibrium the tips are NaN, and the slopes mean nothing.
    """
    if not rod.supports_unstable:
        return rod.fill_slopes(gamma, tips, slopes)
    status = np.empty(len(gamma), np.int8)
    rod.fill_slopes_and_status(gamma, tips, slopes, status=status)
    tips[status != TipStatus.STABLE] = np.nan
    return None


def stable_slopes(rod: TipMap, gamma: Array) -> tuple[Array, Array]:
    """Tips [m] (n, 3) and ∂r/∂γ [m] (n, 3, bundles); NaN where there is no stable equilibrium."""
    if not rod.supports_unstable:
        return rod.tips_and_slopes(gamma)
    tips, slopes = np.empty((len(gamma), 3)), np.empty((len(gamma), 3, rod.box.bundles))
    parallel.run(
        partial(fill_stable_slopes, rod, gamma[block], tips[block], slopes[block])
        for block in parallel.blocks(len(gamma), BLOCK // 16)
    )
    slopes[np.isnan(tips[:, 0])] = np.nan
    return tips, slopes


def none_stable(tried: int) -> InvalidInput:
    """What to raise where nothing is reached, after as many activations."""
    found = f"none of {tried} activations tried has a stable equilibrium"
    return InvalidInput("loads", found, "such that some have one", "lighten the load")
