"""From targets in space to the nearest tips within reach, by descent from given activations."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.rod.damped_step import damped_steps
from softreach.rod.tip_map import BLOCK, TipMap
from softreach.workspace.stable import fill_stable_slopes

__all__ = ["Nearest", "nearest_tips"]

Array = NDArray[np.float64]

_TASK = BLOCK // 16
_MOST_STEPS = 30
_FIRST_DAMPING, _LEAST_DAMPING, _LARGEST_DAMPING = 1e-2, 1e-4, 1e4
_BELIEVED = 0.1  # damping above which the linear map says little of what is left to gain
_PROGRESS = 0.005  # of the tolerance or the distance: a smaller gain ends a search


class Nearest(NamedTuple):
    """Where searches ended: local minima of the distance, one for each target."""

    gamma: Array
    """Activations within the bounds, shape (n, bundles)."""
    tips: Array
    """Their tips [m], shape (n, 3)."""
    distance: Array
    """From tip to target [m], shape (n,); infinite where a search began without a stable
    equilibrium."""


def nearest_tips(rod: TipMap, start: Array, targets: Array, enough: float) -> Nearest:
    """The activations whose tips come closest to targets, as far as a descent from `start` finds.

    Only stable equilibria are taken.

    Args:
        rod: The tip map.
        start: Where to begin, within the bounds, shape (n, bundles).
        targets: Places [m], shape (n, 3).
        enough: Distance at which a target counts as reached [m].
    """
    gamma = np.ascontiguousarray(start)
    found = Nearest(gamma.copy(), np.empty_like(targets), np.empty(len(targets)))

    def task(block: slice) -> None:
        parts = (found.gamma[block], found.tips[block], found.distance[block])
        _descend(rod, targets[block], enough, Nearest(*parts))

    parallel.run(partial(task, block) for block in parallel.blocks(len(targets), _TASK))
    return found


def _descend(rod: TipMap, targets: Array, enough: float, found: Nearest) -> None:
    """Damped Gauss and Newton steps that stay within the bounds; on the calling thread."""
    active, damping = np.arange(len(targets)), np.full(len(targets), _FIRST_DAMPING)
    slopes = np.empty((len(targets), 3, rod.box.bundles))
    fill_stable_slopes(rod, found.gamma, found.tips, slopes)
    found.distance[:] = _distance(found.tips, targets)
    active = active[np.isfinite(found.distance)]  # others start where nothing is stable
    for _ in range(_MOST_STEPS):
        active = active[found.distance[active] > enough]
        if not len(active):
            return
        gamma, now = found.gamma[active], found.distance[active]
        miss, slope = found.tips[active] - targets[active], slopes[active]
        square = ((slope * rod.box.scales) ** 2).sum(axis=(1, 2)) / 3.0
        softness = damping[active] * square + 1e-300
        trial, left = damped_steps(rod.box, gamma, miss, slope, softness)
        tips, ahead = np.empty((len(active), 3)), np.empty((len(active), 3, rod.box.bundles))
        fill_stable_slopes(rod, trial, tips, ahead)
        distance = _distance(tips, targets[active])
        better = distance < now
        taken = active[better]
        found.gamma[taken], found.tips[taken] = trial[better], tips[better]
        found.distance[taken], slopes[taken] = distance[better], ahead[better]
        good = now - distance > 0.25 * (now - left)
        believed = damping[active] <= _BELIEVED
        # Searches beyond the loss of stability take long: a step into it is shortened much.
        worse = np.where(np.isinf(distance), 100.0, 10.0)
        factor = np.where(good, 0.1, np.where(better, 1.0, worse))
        damping[active] = np.maximum(damping[active] * factor, _LEAST_DAMPING)
        # What the linear map promises bounds what is left to gain, once it is to be believed.
        small = (now - left <= _PROGRESS * np.minimum(enough, now)) & believed
        active = active[~small & (damping[active] < _LARGEST_DAMPING)]


def _distance(tips: Array, targets: Array) -> Array:
    """From tips to targets [m]; infinite for those that are not stable."""
    distance = np.linalg.norm(tips - targets, axis=1)
    return np.where(np.isnan(distance), np.inf, distance)
