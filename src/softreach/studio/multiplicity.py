"""Multiplicity: the number of activations that reach a place, as the inverse finds them.

The grid of the exact set counts as well, but not near its folds, which in a folded set is where
half of the samples are.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from softreach.studio.reach import Reach
from softreach.studio.state import solvable_rod
from softreach.studio.work import StaleCheck, all_cores
from softreach.support import parallel
from softreach.support.progress import Progress, silent
from softreach.workspace import ReachableSolid

__all__ = ["count_activations", "counts_at", "uncounted"]

Array = NDArray[np.float64]

_BLOCK = 1 << 13
"""Targets solved at a time: a tenth of a second, after which others have their turn."""


def uncounted(reach: Reach, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of the samples whose number of activations is not known yet."""
    return rows[:0] if _reached_once(reach) else rows[np.isnan(reach.counts[rows])]


def count_activations(
    reach: Reach,
    rows: NDArray[np.int64],
    check: StaleCheck = lambda: None,
    progress: Progress = silent,
) -> NDArray[np.float64]:
    """Number of stable activations that put the tip where that of each sample is, shape (n,).

    Counts are kept with the reach, also if `check` raises.

    Args:
        reach: Of an arm with three free bundles.
        rows: Numbers of the samples.
        check: Called between blocks; raises to stop.
        progress: Called with the number of samples done since its last call.
    """
    if _reached_once(reach):
        return np.ones(len(rows))
    missing = uncounted(reach, rows)
    for block, counts_there in _counted(reach, reach.cloud.tip.values[missing], check):
        reach.counts[missing[block]] = counts_there
        progress(len(counts_there))
    return reach.counts[rows]


def counts_at(reach: Reach, targets: Array, check: StaleCheck = lambda: None) -> NDArray[np.int64]:
    """Number of stable activations that put the tip at each target [m], shape (t,).

    Args:
        reach: Of an arm with three free bundles.
        targets: Within the reachable set, shape (t, 3).
        check: Called between blocks; raises to stop.
    """
    counts = np.ones(len(targets), np.int64)
    if not _reached_once(reach):
        for block, counts_there in _counted(reach, targets, check):
            counts[block] = counts_there
    return counts


def _reached_once(reach: Reach) -> bool:
    """True if it is proved that no place is reached by two activations."""
    return isinstance(reach.exact, ReachableSolid) and reach.exact.route == "flux"


def _counted(
    reach: Reach, targets: Array, check: StaleCheck
) -> Iterator[tuple[slice, NDArray[np.int64]]]:
    from softreach.inverse import solve_inverse

    for block in parallel.blocks(len(targets), _BLOCK):
        check()
        with all_cores:
            counts = solve_inverse(solvable_rod(reach.arm), targets[block]).counts
        yield block, counts
