"""From targets in space to the nearest tips within reach, by descent from given activations."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softreach import parallel
from softreach.kernels.box_projection import project
from softreach.kernels.descent import FIRST_DAMPING, NOWHERE, Running, judge, next_trials
from softreach.rod.stable_tips import stable_tips
from softreach.rod.tip_map import BLOCK, TipMap

__all__ = ["Nearest", "nearest_tips"]

Array = NDArray[np.float64]

_TOGETHER = BLOCK // 16  # searches that one thread runs side by side


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
    rod, gamma = stable_tips(rod), np.ascontiguousarray(start)
    found = Nearest(gamma.copy(), np.empty_like(targets), np.empty(len(targets)))

    def task(block: slice) -> None:
        parts = (found.gamma[block], found.tips[block], found.distance[block])
        _descend(rod, targets[block], enough, Nearest(*parts))

    # Searches that end make room for others; only the last of a task run by a few.
    share = max(_TOGETHER, -(-len(targets) // parallel.thread_count()))
    parallel.run(partial(task, block) for block in parallel.blocks(len(targets), share))
    return found


def _descend(rod: TipMap, targets: Array, enough: float, found: Nearest) -> None:
    """Damped Gauss and Newton steps that stay within the bounds; on the calling thread."""
    total, box = len(targets), rod.box
    bounds = box.low, box.high, box.scales
    running, center = _room(min(total, _TOGETHER), box.bundles)
    tips, ahead = np.empty_like(running.wanted), np.empty_like(running.slope)
    step, multiplier = np.empty_like(running.trial), np.empty_like(running.wanted)
    begun = n = 0
    while begun < total or n:
        more = min(total - begun, len(tips) - n)
        new, rows = slice(n, n + more), slice(begun, begun + more)
        running.row[new], running.steps[new] = np.arange(begun, begun + more), 0
        running.trial[new], running.damping[new] = found.gamma[rows], FIRST_DAMPING
        n, begun = n + more, begun + more
        rod.fill_slopes(running.trial[:n], tips[:n], ahead[:n])
        if rod.supports_unstable:
            tips[np.isnan(tips[:n, 0]).nonzero()[0]] = NOWHERE
        n = judge(running, n, tips, ahead, targets, found, enough, *bounds)
        problem = running.slope, running.wanted, running.softness, running.low, running.high
        project(center[:n], *(part[:n] for part in problem), step[:n], multiplier[:n])
        next_trials(running, n, step, multiplier, found.gamma, *bounds)
    nowhere = found.distance >= NOWHERE
    found.distance[nowhere], found.tips[nowhere] = np.inf, np.nan


def _room(count: int, m: int) -> tuple[Running, Array]:
    """Place for as many searches side by side, and where their steps are centered."""
    integers = np.zeros(count, np.int64), np.zeros(count, np.int64)
    numbers = [np.zeros(shape) for shape in ((count,), (count,), (count, 3, m), (count, 3))]
    rest = [np.zeros(shape) for shape in ((count,), (count, m), (count, m), (count, m))]
    return Running(*integers, *numbers, *rest), np.zeros((count, m))
